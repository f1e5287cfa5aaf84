"""What the test suite costs in processor time, beside another checkout's.

    python benchmarks/suite_cost.py [--against CHECKOUT] [--workers N] [--files N] [TESTS ...]

Runs each suite once, the other checkout's first, by this Python with pytest-xdist. Seconds are user
and system time of all processes, with those that tests start and wait for. Kernels that a checkout
has not compiled yet are compiled within its suite: run twice, and take the second, to leave them
out. With --files the dearest files of this checkout are listed: tests and the fixtures before them.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Where the tests' processes, which have this file as a plugin, write what each test costs.
_FOLDER = "BESMAN_SUITE_COST"
_BEFORE: dict[str, float] = {}


def cpu_s() -> float:
    """Return processor time of this process and of those it has waited for, seconds."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def pytest_runtest_logstart(nodeid: str) -> None:
    """Note what the process has spent before a test."""
    _BEFORE[nodeid] = cpu_s()


def pytest_runtest_logfinish(nodeid: str) -> None:
    """Write down what a test cost, and its file; the process that only distributes has none."""
    folder = os.environ.get(_FOLDER)
    if folder and "PYTEST_XDIST_WORKER" in os.environ:
        spent = cpu_s() - _BEFORE.pop(nodeid)
        with (Path(folder) / str(os.getpid())).open("a") as file:
            file.write(f"{spent:.3f}\t{nodeid.partition('::')[0]}\n")


def run_suite(root: Path, workers: int, tests: list[str]) -> tuple[float, Counter[str], str]:
    """Run a checkout's tests; return seconds of processor time, those of its files, last line."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.pathsep.join([str(root), str(Path(__file__).parent)])
        environment = {**os.environ, "PYTHONPATH": path, _FOLDER: folder}
        command = [sys.executable, "-m", "pytest", "-p", "suite_cost", "-p", "no:cacheprovider"]
        command += ["--numprocesses", str(workers), "--dist", "loadfile", *tests]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            command, cwd=root, env=environment, stdout=subprocess.PIPE, text=True, check=False
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        files: Counter[str] = Counter()
        for noted in Path(folder).iterdir():
            for line in noted.read_text().splitlines():
                seconds, name = line.split("\t")
                files[name] += float(seconds)
    spent = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    said = [line for line in done.stdout.splitlines() if line.strip()]
    return spent, files, said[-1] if said else f"exit code {done.returncode}"


def main() -> None:
    """Print what the suites cost, and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--against", type=Path, help="another checkout")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--files", type=int, default=0, help="list so many of the dearest files")
    parser.add_argument("tests", nargs="*", help="of both checkouts; all if not given")
    options = parser.parse_args()
    spent = []
    for root in filter(None, (options.against, ROOT)):
        seconds, files, said = run_suite(root.resolve(), options.workers, options.tests)
        spent.append(seconds)
        print(f"{root}: {seconds:.0f} s of CPU; {said}", flush=True)
    for name, seconds in files.most_common(options.files):
        print(f"{seconds:8.1f} s  {name}")
    if options.against:
        print(f"ratio: {spent[1] / spent[0]:.2f}")


if __name__ == "__main__":
    main()
