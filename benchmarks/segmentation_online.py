"""Online vMCI: time of each update, latency of the borders, and whether they are the offline ones.

Then the same of movements and rests (``valley_online``).

Run as ``python benchmarks/segmentation_online.py [MINUTES [FOLDER]]``; an hour if not given. The
stream is minimum-jerk reaches between random points, 100 samples per second. Of the recordings of a
folder movements and rests are found as of a stream, too, with the pace of all others in it.
"""

from __future__ import annotations

import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np

from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.person.marker_set import load_marker_set
from besman.stages.label.methods import DefaultLabelConfig
from besman.stages.segment.sampling import gather_gapless_paths
from besman.stages.segment.signals import measure_scaling, prepare_signals, resample
from besman.stages.segment.stage import HAND_SHAPE, ValleyOnlineConfig
from besman.stages.segment.valley_online import OnlineMovements, Pace, measure_pace, pool_paces
from besman.stages.segment.valley_vmci import find_movements
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


def follow_movements(paths: np.ndarray, rate_hz: float, pace: Pace):
    """Return the borders, the delay of each, seconds, and what each sample took of the thread."""
    online = OnlineMovements(pace, rate_hz, shape=HAND_SHAPE)
    borders, at, busy = [], [], np.empty(len(paths))
    for index, sample in enumerate(paths):
        start = time.thread_time()
        new = online.update(sample)
        busy[index] = time.thread_time() - start
        borders += new
        at += [index + 1] * len(new)
    rest = online.finish()
    at = np.array([*at, *[len(paths)] * len(rest)])
    borders += rest
    return borders, (at - np.array(borders)) / rate_hz, busy


def tell_movements(stream: np.ndarray) -> None:
    time_s = np.arange(len(stream)) / SAMPLE_RATE_HZ
    pace = measure_pace(time_s, stream, HAND_SHAPE)
    borders, delays, busy = follow_movements(stream, SAMPLE_RATE_HZ, pace)
    whole = find_movements(time_s, stream, shape=HAND_SHAPE).borders_s[1:-1]
    same = borders == np.round(whole * SAMPLE_RATE_HZ).astype(int).tolist()
    median, high = 1e3 * np.percentile(busy, (50, 99.9))
    print(
        f"movements and rests: per sample median {median:.4f} ms, 99.9th percentile {high:.2f} ms "
        f"(this thread); final after: median {np.median(delays):.2f} s, most {delays.max():.1f} s; "
        f"{len(borders)} borders, those of the whole recording: {same}"
    )


def tell_recordings(folder: Path) -> None:
    """Say of how many recordings the borders are those of the whole, and when they were final."""
    marker_set, config = load_marker_set("right_arm"), ValleyOnlineConfig()
    files = find_recordings([folder])
    recordings = [DefaultLabelConfig().run((read_recording(one),), marker_set)[0] for one in files]
    people = [one.source.split("_")[0] for one in recordings]
    paces = [config.measure(one) for one in recordings]
    for whose in ("itself", "the others", "other people"):
        same, delays, kinds, costs = 0, [], [], []
        for k, one in enumerate(recordings):
            known = {
                "itself": [paces[k]],
                "the others": [pace for i, pace in enumerate(paces) if i != k],
                "other people": [pace for i, pace in enumerate(paces) if people[i] != people[k]],
            }[whose]
            if not known:
                continue
            paths = gather_gapless_paths(one, config.markers)
            borders, delay, busy = follow_movements(paths, one.rate_hz, pool_paces(known))
            found = find_movements(one.time, paths, shape=HAND_SHAPE)
            expected = np.round(found.borders_s * one.rate_hz).astype(int)
            same += borders == expected[1:-1].tolist()
            rests = expected[:-1][found.rests & (np.diff(found.borders_s) >= 1.0)]
            kinds += [border in rests for border in borders]
            delays.append(delay)
            costs.append(busy)
        delays, is_rest = np.concatenate(delays), np.array(kinds)
        median, high = 1e3 * np.percentile(np.concatenate(costs), (50, 99.9))
        print(
            f"pace of {whose}: {same} of {len(costs)} with the borders of the whole; "
            f"{is_rest.sum()} beginnings of rests of a second and more final after "
            f"{np.median(delays[is_rest]):.2f} s in the median, {np.sum(~is_rest)} others after "
            f"{np.median(delays[~is_rest]):.2f} s, all after {delays.max():.1f} s; "
            f"{median:.4f} ms a sample, {high:.2f} ms 99.9 % (this thread)"
        )


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
    tell_movements(stream)
    if len(sys.argv) > 2:
        tell_recordings(Path(sys.argv[2]))


if __name__ == "__main__":
    main()
