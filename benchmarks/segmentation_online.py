"""Online vMCI: time of each update, latency of the borders, and whether they are the offline ones.

Run as ``python benchmarks/segmentation_online.py [MINUTES]``; an hour if not given. The stream is
minimum-jerk reaches between random points, 100 samples per second.
"""

from __future__ import annotations

import sys
import time
import tracemalloc

import numpy as np

from besman.stages.segment.signals import measure_scaling, prepare_signals, resample
from besman.stages.segment.vmci import find_change_points, merge_single_samples
from besman.stages.segment.vmci_online import OnlineVmci

SAMPLE_RATE_HZ = 100.0
RATE_HZ = 20.0
LONGEST_S = 10.0
BORDER_PROBABILITY = 0.05


def make_stream(n_samples: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    pieces: list[np.ndarray] = []
    start = np.zeros(3)
    while sum(len(piece) for piece in pieces) < n_samples:
        n = int(SAMPLE_RATE_HZ * rng.uniform(0.7, 1.6))
        goal = rng.normal(scale=0.3, size=3)
        s = np.arange(n) / n
        course = 10 * s**3 - 15 * s**4 + 6 * s**5
        pieces.append(start + (goal - start) * course[:, np.newaxis])
        start = goal
    path = np.concatenate(pieces)[:n_samples]
    return (path + rng.normal(scale=3e-4, size=path.shape))[:, np.newaxis]


def main() -> None:
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    stream = make_stream(int(60 * minutes * SAMPLE_RATE_HZ))
    samples = resample(np.arange(len(stream)) / SAMPLE_RATE_HZ, stream, RATE_HZ)
    scaling = measure_scaling(samples)
    settings = (scaling, BORDER_PROBABILITY, SAMPLE_RATE_HZ, RATE_HZ, LONGEST_S)
    warm = OnlineVmci(*settings)
    for sample in stream[:100]:
        warm.update(sample)

    online = OnlineVmci(*settings)
    seconds, busy = np.empty((2, len(stream)))
    borders: list[int] = []
    delays: list[float] = []
    tracemalloc.start()
    held = 0
    for index, sample in enumerate(stream[: int(60 * SAMPLE_RATE_HZ)]):
        online.update(sample)
        if index == int(20 * SAMPLE_RATE_HZ):
            held = tracemalloc.get_traced_memory()[0]
    grown = tracemalloc.get_traced_memory()[0] - held
    tracemalloc.stop()
    online = OnlineVmci(*settings)
    for index, sample in enumerate(stream):
        start, start_busy = time.perf_counter(), time.thread_time()
        new = online.update(sample)
        busy[index] = time.thread_time() - start_busy
        seconds[index] = time.perf_counter() - start
        borders += new
        delays += [(index + 1 - border) / SAMPLE_RATE_HZ for border in new]
    borders += online.finish()

    signals = prepare_signals(samples)
    whole = find_change_points(
        signals.positions, signals.speeds, BORDER_PROBABILITY, round(LONGEST_S * RATE_HZ)
    )
    expected = merge_single_samples(whole.borders)[1:-1] * round(SAMPLE_RATE_HZ / RATE_HZ)
    print(f"{minutes:g} min at {SAMPLE_RATE_HZ:g} Hz, longest segment {LONGEST_S:g} s")
    for name, values in (("wall clock", seconds), ("this thread", busy)):
        median, high, worst = 1e3 * np.array([*np.percentile(values, (50, 99.9)), values.max()])
        going_on = 1e3 * np.median(np.sort(values)[-len(samples) :])
        print(
            f"per sample, {name}: median {median:.3f} ms, 99.9th percentile {high:.3f} ms, most "
            f"{worst:.2f} ms; where the recursion goes on ({RATE_HZ:g} Hz) median {going_on:.3f} ms"
        )
    print(f"border final after: median {np.median(delays):.1f} s, most {np.max(delays):.1f} s")
    print(f"memory grown from 20 s to 60 s: {grown / 1024:.1f} KB")
    print(f"borders {len(borders)}, those of the whole recording: {borders == expected.tolist()}")


if __name__ == "__main__":
    main()
