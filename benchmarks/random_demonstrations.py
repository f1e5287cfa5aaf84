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
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path

# Before numpy is loaded: threads inside BLAS cost more than they save.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np
from demonstrations.attempts import Outcome, attempt
from demonstrations.draws import ROBOTS

BLOCK = 200


class Tally:
    """What became of the demonstrations on one arm; a million outcomes need not be held."""

    def __init__(self) -> None:
        self.counts, self.reasons, self.plans = Counter(), Counter(), Counter()
        self.stretches: list[float] = []
        self.seconds = 0.0

    def add(self, one: Outcome) -> None:
        self.reasons[one.reason] += 1
        if one.plan:
            self.plans[one.plan] += 1
        if not one.reason:
            self.stretches.append(one.stretch)
        self.counts += {"samples": one.samples, "violations": one.found.total()}
        self.seconds += one.seconds

    def __add__(self, other: "Tally") -> "Tally":
        both = Tally()
        for name in ("counts", "reasons", "plans", "stretches", "seconds"):
            setattr(both, name, getattr(self, name) + getattr(other, name))
        return both


def try_block(
    seed: int, first: int, count: int, hand: bool, robots: tuple[str, ...]
) -> list[Outcome]:
    numbers = range(first, first + count)
    return [attempt(seed, number, hand=hand, robots=robots) for number in numbers]


def try_all(given: argparse.Namespace) -> tuple[dict[str, Tally], list[Outcome]]:
    """Try the whole range in blocks; return what came of it by arm, and the failures."""
    began, done, failed = time.perf_counter(), 0, []
    tallies: defaultdict[str, Tally] = defaultdict(Tally)
    last, robots = given.first + given.count, tuple(given.robots)
    firsts = range(given.first, last, BLOCK)
    counts = [min(BLOCK, last - first) for first in firsts]
    one_block = partial(try_block, given.seed, hand=not given.joints, robots=robots)
    with ProcessPoolExecutor(given.jobs) as pool:
        for block in pool.map(one_block, firsts, counts):
            for one in block:
                tallies[one.robot].add(one)
            failed += [one for one in block if one.found]
            done += len(block)
            rate = done / (time.perf_counter() - began)
            line = f"{given.first + done} of {last}, {rate:.1f} a second, {len(failed)} failed"
            print(f"\r{line} ", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return dict(sorted(tallies.items())), failed


def print_counts(tallies: dict[str, Tally]) -> None:
    """Print what became of them, by arm."""
    head = ("kept", "refused", "plans", "refused", "stretch 50 %", "95 %", "greatest")
    print(f"{'':12}{'tried':>9}" + "".join(f"{word:>13}" for word in head), end="")
    print(f"{'samples':>13}{'violations':>12}{'CPU s':>9}")
    for name, tally in (*tallies.items(), ("all", sum(tallies.values(), Tally()))):
        tried, kept = tally.reasons.total(), tally.reasons[""]
        counts = kept, tried - kept, tally.plans["kept"], tally.plans.total() - tally.plans["kept"]
        quantiles = np.percentile(tally.stretches or [np.nan], [50, 95, 100])
        print(f"{name:12}{tried:9}" + "".join(f"{count:13}" for count in counts), end="")
        print("".join(f"{value:13.2f}" for value in quantiles), end="")
        print(f"{tally.counts['samples']:13}{tally.counts['violations']:12}{tally.seconds:9.0f}")


def print_reasons(tallies: dict[str, Tally]) -> None:
    """Print why demonstrations and plans were refused, by arm."""
    whole = sum(tallies.values(), Tally())
    for what, words in (("reasons", "refused demonstrations"), ("plans", "refused plans")):
        print(f"\n{words}")
        for reason, count in getattr(whole, what).most_common():
            if reason not in ("", "kept"):
                parts = [f"{name} {getattr(one, what)[reason]}" for name, one in tallies.items()]
                print(f"{count:9}  {reason} ({', '.join(parts)})")


def print_violations(failed: list[Outcome], show: int) -> None:
    """Print the violations by kind, and the demonstrations that have them."""
    total = sum((one.found for one in failed), Counter())
    print("\nviolations: " + (", ".join(f"{k} {n}" for k, n in total.items()) or "none"))
    for one in failed[:show]:
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
    tallies, failed = try_all(given)
    wall_s = time.perf_counter() - began
    print_counts(tallies)
    print_reasons(tallies)
    print_violations(failed, given.show)
    print(
        f"seed {given.seed}, numbers {given.first} to {given.first + given.count - 1}, "
        f"{wall_s:.0f} s, {given.count / wall_s:.1f} a second with {given.jobs} processes; next: "
        f"--first {given.first + given.count}"
    )
    if given.json is not None:
        rows = [asdict(one) for one in failed]
        given.json.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
