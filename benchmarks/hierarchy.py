"""vHMS: the best of all groupings, with the classification of all that may be one action.

Run as ``python benchmarks/hierarchy.py``. Times are the best of five; the movements are random
walks of one arm at 100 Hz, a block a second. Enumeration is shown as far as it goes.

Then everything together, sample by sample (``besman follow``): segmentation, recognition and
actions of simulated captures at 100 Hz, learnt from one capture and measured on another.
"""

from __future__ import annotations

import dataclasses
import itertools
import time
from collections.abc import Callable

import numpy as np

from besman.evaluation.demonstrations import arm_markers, name_markers
from besman.following.arms import FollowedArm
from besman.following.follower import Follower
from besman.records import LabelledRecording
from besman.stages.compose.actions import LevelModel, compose_level, name_spans, train_level
from besman.stages.compose.borders import measure_brisk
from besman.stages.compose.online import OnlineHierarchy
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.segment.sampling import sample_paths
from besman.stages.segment.signals import measure_scaling
from besman.stages.segment.stage import VmciOnlineConfig
from besman.synthetic.datasets import captures

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


def make_follower(dataset: str) -> tuple[Follower, np.ndarray]:
    """Learn from one capture; return what follows another, and that one's positions."""
    lesson, test = itertools.islice(captures(dataset, n_subjects=2), 2)
    known, stream = name_markers(lesson.recording), name_markers(test.recording)
    segment = VmciOnlineConfig(rate_hz=30.0)
    arms, hands = [], {}
    of_arms = arm_markers(known.markers)
    for side, markers in of_arms.items():
        blocks = lesson.layers[f"{side}_hand"]
        model = RecognizeConfig(markers=markers, examples_per_class=4).train((known,), (blocks,))
        scaling = measure_scaling(sample_paths(known, markers[:1], segment.rate_hz)[0])
        arms.append(FollowedArm(side, markers[:1], model, scaling))
        hands[markers[0]] = measure_brisk([known], markers[0])
    names = [name for markers in of_arms.values() for name in markers]
    truth = lesson.segments
    level = train_level([known], [truth.bounds], [truth.labels], names)
    follower = Follower(
        stream.markers, stream.rate_hz, arms, [level], segment, brisk_m_s=hands,
        longest_blocks=12, source=stream.source,
    )  # fmt: skip
    return follower, stream.positions


def follow(dataset: str) -> None:
    warm, positions = make_follower(dataset)
    for sample in positions[:1000]:
        warm.push(sample)
    follower, positions = make_follower(dataset)
    seconds, busy = np.empty((2, len(positions)))
    first: dict[tuple[str, str, int, int], int] = {}
    final: dict[tuple[str, str, int, int], int] = {}
    for row, sample in enumerate(positions):
        start, start_busy = time.perf_counter(), time.thread_time()
        changes = follower.push(sample)
        busy[row] = time.thread_time() - start_busy
        seconds[row] = time.perf_counter() - start
        for change in changes:
            one = change.piece
            key = (one.kind, one.of, one.start, one.end)
            if change.status != "gone":
                first.setdefault(key, row + 1)
            if change.status == "final":
                final[key] = row + 1
    follower.finish()
    print(f"\n{dataset}: {len(positions)} samples, {len(follower.state.blocks)} arms")
    for name, values in (("wall clock", seconds), ("this thread", busy)):
        median, high, worst = 1e3 * np.array([*np.percentile(values, (50, 99.9)), values.max()])
        print(
            f"per sample, {name}: median {median:.3f} ms, 99.9th percentile {high:.2f} ms, most "
            f"{worst:.2f} ms, mean {1e3 * values.mean():.3f} ms"
        )
    for kind in ("block", "action"):
        known, settled = (
            [
                (row - key[3]) / RATE_HZ
                for key, row in rows.items()
                if key in final and key[0] == kind
            ]
            for rows in (first, final)
        )
        print(
            f"{len(settled)} {kind}s final before the end: known {np.median(known):.2f} s, final "
            f"{np.median(settled):.2f} s after their end (medians)"
        )


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
    for dataset in ("step", "object_rotation"):
        follow(dataset)


if __name__ == "__main__":
    main()
