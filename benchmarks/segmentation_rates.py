"""Segmentation at the rates of slow and fast cameras, on resampled real recordings.

Run as ``python benchmarks/segmentation_rates.py FOLDER [METHOD]``: recordings with manual segments
beside them, brought to each rate along straight lines between their samples.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from besman.evaluation.segmentation import make_method
from besman.evaluation.segmentation_data import read_dataset
from besman.records import LabelledRecording, LabelledSegments
from besman.stages.segment.methods import DEFAULT_METHOD
from besman.stages.segment.scores import mean_score

RATES_HZ = (100.0, 24.0, 25.0, 30.0, 60.0, 1000.0)
MARGINS_S = (0.3, 0.1)


def bring_to(recording: LabelledRecording, rate_hz: float) -> LabelledRecording:
    time = np.arange(recording.time[0], recording.time[-1], 1 / rate_hz)
    flat = recording.positions.reshape(len(recording.time), -1)
    # What is interpolated with NaN is NaN: gaps stay gaps.
    paths = np.stack([np.interp(time, recording.time, one) for one in flat.T], axis=1)
    positions = paths.reshape(len(time), *recording.positions.shape[1:])
    nearest = np.searchsorted(recording.time, time, side="right") - 1
    return replace(
        recording,
        time=time,
        positions=positions,
        filled=recording.filled[nearest],
        rate_hz=rate_hz,
    )


def move_truth(truth: LabelledSegments, n_rows: int, rate_hz: float) -> LabelledSegments:
    bounds = np.round(truth.bounds * (rate_hz / truth.rate_hz)).astype(np.int64)
    return replace(truth, bounds=np.minimum(bounds, n_rows), rate_hz=rate_hz)


def main() -> None:
    if len(sys.argv) < 2:
        print("segmentation at other rates: only on real recordings, name their FOLDER")
        return
    data = read_dataset(Path(sys.argv[1]))
    method = sys.argv[2] if len(sys.argv) > 2 else DEFAULT_METHOD
    written = sorted({recording.rate_hz for recording in data.recordings})
    print(f"{data.name}: {len(data.recordings)} recordings at {written} Hz, method {method}")
    print(
        f"{'rate':>8} "
        + " ".join(f"{f'F1 {margin:g} s':>10} {'change':>8}" for margin in MARGINS_S)
    )
    base: list[float] = []
    for rate_hz in RATES_HZ:
        recordings = tuple(bring_to(one, rate_hz) for one in data.recordings)
        truth = tuple(
            move_truth(one, len(recording.time), rate_hz)
            for one, recording in zip(data.truth, recordings, strict=True)
        )
        found = make_method(method, {}).run(recordings)  # type: ignore[attr-defined]
        f1 = [mean_score(found, truth, margin).f1 for margin in MARGINS_S]
        base = base or f1
        cells = (f"{one:10.3f} {one - usual:+8.3f}" for one, usual in zip(f1, base, strict=True))
        print(f"{rate_hz:6.0f} Hz " + " ".join(cells))


if __name__ == "__main__":
    main()
