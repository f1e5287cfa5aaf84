"""Random demonstrations through mapping and limits on every arm: violations at 1 kHz, refusals.

    python benchmarks/random_demonstrations.py [--count N] [--first N] [--seed N] [--jobs N]
        [--robots NAME ...] [--joints] [--json FILE]

Smooth ones, steps, spikes, 10 m/s, far outside, through singular configurations, repeated poses,
constant, of one to three samples, random walks, noise, turns and half turns; the model are the
random tests of Ruckig (https://github.com/pantor/ruckig). Each goes from the hand's poses through
inverse kinematics and limits; of those kept, one in four becomes a motion plan that is fitted to
the arm. What comes of it is looked at at every millisecond, by differences of the positions and
with Pinocchio and Coal too. With --joints random paths of the joints go through limits alone.

A demonstration is drawn from the seed and its number alone: a range that is done need not be
done again, and `--first NUMBER --count 1` repeats one. Exit code 1 if anything is violated.
"""

import argparse
import json
import os
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

# Before numpy is loaded: threads inside BLAS cost more than they save.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np
from demonstrations.attempts import Outcome, attempt
from demonstrations.draws import ROBOTS

BLOCK = 500


def try_block(seed: int, first: int, count: int, hand: bool, robots: tuple[str, ...]) -> list:
    numbers = range(first, first + count)
    return [attempt(seed, number, hand=hand, robots=robots) for number in numbers]


def try_all(given: argparse.Namespace) -> list[Outcome]:
    """Try the whole range in blocks; say how fast it goes."""
    began, found, failed = time.perf_counter(), [], 0
    last = given.first + given.count
    with ProcessPoolExecutor(given.jobs) as pool:
        waiting = [
            pool.submit(
                try_block,
                given.seed,
                first,
                min(BLOCK, last - first),
                not given.joints,
                tuple(given.robots),
            )
            for first in range(given.first, last, BLOCK)
        ]
        for block in waiting:
            found += block.result()
            failed += sum(bool(one.found) for one in block.result())
            rate = len(found) / (time.perf_counter() - began)
            print(
                f"\r{given.first + len(found)} of {last}, {rate:.1f} a second, {failed} failed ",
                end="",
                file=sys.stderr,
                flush=True,
            )
    print(file=sys.stderr)
    return found


def print_counts(found: list[Outcome]) -> None:
    """Print what became of them, by arm."""
    head = ("kept", "refused", "plans", "refused", "stretch 50 %", "95 %", "greatest")
    print(f"{'':12}{'tried':>9}" + "".join(f"{word:>13}" for word in head), end="")
    print(f"{'samples':>13}{'violations':>12}{'CPU s':>9}")
    for name in (*sorted({one.robot for one in found}), "all"):
        some = [one for one in found if name in ("all", one.robot)]
        kept = [one for one in some if not one.reason]
        plans = Counter(one.plan == "kept" for one in some if one.plan)
        stretch = np.array([one.stretch for one in kept])
        quantiles = np.nanpercentile(stretch, [50, 95, 100]) if len(kept) else [np.nan] * 3
        print(f"{name:12}{len(some):9}{len(kept):13}{len(some) - len(kept):13}", end="")
        print(f"{plans[True]:13}{plans[False]:13}", end="")
        print("".join(f"{value:13.2f}" for value in quantiles), end="")
        print(f"{sum(one.samples for one in some):13}", end="")
        print(f"{sum(one.found.total() for one in some):12}", end="")
        print(f"{sum(one.seconds for one in some):9.0f}")


def print_reasons(found: list[Outcome]) -> None:
    """Print why demonstrations and plans were refused, by arm."""
    names = sorted({one.robot for one in found})
    for what in ("reason", "plan"):
        reasons = Counter(getattr(one, what) for one in found)
        print(f"\nrefused {what}s" if what == "plan" else "\nrefused")
        for reason, count in reasons.most_common():
            if reason in ("", "kept"):
                continue
            by_arm = Counter(one.robot for one in found if getattr(one, what) == reason)
            parts = ", ".join(f"{name} {by_arm[name]}" for name in names)
            print(f"{count:9}  {reason} ({parts})")


def print_violations(found: list[Outcome], given: argparse.Namespace) -> None:
    """Print the violations by kind, and the demonstrations that have them."""
    total = sum((one.found for one in found), Counter())
    print("\nviolations: " + (", ".join(f"{k} {n}" for k, n in total.items()) or "none"))
    for one in [one for one in found if one.found][: given.show]:
        parts = ", ".join(f"{kind} {count}" for kind, count in one.found.items())
        print(f"number {one.number}: {one.robot}, {one.kind}: {parts} {one.words}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="Number to begin with.")
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS))
    parser.add_argument("--joints", action="store_true", help="Paths of joints, limits alone.")
    parser.add_argument("--show", type=int, default=20, help="Failures to print.")
    parser.add_argument("--json", type=Path, help="Write every failure here.")
    given = parser.parse_args()
    began = time.perf_counter()
    found = try_all(given)
    wall_s = time.perf_counter() - began
    print_counts(found)
    print_reasons(found)
    print_violations(found, given)
    print(
        f"seed {given.seed}, numbers {given.first} to {given.first + given.count - 1}, "
        f"{wall_s:.0f} s, {given.count / wall_s:.1f} a second with {given.jobs} processes; next: "
        f"--first {given.first + given.count}"
    )
    failed = [asdict(one) for one in found if one.found]
    if given.json is not None:
        given.json.write_text(json.dumps(failed, indent=1) + "\n", encoding="utf-8")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
