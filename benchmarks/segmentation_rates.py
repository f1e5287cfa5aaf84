"""Segmentation at the rates of slow and fast cameras, on resampled real recordings.

Run as ``python benchmarks/segmentation_rates.py FOLDER [METHOD]``: recordings with manual segments
beside them, brought to each rate along straight lines between their samples. Borders found and true
are rounded to frames, as segments are stored, which alone moves them by 21 ms at 24 Hz; of a method
that finds them between frames F1 is given for these, too, against the borders as they were marked.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from besman.evaluation.segmentation import make_method
from besman.evaluation.segmentation_data import read_dataset
from besman.records import LabelledRecording, LabelledSegments, Segments
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


def mark_finely(truth: LabelledSegments, duration_s: float, frame_s: float) -> LabelledSegments:
    """Return borders in milliseconds; what lies within a frame of the end is the end."""
    end = round(1000 * duration_s)
    bounds = np.round(truth.bounds * (1000.0 / truth.rate_hz)).astype(np.int64)
    bounds[bounds > end - 1000 * (frame_s + 1.0 / truth.rate_hz)] = end
    return replace(truth, bounds=bounds, rate_hz=1000.0)


def between_frames(method: object, recordings: tuple[LabelledRecording, ...]) -> tuple:
    """Return segments whose borders are rounded to milliseconds, not to frames."""
    found = []
    for recording in recordings:
        n = round(1000 * len(recording.time) / recording.rate_hz)
        borders = np.round(1000 * method.find(recording).borders_s)  # type: ignore[attr-defined]
        rows = np.unique(np.minimum(borders.astype(np.int64), n))
        rows[-1] = n
        found.append(
            Segments(
                bounds=np.stack([rows[:-1], rows[1:]], axis=1),
                log_evidence=float("nan"),
                rate_hz=1000.0,
                source=recording.source,
                first_frame=0,
            )
        )
    return tuple(found)


def main() -> None:
    if len(sys.argv) < 2:
        print("segmentation at other rates: only on real recordings, name their FOLDER")
        return
    data = read_dataset(Path(sys.argv[1]))
    method = sys.argv[2] if len(sys.argv) > 2 else DEFAULT_METHOD
    written = sorted({recording.rate_hz for recording in data.recordings})
    print(f"{data.name}: {len(data.recordings)} recordings at {written} Hz, method {method}")
    titles = [f"F1 {margin:g} s" for margin in MARGINS_S]
    runner = make_method(method, {})
    if hasattr(runner, "find"):
        titles += [f"{title}, ms" for title in titles]
    print(f"{'rate':>8} " + " ".join(f"{title:>13} {'change':>8}" for title in titles))
    base: list[float] = []
    for rate_hz in RATES_HZ:
        recordings = tuple(bring_to(one, rate_hz) for one in data.recordings)
        pairs = list(zip(data.truth, recordings, strict=True))
        truth = tuple(move_truth(one, len(each.time), rate_hz) for one, each in pairs)
        found = runner.run(recordings)  # type: ignore[attr-defined]
        f1 = [mean_score(found, truth, margin).f1 for margin in MARGINS_S]
        if hasattr(runner, "find"):
            fine = between_frames(runner, recordings)
            marked = tuple(
                mark_finely(one, len(each.time) / rate_hz, 1.0 / rate_hz) for one, each in pairs
            )
            f1 += [mean_score(fine, marked, margin).f1 for margin in MARGINS_S]
        base = base or f1
        cells = (f"{one:13.3f} {one - usual:+8.3f}" for one, usual in zip(f1, base, strict=True))
        print(f"{rate_hz:6.0f} Hz " + " ".join(cells), flush=True)


if __name__ == "__main__":
    main()
