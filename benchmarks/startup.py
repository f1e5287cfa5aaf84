"""How long commands take whose work is short, from their start to their end.

    python benchmarks/startup.py [--against CHECKOUT] [--runs N] [--imports]

With another checkout both are run in turn, so that a machine that gets slower is slow for both; it
is run by the Python of its `.venv` if it has one, else by this one. Times are medians of N runs
after one that is not counted, of wall and of processor time; ratios are medians of the pairs'.
``--imports`` tells instead what all processes of a default run (25 episodes a motion) take to load
modules, as Python's own ``-X importtime`` has it, by the clock.
"""

from __future__ import annotations

import argparse
import os
import re
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

    def _call(self, *arguments: str, **more: str) -> str:
        """Run a command, with more in its environment; return what it says of errors."""
        done = subprocess.run(
            [*self._command, *arguments],
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            cwd=self._root,
            env={**os.environ, "PYTHONPATH": str(self._root), **more},
        )
        return done.stderr.decode(errors="replace")

    def imports(self, folder: Path) -> tuple[float, int]:
        """Run all stages; return what its processes took to load modules, s, and how many."""
        settings = ("--set", "refine.episodes=25", "--set", "refine.robustness=null")
        run = ("run", "ur5_stick_throw", "--out", str(folder), *settings)
        told = _IMPORT.findall(self._call(*run, PYTHONPROFILEIMPORTTIME="1"))
        return sum(map(int, told)) / 1e6, len(told)

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


# Of a line of Python's: the module's own time, microseconds.
_IMPORT = re.compile(r"import time: +(\d+) \| +\d+ \|")


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


def show_imports(roots: list[Path], runs: int) -> None:
    """Print what all processes of a run take to load modules, checkouts in turn."""
    found: list[list[float]] = [[] for _ in roots]
    for number in range(runs):
        for at, root in enumerate(roots):
            with tempfile.TemporaryDirectory() as folder:
                one = Checkout(root, Path(folder) / "none")
                spent, modules = one.imports(Path(folder) / "run")
            found[at].append(spent)
            print(f"run {number}, {'other' if at else 'this'}: {spent:.2f} s, {modules} modules")
    medians = [statistics.median(one) for one in found]
    told = ", ".join(f"{median:.2f} s" for median in medians)
    ratio = f", ratio {medians[0] / medians[1]:.2f}" if len(medians) == 2 else ""
    print(f"imports of all processes, medians: {told}{ratio}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--imports", action="store_true", help="of all processes of a run")
    options = parser.parse_args()
    roots = [ROOT] if options.against is None else [ROOT, options.against.resolve()]
    if options.imports:
        show_imports(roots, options.runs)
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
