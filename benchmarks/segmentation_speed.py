"""Exact vMCI: the compiled recursion beside the plain NumPy one, in one run.

Run as ``python benchmarks/segmentation_speed.py``. Times are the best of several after warm-up;
the data are minimum-jerk reaches between random points at 20 Hz.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable

import numpy as np

from besman.stages.segment.signals import Signals, prepare_signals
from besman.stages.segment.vmci import ChangePoints, find_change_points
from besman.stages.segment.vmci_plain import find_change_points_plainly

RATE_HZ = 20.0


def make_reaches(n_samples: int, seed: int = 0) -> Signals:
    rng = np.random.default_rng(seed)
    pieces: list[np.ndarray] = []
    start = np.zeros(3)
    while sum(len(piece) for piece in pieces) < n_samples:
        n = int(RATE_HZ * rng.uniform(0.7, 1.6))
        goal = rng.normal(scale=0.3, size=3)
        s = np.arange(n) / n
        course = 10 * s**3 - 15 * s**4 + 6 * s**5
        pieces.append(start + (goal - start) * course[:, np.newaxis])
        start = goal
    path = np.concatenate(pieces)[:n_samples]
    return prepare_signals((path + rng.normal(scale=3e-4, size=path.shape))[:, np.newaxis])


def measure(run: Callable[[], ChangePoints], repeats: int) -> tuple[float, ChangePoints]:
    best, result = float("inf"), run()
    for _ in range(repeats):
        start = time.perf_counter()
        result = run()
        best = min(best, time.perf_counter() - start)
    return best, result


def main() -> None:
    print(f"{'samples':>8} {'longest':>8} {'compiled':>11} {'plain':>11} {'ratio':>7} {'agree':>6}")
    for n_samples, longest in ((200, None), (200, 200), (3200, 200), (100_000, 200)):
        data = make_reaches(n_samples)
        arguments = (data.positions, data.speeds, 1 / n_samples, longest)
        fast, found = measure(
            lambda arguments=arguments: find_change_points(*arguments),
            repeats=20 if n_samples < 1000 else 3,
        )
        line = f"{n_samples:8d} {longest or 'none':>8} {1e3 * fast:8.2f} ms"
        if n_samples <= 3200:
            slow, plain = measure(
                lambda arguments=arguments: find_change_points_plainly(*arguments), repeats=1
            )
            agree = np.array_equal(found.borders, plain.borders)
            line += f" {1e3 * slow:8.1f} ms {slow / fast:6.1f}x {agree!s:>6}"
        print(line)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak:.0f} MB")


if __name__ == "__main__":
    main()
