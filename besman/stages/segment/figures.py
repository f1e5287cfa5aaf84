"""Figures of a segmentation, for ``results.json``."""

from __future__ import annotations

from typing import Any

from besman.records import LabelledSegments, Segments
from besman.stages.segment.scores import mean_score


def segment_results(
    segments: tuple[Segments, ...],
    truth: tuple[LabelledSegments | None, ...],
    marker: str,
    margin_s: float,
) -> dict[str, Any]:
    """Return the figures of the segmentation; with truth also how well it fits.

    Parameters
    ----------
    segments : tuple of Segments
        One for each recording.
    truth : tuple of LabelledSegments or None
        In the same order.
    marker : str
        Whose speed was looked at first.
    margin_s : float
        Greatest distance of a border that counts as found, seconds.

    Returns
    -------
    dict
        n_segments, borders_per_s, marker; with truth f1, tp, fp, margin_s, median_offset_s
        (internal borders, means over the recordings that have truth).
    """
    n_segments = sum(len(found.bounds) for found in segments)
    duration = sum(found.bounds[-1, 1] / found.rate_hz for found in segments if len(found.bounds))
    results: dict[str, Any] = {
        "n_segments": n_segments,
        "borders_per_s": (n_segments - len(segments)) / duration,
        "marker": marker,
    }
    pairs = [(found, true) for found, true in zip(segments, truth, strict=True) if true is not None]
    if pairs:
        score = mean_score(tuple(p[0] for p in pairs), tuple(p[1] for p in pairs), margin_s)
        results |= {
            "f1": score.f1,
            "tp": score.tp,
            "fp": score.fp,
            "margin_s": margin_s,
            "median_offset_s": score.median_offset_s,
        }
    return results
