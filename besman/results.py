"""Figures of a run that need more than one stage's record."""

from __future__ import annotations

from typing import Any

from besman.manual_segments import complete_truth
from besman.recognition.model import RecognitionModel
from besman.recognition.scores import RecognitionScore, score_labels
from besman.recognition.stage import RecognizeMethod
from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.segmentation.scores import mean_score


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


def recognize_results(
    config: RecognizeMethod,
    recordings: tuple[LabelledRecording, ...],
    recognized: tuple[LabelledSegments, ...],
    truth: tuple[LabelledSegments | None, ...],
    model: RecognitionModel,
) -> dict[str, Any]:
    """Return the counts by label; with truth also how many labels are right.

    Parameters
    ----------
    config : RecognizeMethod
        The stage.
    recordings : tuple of LabelledRecording
    recognized : tuple of LabelledSegments
        What the stage gave, in the order of the recordings.
    truth : tuple of LabelledSegments or None
        In the same order.
    model : RecognitionModel
        Its examples do not count.

    Returns
    -------
    dict
        counts; with truth accuracy, per_class, confusion of the detected segments that overlap a
        manual one, and accuracy_manual, per_class_manual of the manual segments themselves.
    """
    labels = sorted(label for found in recognized for label in found.labels)
    results: dict[str, Any] = {"counts": {label: labels.count(label) for label in labels}}
    rows = [row for row, segments in enumerate(truth) if segments is not None]
    if not rows:
        return results
    known = tuple(recordings[row] for row in rows)
    manual = tuple(segments for segments in truth if segments is not None)
    lengths = tuple(len(recording.time) for recording in known)
    whole = tuple(
        complete_truth(segments, length, config.idle_s)
        for segments, length in zip(manual, lengths, strict=True)
    )
    found = tuple(recognized[row] for row in rows)
    detected = score_labels(found, manual, lengths, model, config.idle_s)
    named = config.run(known, whole, model)
    by_hand = score_labels(named, manual, lengths, model, config.idle_s)
    return {
        **results,
        **_score(detected),
        **{f"{key}_manual": value for key, value in _score(by_hand).items()},
    }


def _score(score: RecognitionScore) -> dict[str, Any]:
    return {
        "accuracy": score.accuracy,
        "n_compared": score.n_compared,
        "per_class": score.per_class,
        "confusion": score.confusion,
    }
