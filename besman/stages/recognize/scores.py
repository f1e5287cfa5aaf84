"""Labels found against labels given by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError
from besman.records import LabelledSegments
from besman.records.layers import complete_truth
from besman.stages.recognize.model import RecognitionModel


@dataclass(frozen=True)
class RecognitionScore:
    """How many labels are right.

    Attributes
    ----------
    accuracy : float
        Share of right labels; NaN if there was nothing to compare.
    n_compared : int
        Segments compared.
    per_class : dict of float
        Share of right labels for each true class.
    confusion : dict of dict of int
        Counts by true class, then by class found.
    """

    accuracy: float
    n_compared: int
    per_class: dict[str, float]
    confusion: dict[str, dict[str, int]]


def score_labels(
    found: tuple[LabelledSegments, ...],
    truth: tuple[LabelledSegments, ...],
    n_samples: tuple[int, ...],
    model: RecognitionModel,
    idle_s: float = 0.25,
    min_overlap: float = 0.5,
) -> RecognitionScore:
    """Score labels; manual segments that were learnt from do not count.

    A segment found belongs to the manual segment that it overlaps most, measured by intersection
    over union. One that overlaps none well enough says something about the segmentation, not about
    the recognition, and is not compared.

    Parameters
    ----------
    found : tuple of LabelledSegments
        Segments with the labels to be judged, one record for each recording; they may be the
        manual segments themselves.
    truth : tuple of LabelledSegments
        Manual segments in the same order.
    n_samples : tuple of int
        Length of each recording.
    model : RecognitionModel
        What was learnt; its examples are left out.
    idle_s : float
        Stretches without a manual label longer than this, seconds, count as ``idle``.
    min_overlap : float
        Least intersection over union.

    Returns
    -------
    RecognitionScore
        Over all recordings.

    Raises
    ------
    RecognitionError
        If the records do not belong to the same recordings.
    """
    learnt = {
        (source, int(start), int(end))
        for source, (start, end) in zip(model.sources, model.bounds, strict=True)
    }
    pairs: list[tuple[str, str]] = []
    for labelled, manual, length in zip(found, truth, n_samples, strict=True):
        if labelled.source != manual.source:
            raise RecognitionError(
                f"labels of {labelled.source!r} cannot be scored with manual ones of "
                f"{manual.source!r}"
            )
        whole = complete_truth(manual, length, idle_s)
        for segment, row in _match(labelled.bounds, whole.bounds, min_overlap):
            start, end = whole.bounds[row]
            if (manual.source, int(start), int(end)) not in learnt:
                pairs.append((whole.labels[row], labelled.labels[segment]))
    return _count(pairs)


def _match(
    found: npt.NDArray[np.int64], true: npt.NDArray[np.int64], min_overlap: float
) -> list[tuple[int, int]]:
    """Pair each segment found with the manual one it overlaps most, if that is enough."""
    if len(found) == 0 or len(true) == 0:
        return []
    low = np.maximum(found[:, np.newaxis, 0], true[np.newaxis, :, 0])
    high = np.minimum(found[:, np.newaxis, 1], true[np.newaxis, :, 1])
    common = np.maximum(high - low, 0)
    lengths = np.diff(found, axis=1) + np.diff(true, axis=1).T
    overlap = common / np.maximum(lengths - common, 1)
    best = overlap.argmax(axis=1)
    rows = np.arange(len(found))
    return [(int(k), int(best[k])) for k in rows[overlap[rows, best] >= min_overlap]]


def _count(pairs: list[tuple[str, str]]) -> RecognitionScore:
    """Make a score of pairs of true and found labels."""
    confusion: dict[str, dict[str, int]] = {}
    for true, got in sorted(pairs):
        row = confusion.setdefault(true, {})
        row[got] = row.get(got, 0) + 1
    per_class = {true: row.get(true, 0) / sum(row.values()) for true, row in confusion.items()}
    right = sum(true == got for true, got in pairs)
    accuracy = right / len(pairs) if pairs else float("nan")
    return RecognitionScore(accuracy, len(pairs), per_class, confusion)
