"""How long commands take whose work is short, from their start to their end.

    python benchmarks/startup.py [--against CHECKOUT] [--runs N] [--imports]

With another checkout both are run in turn, so that a machine that gets slower is slow for both; it
is run by the Python of its `.venv` if it has one, else by this one. Times are medians of N runs
after one that is not counted, of wall and of processor time; ratios are medians of the pairs'.
``--imports`` tells instead in what processor time the processes of a default run start and load
modules: the command, the process that workers are forked from, two workers until they begin.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SAMPLE = ROOT / "data" / "stick_throw" / "subject1.tsv"


class Cost(NamedTuple):
    """Of one run of a command, seconds."""

    wall: float
    cpu: float


class Checkout:
    """A checkout whose commands are timed, with a run folder of its own to report on."""

    def __init__(self, root: Path, run: Path) -> None:
        python = root / ".venv" / "bin" / "python"
        self._command = [str(python) if python.is_file() else sys.executable, "-m", "besman"]
        self._root, self._run = root, run

    def _call(self, *arguments: str) -> None:
        """Run a command."""
        subprocess.run(
            [*self._command, *arguments],
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=self._root,
            env={**os.environ, "PYTHONPATH": str(self._root)},
        )

    def imports(self) -> list[float]:
        """Start the processes of a run; return the CPU time of loading modules, s.

        Of the command itself, of what its workers are forked from, of all workers until they begin.
        """
        done = subprocess.run(
            [self._command[0], "-c", _IMPORTS],
            check=True,
            stdout=subprocess.PIPE,
            cwd=self._root,
            env={**os.environ, "PYTHONPATH": str(self._root), "OPENBLAS_NUM_THREADS": "1"},
        )
        return [float(word) for word in done.stdout.split()]

    def make_run(self, capture: Path) -> None:
        """Make the small run to report on, by this checkout: few episodes."""
        settings = [word for one in SETTINGS for word in ("--set", one)]
        recordings = ("--set", f"recordings={capture}")
        self._call("run", "ur5_stick_throw", "--out", str(self._run), *recordings, *settings)

    def measure(self, name: str) -> Cost:
        """Run a command; return what it cost."""
        arguments = {
            "--help": ("--help",),
            "info": ("info",),
            "segment": ("segment", str(SAMPLE)),
            "check": ("check", "ur5_stick_throw"),
            "report": ("report", str(self._run)),
            "report, drawn anew": ("report", str(self._run)),
        }[name]
        if name.endswith("anew"):
            (self._run / "figures.json").unlink(missing_ok=True)
        before, start = _children_s(), time.perf_counter()
        self._call(*arguments)
        return Cost(time.perf_counter() - start, _children_s() - before)


COMMANDS = ("--help", "info", "segment", "check", "report", "report, drawn anew")


# What the default run's processes load: the second half of each pair is where 58ea6d7 has it.
_IMPORTS = """
import os, time
from functools import partial
from importlib import import_module
from multiprocessing import forkserver
from pathlib import Path
try:
    import besman.cli.main
    from besman.cli.run import _load_ahead, _workers
    _load_ahead(Path("nowhere"), Path("/nowhere"), 2, None)
    workers = _workers(2, None)
    import besman.pipeline.pipeline
    work = ["besman.stages.refine.search_loop", "mujoco.rollout"]
    rest = ["besman.report.page"]
except ImportError:
    from besman.workers import Workers
    workers = Workers(2)
    import besman.cli, besman.pipeline
    work = ["besman.refinement.pool", "besman.simulation.throw", "besman.robot.dynamics"]
    work += ["besman.robot.collision", "mujoco.rollout"]
    rest = ["besman.mapping.embodiment", *work, "besman.report.page", "matplotlib.figure"]
    rest += ["matplotlib.backends.backend_svg"]
for name in rest:
    import_module(name)
spent, server = time.process_time(), 0.0
told = f"[__import__('importlib').import_module(m) for m in {work}]"
told = f"({told}, __import__('time').sleep(0.5), __import__('time').process_time())[-1]"
with workers:
    begun = [one.value for _, one in workers.in_processes(partial(eval, told), [{}, {}])]
    pid = forkserver._forkserver._forkserver_pid
    if pid is not None:
        ticks = Path(f"/proc/{pid}/stat").read_text().rsplit(")")[1].split()[11:13]
        server = sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")
print(spent, server, sum(begun))
"""


def _children_s() -> float:
    """Return the processor time of all commands that have ended, seconds."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


SETTINGS = (
    "recognize.examples_per_class=2",
    "map.evaluations=60",
    "refine.episodes=25",
    "refine.robustness=null",
)


def make_capture(folder: Path) -> Path:
    """Make the recording of the run to report on: three throws."""
    from besman.synthetic.datasets import write_synthetic

    write_synthetic("stick_throw", folder / "capture", n_subjects=1, n_repetitions=3, seed=3)
    return folder / "capture"


def show(name: str, costs: list[tuple[Cost, ...]]) -> None:
    """Print the medians of one command, and how those of two checkouts compare."""
    line = f"{name:20}"
    for one in zip(*costs, strict=True):
        wall, cpu = (statistics.median(values) for values in zip(*one, strict=True))
        line += f"{wall:9.2f} s{cpu:8.2f} s"
    if len(costs[0]) == 2:
        for part in range(2):
            line += f"{statistics.median(own[part] / other[part] for own, other in costs):8.2f}"
    print(line, flush=True)


def show_imports(checkouts: list[Checkout], runs: int) -> None:
    """Print what processes' start and imports take, checkouts in turn."""
    found = [[one.imports() for one in checkouts] for _ in range(runs)]
    for at, name in enumerate(("this", "other")[: len(checkouts)]):
        parts = [statistics.median(run[at][part] for run in found) for part in range(3)]
        print(
            f"{name}: command {parts[0]:.2f}, server {parts[1]:.2f}, workers {parts[2]:.2f} s of "
            f"CPU, together {statistics.median(sum(run[at]) for run in found):.2f} s"
        )
    if len(checkouts) == 2:
        ratio = statistics.median(sum(own) / sum(other) for own, other in found)
        print(f"ratio {ratio:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--imports", action="store_true", help="of the processes of a run")
    options = parser.parse_args()
    roots = [ROOT] if options.against is None else [ROOT, options.against.resolve()]
    if options.imports:
        show_imports([Checkout(root, root) for root in roots], options.runs)
        return
    with tempfile.TemporaryDirectory() as folder:
        capture = make_capture(Path(folder))
        checkouts = [
            Checkout(root, Path(folder) / f"run{number}") for number, root in enumerate(roots)
        ]
        for one in checkouts:
            one.make_run(capture)
        heads = ["this: wall", "CPU", "other: wall", "CPU"][: 2 * len(roots)]
        ratios = ["wall", "CPU"] if len(roots) == 2 else []
        heads = [f"{head:>{11 if 'wall' in head else 10}}" for head in heads]
        print(f"{'command':20}" + "".join(heads) + "".join(f"{one:>8}" for one in ratios))
        for name in COMMANDS:
            for one in checkouts:
                one.measure(name)
            show(name, [tuple(one.measure(name) for one in checkouts) for _ in range(options.runs)])


if __name__ == "__main__":
    main()
