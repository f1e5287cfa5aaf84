"""Labelling of unnamed trajectories beside a plain per-frame tracker, in one run; and its speed.

Run as ``python benchmarks/labelling.py [--data DIR] [--seeds N]``. The table is that of ``besman
evaluate labelling``. Then the first recording with names of each folder teaches by one second of it
how the rest is called, at eight places, with the share of right names by confidence. For the speed
a recording is played to and fro, resampled to 500 Hz with 0.2 mm of noise, and spoilt with seed 1.
"""

from __future__ import annotations

import argparse
import time
import tracemalloc
from pathlib import Path

import numpy as np
from rich.console import Console

from besman.config.resources import resource_folder
from besman.evaluation.degradation import DegradeRecipe, degrade_recording
from besman.evaluation.labelling import (
    LEVELS,
    count_samples,
    evaluate_labelling,
    labelling_table,
)
from besman.evaluation.one_second import name_by_one_second
from besman.evaluation.takes import make_protocols
from besman.exceptions import RecordingError
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording
from besman.stages.label.fragments import split_fragments
from besman.stages.label.naming import label_fragments


def stretch(positions: np.ndarray, rate_hz: float, duration_s: float, to_hz: float) -> np.ndarray:
    frame = np.arange(round(duration_s * to_hz)) * rate_hz / to_hz
    last = len(positions) - 1
    place = last - np.abs(frame % (2 * last) - last)
    low = np.minimum(place.astype(int), last - 1)
    share = (place - low)[:, None, None]
    stretched = (1 - share) * positions[low] + share * positions[low + 1]
    return stretched + np.random.default_rng(0).normal(0.0, 0.0002, stretched.shape)


def print_one_second(folder: Path) -> None:
    for place in [folder, *sorted(path for path in folder.iterdir() if path.is_dir())]:
        try:
            recordings = [read_recording(path) for path in find_recordings([place])]
        except RecordingError:
            continue
        named = [one for one in recordings if all(one.names)]
        if not named or len(named[0].time) < 3 * named[0].rate_hz:
            continue
        take = named[0]
        names = tuple(name or "" for name in take.names)
        found = name_by_one_second(take.positions, take.rate_hz, names)
        print(
            f"{take.source}, {len(names)} markers, learnt from one second of it: "
            f"right {100 * found['right_share']:.2f} wrong {100 * found['wrong_share']:.2f} %"
        )
        for row in found["bins"]:
            if row["share"]:
                share, right = 100 * row["share"], 100 * row["right_share"]
                bounds = f"{row['from']:.2f} to {row['to']:.2f}"
                print(f"  confidence {bounds}: {share:6.2f} % of samples, {right:6.2f} % right")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", type=Path)
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    rows = evaluate_labelling(options.data, options.seeds)["rows"]
    Console(width=150).print(labelling_table(rows))
    folder = options.data or resource_folder("data") / "stick_throw"
    protocol = make_protocols(folder)[-1]
    print_one_second(folder)
    take = next(take for take in protocol.takes if take.markers)
    print(f"{take.source} played to and fro at 500 Hz, {len(take.markers)} markers")
    for duration_s in (34.0, 68.0, 136.0):
        positions = stretch(take.positions, take.rate_hz, duration_s, 500.0)
        for missing, ghosts in LEVELS:
            spoilt = degrade_recording(positions, 500.0, DegradeRecipe(missing, ghosts), 1)
            label_fragments(split_fragments(spoilt.positions[:2000], 500.0), protocol.model)
            start = time.perf_counter()
            fragments = split_fragments(spoilt.positions, 500.0)
            labels = label_fragments(fragments, protocol.model).labels
            seconds = time.perf_counter() - start
            tracemalloc.start()
            label_fragments(fragments, protocol.model)
            peak = tracemalloc.get_traced_memory()[1] / 1e6
            tracemalloc.stop()
            truth = spoilt.truth[fragments.start, fragments.column]
            visible, right, wrong = count_samples(fragments, labels, truth)
            print(
                f"{duration_s:4.0f} s, {missing:3.0%} + {ghosts:g} ghosts: "
                f"{fragments.n_fragments:5d} fragments, {seconds:5.2f} s, "
                f"{len(positions) / seconds:7.0f} frames/s, {peak:4.0f} MB, "
                f"right {100 * right / visible:.2f} wrong {100 * wrong / visible:.2f} %"
            )


if __name__ == "__main__":
    main()
