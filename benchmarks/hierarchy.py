"""vHMS: the best of all groupings, with the classification of all that may be one action.

Run as ``python benchmarks/hierarchy.py``. Times are the best of five; the movements are random
walks of one arm at 100 Hz, a block a second. Enumeration is shown as far as it goes.
"""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Callable

import numpy as np

from besman.hierarchy.actions import LevelModel, compose_level, name_spans, train_level
from besman.hierarchy.online import OnlineHierarchy
from besman.records import LabelledRecording

RATE_HZ = 100.0
ARM = ("hand_top", "elbow", "shoulder")


def make_recording(n_blocks: int) -> LabelledRecording:
    rng = np.random.default_rng(n_blocks)
    n = int(n_blocks * RATE_HZ)
    back = np.array([[0.0, 0.0, 1.4], [0.0, 0.1, 1.3], [0.0, -0.1, 1.3]])
    arm = np.array([[0.4, 0.0, 1.0], [0.3, -0.2, 1.0], [0.0, -0.2, 1.4]])
    walk = np.cumsum(rng.normal(scale=0.01, size=(n, 3, 3)), axis=0)
    positions = np.concatenate([np.broadcast_to(back, (n, 3, 3)), arm + walk], axis=1)
    markers = ("back_top", "back_left", "back_right", *ARM)
    seen = np.zeros((n, 6), dtype=bool)
    return LabelledRecording(np.arange(n) / RATE_HZ, positions, markers, seen, RATE_HZ, "walk")


def best_of(run: Callable[[], object], repeats: int = 5) -> float:
    best = float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - start)
    return best


def enumerate_all(recording: LabelledRecording, borders: np.ndarray, model: LevelModel) -> float:
    n = len(borders) - 1
    groups = list(itertools.combinations(range(n + 1), 2))
    spans = [(borders[start], borders[end]) for start, end in groups]
    cost = dict(zip(groups, name_spans(recording, spans, model)[1], strict=True))
    best = np.inf
    for cuts in itertools.product((False, True), repeat=n - 1):
        chosen = [0, *(k + 1 for k, cut in enumerate(cuts) if cut), n]
        best = min(best, float(np.mean([cost[group] for group in itertools.pairwise(chosen)])))
    return -best


def main() -> None:
    print(f"{'blocks':>7} {'bar':>9} {'exact':>10} {'enumeration':>12} {'online, a block':>16}")
    for n_blocks, bar in ((12, "5 ms"), (30, "50 ms"), (100, "2 s")):
        recording = make_recording(n_blocks)
        borders = np.linspace(0, len(recording.time), n_blocks + 1).astype(int)
        spans = [(borders[k], borders[k + 3]) for k in range(0, 9, 3)]
        model = train_level([recording], [spans], [["a", "b", "c"]], ARM)
        exact = best_of(
            lambda recording=recording, borders=borders, model=model: compose_level(
                recording, borders, model
            )
        )
        line = f"{n_blocks:7d} {bar:>9} {1e3 * exact:7.2f} ms"
        if n_blocks == 12:
            start = time.perf_counter()
            fitness = enumerate_all(recording, borders, model)
            line += f" {1e3 * (time.perf_counter() - start):9.1f} ms"
            assert abs(fitness - compose_level(recording, borders, model).fitness) < 1e-12
        else:
            line += f" {'2^' + str(n_blocks - 1):>12}"
        online = OnlineHierarchy([model], longest=10, horizon=20)
        times = []
        for first, last in itertools.pairwise(borders):
            piece = dataclasses.replace(
                recording,
                time=recording.time[first:last],
                positions=recording.positions[first:last],
                filled=recording.filled[first:last],
            )
            start = time.perf_counter()
            online.update(piece)
            times.append(time.perf_counter() - start)
        print(line + f" {1e3 * float(np.median(times)):13.2f} ms")


if __name__ == "__main__":
    main()
