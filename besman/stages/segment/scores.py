"""Borders found against borders set by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import SegmentationError
from besman.records import LabelledSegments, Segments
from besman.records.layers import drop_parts

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class BorderScore:
    """How well borders fit, one recording or the mean of several.

    Attributes
    ----------
    f1 : float
        Harmonic mean of precision and recall; 1 if there is nothing to find and nothing found.
    tp, fp, fn : float
        Borders that were found, found without being there, and missed.
    margin_s : float
        Greatest distance of a border that counts as found, seconds.
    median_offset_s : float
        Median of found minus true border over the pairs, seconds: positive is late. NaN if there
        is no pair.
    """

    f1: float
    tp: float
    fp: float
    fn: float
    margin_s: float
    median_offset_s: float


def manual_borders(truth: LabelledSegments) -> npt.NDArray[np.int64]:
    """Return the borders of manual segments; a stretch without a label is a segment too.

    Parameters
    ----------
    truth : LabelledSegments
        Manual segments. Labels that end in ``_part`` are left out.

    Returns
    -------
    int array, shape (B,)
        Rising row indices. Where a segment ends in the row before the next one begins, as in files
        that name the last frame of each, that is one border.
    """
    borders = np.unique(drop_parts(truth).bounds)
    last = np.append(np.diff(borders) > 1, True)
    return np.asarray(borders[last])


def match_borders(
    found_s: npt.ArrayLike, true_s: npt.ArrayLike, margin_s: float
) -> npt.NDArray[np.int64]:
    """Pair borders one to one: as many pairs as possible, then the nearest.

    Parameters
    ----------
    found_s, true_s : array, shape (F,) and (B,)
        Times of borders in seconds.
    margin_s : float
        Greatest distance of a pair, seconds.

    Returns
    -------
    int array, shape (P, 2)
        Indices into `found_s` and `true_s`.
    """
    found, true = np.asarray(found_s, dtype=float), np.asarray(true_s, dtype=float)
    distance = np.abs(found[:, np.newaxis] - true[np.newaxis, :])
    # Times on a grid differ in the last bit; a border on the margin counts.
    near = distance <= margin_s + 1e-9
    if near.sum(axis=0).max(initial=0) <= 1 and near.sum(axis=1).max(initial=0) <= 1:
        # Nothing to choose, as nearly always: to load what chooses takes longer than all else.
        return np.argwhere(near)
    from scipy.optimize import linear_sum_assignment

    forbidden = 1.0 + (min(distance.shape, default=0) + 1) * margin_s
    rows, columns = linear_sum_assignment(np.where(near, distance, forbidden))
    pairs = np.stack([rows, columns], axis=1)
    matched: npt.NDArray[np.int64] = pairs[near[rows, columns]].astype(np.int64)
    return matched


def score_borders(
    segments: Segments, truth: LabelledSegments, margin_s: float = 0.3, count_end: bool = False
) -> BorderScore:
    """Score the segments of one recording.

    Parameters
    ----------
    segments : Segments
        Segments found; they cover the recording.
    truth : LabelledSegments
        Manual segments of the same recording.
    margin_s : float
        Greatest distance of a border that counts as found, seconds.
    count_end : bool
        Count the end of the recording as a border, as the thesis does. Otherwise only borders
        inside the recording count.

    Returns
    -------
    BorderScore
        Counts of this recording.

    Raises
    ------
    SegmentationError
        If the two do not belong to one recording.
    """
    offsets, n_found, n_true = _compare(segments, truth, margin_s, count_end)
    return _summarize(
        len(offsets), n_found - len(offsets), n_true - len(offsets), margin_s, offsets
    )


def mean_score(
    segments: tuple[Segments, ...],
    truth: tuple[LabelledSegments, ...],
    margin_s: float = 0.3,
    count_end: bool = False,
) -> BorderScore:
    """Score several recordings: means over the recordings, median offset over all pairs.

    Parameters
    ----------
    segments, truth : tuple of records
        One each for every recording, in the same order.
    margin_s, count_end
        As in `score_borders`.

    Returns
    -------
    BorderScore
        Means.
    """
    scores = [
        score_borders(found, true, margin_s, count_end)
        for found, true in zip(segments, truth, strict=True)
    ]
    offsets = np.concatenate(
        [
            _compare(found, true, margin_s, count_end=False)[0]
            for found, true in zip(segments, truth, strict=True)
        ]
    )
    return BorderScore(
        f1=float(np.mean([score.f1 for score in scores])),
        tp=float(np.mean([score.tp for score in scores])),
        fp=float(np.mean([score.fp for score in scores])),
        fn=float(np.mean([score.fn for score in scores])),
        margin_s=margin_s,
        median_offset_s=float(np.median(offsets)) if len(offsets) else float("nan"),
    )


def _compare(
    segments: Segments, truth: LabelledSegments, margin_s: float, count_end: bool
) -> tuple[FloatArray, int, int]:
    """Return the offsets of the pairs (s) and the numbers of borders found and true."""
    if segments.source != truth.source or segments.rate_hz != truth.rate_hz:
        raise SegmentationError(
            f"segments of {segments.source!r} at {segments.rate_hz:g} Hz cannot be scored with "
            f"manual ones of {truth.source!r} at {truth.rate_hz:g} Hz"
        )
    end = int(segments.bounds[-1, 1]) if len(segments.bounds) else 0
    found = np.unique(segments.bounds)
    true = manual_borders(truth)
    # Files name the last frame as the end where a half-open index would be one more.
    found, true = (borders[(borders > 0) & (borders < end - 1)] for borders in (found, true))
    if count_end:
        found, true = np.append(found, end), np.append(true, end)
    pairs = match_borders(found / segments.rate_hz, true / segments.rate_hz, margin_s)
    offsets = (found[pairs[:, 0]] - true[pairs[:, 1]]) / segments.rate_hz
    return offsets, len(found), len(true)


def _summarize(tp: int, fp: int, fn: int, margin_s: float, offsets: FloatArray) -> BorderScore:
    """Make a score of counts."""
    f1 = 2 * tp / (2 * tp + fp + fn) if tp + fp + fn else 1.0
    median = float(np.median(offsets)) if len(offsets) else float("nan")
    return BorderScore(f1, tp, fp, fn, margin_s, median)
