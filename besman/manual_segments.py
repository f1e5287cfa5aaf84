"""What manual segments mean: parts of segments, and the stretches between them."""

from __future__ import annotations

import dataclasses

import numpy as np

from besman.records import LabelledSegments

IDLE = "idle"
"""Class of the stretches between manual segments."""

_PART_SUFFIX = "_part"


def drop_parts(truth: LabelledSegments) -> LabelledSegments:
    """Leave out segments whose label ends in ``_part``: they overlap the one they belong to."""
    whole = [k for k, label in enumerate(truth.labels) if not label.endswith(_PART_SUFFIX)]
    return dataclasses.replace(
        truth,
        bounds=truth.bounds[whole],
        labels=tuple(truth.labels[k] for k in whole),
        distances=truth.distances[whole],
    )


def complete_truth(truth: LabelledSegments, n_samples: int, idle_s: float) -> LabelledSegments:
    """Drop parts of segments and give long stretches without a label the class `IDLE`.

    Parameters
    ----------
    truth : LabelledSegments
        Manual segments.
    n_samples : int
        Length of the recording.
    idle_s : float
        Stretches without a label that are longer than this, in seconds, become segments.

    Returns
    -------
    LabelledSegments
        Whole segments in order of time.
    """
    whole = drop_parts(truth)
    rows = sorted(
        (int(start), int(end), label)
        for (start, end), label in zip(whole.bounds, whole.labels, strict=True)
    )
    idle: list[tuple[int, int, str]] = []
    reached = 0
    for start, end, _ in [*rows, (n_samples, n_samples, "")]:
        if start - reached > idle_s * truth.rate_hz:
            idle.append((reached, start, IDLE))
        reached = max(reached, end)
    rows = sorted(rows + idle)
    return dataclasses.replace(
        truth,
        bounds=np.array([row[:2] for row in rows], dtype=np.int64).reshape(-1, 2),
        labels=tuple(row[2] for row in rows),
        distances=np.zeros(len(rows)),
    )
