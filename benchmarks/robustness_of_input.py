"""Broken files of every kind against what reads them: counts by kind and outcome.

    python benchmarks/robustness_of_input.py [--seed N] [--count N] [--jobs N] [--show N]
        [--only KIND,KIND]

A mutant is made and read in a worker process that may use 2 s of CPU and 1 GB more than it has.
Refused in one line, taken, and taken with a warning are good; the rest is not. Any seed will do.
"""

import argparse
import json
import select
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

import psutil

TESTS = Path(__file__).resolve().parents[1] / "tests"
# A worker that says nothing for so long is stuck where no signal reaches it.
SILENT_S = 20.0


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=30_000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--show", type=int, default=20, help="Failures to print, by kind.")
    parser.add_argument("--json", type=Path, help="Write every failure here.")
    parser.add_argument("--only", default="", help="Kinds whose names begin so, with commas.")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        work(given.seed, given.only)
        return
    began = time.perf_counter()
    with ThreadPoolExecutor(given.jobs) as pool:
        shares = pool.map(
            lambda first: run(given.seed, range(first, given.count, given.jobs), given.only),
            range(given.jobs),
        )
        found = [one for share in shares for one in share]
    print_counts(found, given, time.perf_counter() - began)
    failed = [one for one in found if one["kind"] not in GOOD]
    if given.json is not None:
        given.json.write_text(json.dumps(failed, indent=1) + "\n", encoding="utf-8")
    sys.exit(1 if failed else 0)


GOOD = ("refused", "taken", "warned")
FAILED = ("traceback", "hang", "memory", "nonsense")


def work(seed, only):
    """Try the mutants whose numbers come in, one a line."""
    sys.path.insert(0, str(TESTS))
    from fuzz.attempts import attempt

    out = sys.stdout
    # What a library prints is not an answer.
    sys.stdout = sys.stderr
    for line in sys.stdin:
        print(json.dumps(asdict(attempt(seed, int(line), only))), file=out, flush=True)


def start(seed, only, errors):
    return subprocess.Popen(
        [sys.executable, __file__, "--worker", "--seed", str(seed), "--only", only],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        text=True,
    )


def run(seed, numbers, only):
    """Try mutants in a worker process; another one where it dies."""
    found = []
    with tempfile.TemporaryFile(mode="w+") as errors:
        worker = start(seed, only, errors)
        for number in numbers:
            print(number, file=worker.stdin, flush=True)
            line, why = answer_of(worker)
            if line:
                found.append({"number": number, **json.loads(line)})
                continue
            words = why if why else f"the process ended with {worker.wait()}: {last_line(errors)}"
            kind = "hang" if why else "traceback"
            found.append({"number": number, **UNKNOWN, "kind": kind, "words": words})
            worker = start(seed, only, errors)
        worker.stdin.close()
        worker.wait()
    return found


UNKNOWN = {"target": "?", "which": "", "seconds": 0.0}


def answer_of(worker):
    """Return a worker's next line and, if it computes and says nothing, that it was ended."""
    process = psutil.Process(worker.pid)
    began = sum(process.cpu_times()[:2])
    while not select.select([worker.stdout], [], [], SILENT_S)[0]:
        # A machine that is busy with other things is no hang.
        if sum(process.cpu_times()[:2]) - began > SILENT_S:
            worker.kill()
            worker.wait()
            return "", f"no answer after {SILENT_S:g} s of CPU"
    return worker.stdout.readline(), ""


def last_line(file):
    """Return the last line of what workers printed."""
    file.seek(max(0, file.seek(0, 2) - 2000))
    return ([line for line in file.read().splitlines() if line.strip()] or [""])[-1]


def print_counts(found, given, wall_s):
    kinds = (*GOOD, *FAILED)
    print(f"{'kind of input':30}" + "".join(f"{kind:>11}" for kind in kinds))
    targets = sorted({one["target"] for one in found})
    for target in (*targets, "all"):
        counts = Counter(one["kind"] for one in found if target in ("all", one["target"]))
        print(f"{target:30}" + "".join(f"{counts[kind]:>11}" for kind in kinds))
    cpu_s = sum(one["seconds"] for one in found)
    slowest = max(one["seconds"] for one in found)
    print(
        f"seed {given.seed}, {len(found)} mutants, {wall_s:.0f} s, reading {cpu_s:.0f} s of CPU, ",
        end="",
    )
    print(f"the slowest {slowest:.2f} s")
    for kind in FAILED:
        failures = [one for one in found if one["kind"] == kind]
        for one in failures[: given.show]:
            print(
                f"{kind}: {one['target']} ({one['which']}, number {one['number']}): {one['words']}"
            )


if __name__ == "__main__":
    main()
