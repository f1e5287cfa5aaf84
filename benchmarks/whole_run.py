"""Whole default runs beside those of another checkout: wall and processor time of all processes.

    python benchmarks/whole_run.py --against CHECKOUT [--runs N] [--stages]

The same command in turn, each from its checkout's own folder into a new run folder, cold. Wall
times count on an idle machine alone; processor time, of the command, of what workers are forked
from and of these, counts on any. ``--stages`` tells instead what this checkout's command and its
workers spend until when, of one run: what goes on while one of the cores has nothing to do.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_TICKS = os.sysconf("SC_CLK_TCK")


def spent_by(pid: int) -> dict[int, float]:
    """Return the processor time of a process and all that come from it, s, by their numbers."""
    found, left = {}, [str(pid)]
    while left:
        one = left.pop()
        try:
            fields = Path(f"/proc/{one}/stat").read_text().rsplit(")", 1)[1].split()
            tasks = [path / "children" for path in Path(f"/proc/{one}/task").iterdir()]
            left += [child for task in tasks for child in task.read_text().split()]
        except OSError:
            # It has ended meanwhile.
            continue
        found[int(one)] = (int(fields[11]) + int(fields[12])) / _TICKS
    return found


class Run:
    """A default run of a checkout, watched until it ends.

    Attributes
    ----------
    wall_s, cpu_s : float
        Of all its processes.
    told : list of (str, float, float)
        Lines of its progress, each with the processor time of the command and of all others.
    """

    def __init__(self, root: Path, folder: Path) -> None:
        own = root / ".venv" / "bin" / "python"
        python = own if own.is_file() else sys.executable
        start, self.told = time.perf_counter(), []
        self._spent: dict[int, float] = {}
        process = subprocess.Popen(
            [str(python), "-m", "besman", "run", "ur5_stick_throw", "--out", str(folder)],
            cwd=root,
            env={**os.environ, "PYTHONPATH": str(root), "OPENBLAS_NUM_THREADS": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        over = threading.Event()
        watching = threading.Thread(target=self._watch, args=(process.pid, over))
        watching.start()
        assert process.stderr is not None
        for line in process.stderr:
            self._look(process.pid)
            mine = self._spent.get(process.pid, 0.0)
            self.told.append((line.strip(), mine, sum(self._spent.values()) - mine))
        code = process.wait()
        self.wall_s = time.perf_counter() - start
        over.set()
        watching.join()
        if code:
            raise SystemExit(f"{root}: exit code {code}")
        self.cpu_s = sum(self._spent.values())

    def _watch(self, pid: int, over: threading.Event) -> None:
        while not over.wait(0.05):
            self._look(pid)

    def _look(self, pid: int) -> None:
        """Keep the last that is known of each process, also of those that have ended."""
        self._spent |= spent_by(pid)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--stages", action="store_true", help="of one run of this checkout")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if options.stages:
            for line, own, others in Run(ROOT, Path(folder) / "run").told:
                print(f"command {own:6.2f} s, others {others:6.2f} s of CPU  {line}")
            return
        roots = [ROOT] if options.against is None else [ROOT, options.against.resolve()]
        runs: list[list[Run]] = []
        for number in range(options.runs):
            pair = [Run(root, Path(folder) / f"run{number}_{at}") for at, root in enumerate(roots)]
            runs.append(pair)
            told = " against ".join(
                f"wall {one.wall_s:.2f} s, CPU {one.cpu_s:.2f} s" for one in pair
            )
            print(f"{told}, load {os.getloadavg()[0]:.1f}", flush=True)
        if len(roots) == 2:
            for name in ("wall_s", "cpu_s"):
                ratios = [getattr(other, name) / getattr(own, name) for own, other in runs]
                print(f"{name}: {statistics.median(ratios):.2f} times faster (median of pairs)")


if __name__ == "__main__":
    main()
