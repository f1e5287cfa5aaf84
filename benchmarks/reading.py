"""How long recordings take to be read, beside another build: what the checks of foreign files cost.

    python benchmarks/reading.py [--against CHECKOUT] [--rounds N]

Each build reads in a process of its own, turn by turn; times are CPU, the best of all. Without
another checkout the share of the checks in this one is measured.
"""

import argparse
import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
REAL = Path(os.environ.get("BESMAN_REAL_DATA", ROOT.parent / "shared" / "data"))
READS = 3


def find_files():
    """Return the recordings of the sample and, where they are, real ones."""
    found = sorted((ROOT / "data").glob("*/*.tsv"))
    for folder in ("pick_and_place", "c3d"):
        found += sorted(
            path for path in (REAL / folder).glob("*.*") if path.suffix in (".tsv", ".c3d")
        )
    return found


def read_when_told():
    """Read all files for every line that comes in; print the CPU seconds of each."""
    warnings.simplefilter("ignore")
    try:
        from besman.io.recordings.formats import read_recording
    except ImportError:
        # As it was called before the modules moved.
        from besman.io.recordings import read_recording
    files = find_files()
    for path in files:
        read_recording(path)
    for _ in sys.stdin:
        seconds = []
        for path in files:
            best = float("inf")
            for _ in range(READS):
                began = time.process_time()
                read_recording(path)
                best = min(best, time.process_time() - began)
            seconds.append(best)
        print(*seconds, flush=True)


def start(checkout):
    return subprocess.Popen(
        [sys.executable, __file__, "--reader"],
        cwd=checkout,
        env={**os.environ, "PYTHONPATH": str(checkout)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def compare(checkouts, rounds):
    """Return the least seconds of every file in each checkout."""
    readers = [start(checkout) for checkout in checkouts]
    least = [None] * len(readers)
    for turn in range(rounds):
        order = range(len(readers)) if turn % 2 == 0 else reversed(range(len(readers)))
        for which in order:
            print("go", file=readers[which].stdin, flush=True)
            found = [float(word) for word in readers[which].stdout.readline().split()]
            known = least[which]
            least[which] = found if known is None else list(map(min, known, found))
    for reader in readers:
        reader.stdin.close()
        reader.wait()
    return least


def measure_checks(files):
    """Return the least seconds that the checks of what was read take, of every file."""
    from besman.io.recordings.formats import read_recording
    from besman.io.recordings.plausibility import check_recording

    found = []
    for path in files:
        recording, best = read_recording(path), float("inf")
        for _ in range(20):
            began = time.process_time()
            check_recording(recording, path)
            best = min(best, time.process_time() - began)
        found.append(best)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--against", type=Path, help="Root of another checkout.")
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--reader", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.reader:
        read_when_told()
        return
    warnings.simplefilter("ignore")
    files = find_files()
    checkouts = [ROOT] if given.against is None else [ROOT, given.against.resolve()]
    own, *others = compare(checkouts, given.rounds)
    checks = measure_checks(files)
    print(
        f"{'recording':40} {'read':>9} {'checks':>8}"
        + (f" {'other':>9} {'ratio':>6}" if others else "")
    )
    rows = [*zip(files, own, checks, others[0] if others else own, strict=True)]
    for path, mine, check, other in rows:
        print(
            f"{path.parent.name + '/' + path.name:40} {1e3 * mine:6.1f} ms {1e3 * check:5.2f} ms",
            end="",
        )
        print(f" {1e3 * other:6.1f} ms {mine / other:6.3f}" if others else "")
    total, share = sum(own), sum(checks) / sum(own)
    print(f"all: {1e3 * total:.0f} ms of CPU, of which the checks {100 * share:.1f} %", end="")
    print(f"; {total / sum(others[0]):.3f} times the other build" if others else "")


if __name__ == "__main__":
    main()
