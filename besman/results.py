"""Figures of a run that need more than one stage's record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from besman.manual_segments import side_of
from besman.recognition.examples import Candidate, find_candidates
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
        n_left_out: stretches without a label in which a hand moves, which are neither rest nor of
        a class, and not compared.
    """
    labels = sorted(label for found in recognized for label in found.labels)
    results: dict[str, Any] = {"counts": {label: labels.count(label) for label in labels}}
    rows = [row for row, segments in enumerate(truth) if segments is not None]
    if not rows:
        return results
    known = tuple(recordings[row] for row in rows)
    manual = tuple(segments for segments in truth if segments is not None)
    lengths = tuple(len(recording.time) for recording in known)
    # The same segments that training may choose from and `besman evaluate recognition` tests with.
    whole, n_left_out = _comparable(config, known, manual, model)
    found = tuple(recognized[row] for row in rows)
    detected = score_labels(found, whole, lengths, model, np.inf)
    named = config.run(known, whole, model)
    by_hand = score_labels(named, whole, lengths, model, np.inf)
    return {
        **results,
        **_score(detected),
        **{f"{key}_manual": value for key, value in _score(by_hand).items()},
        "n_left_out": n_left_out,
    }


def _comparable(
    config: RecognizeMethod,
    recordings: tuple[LabelledRecording, ...],
    manual: tuple[LabelledSegments, ...],
    model: RecognitionModel,
) -> tuple[tuple[LabelledSegments, ...], int]:
    """Return the manual segments and rests of each recording, and how many stretches are neither.

    Parameters
    ----------
    config : RecognizeMethod
        Says what rest is.
    recordings : tuple of LabelledRecording
    manual : tuple of LabelledSegments
        In the same order.
    model : RecognitionModel
        Its markers say whose building blocks are compared.
    """
    side = side_of(model.recipe.markers)

    def find(speed_m_s: float) -> list[Candidate]:
        return find_candidates(recordings, manual, config.idle_s, speed_m_s, side)

    chosen = find(config.idle_speed_m_s)
    whole = tuple(
        _segments_of(segments, [one for one in chosen if one.recording.source == segments.source])
        for segments in manual
    )
    return whole, len(find(np.inf)) - len(chosen)


def _segments_of(manual: LabelledSegments, chosen: Sequence[Candidate]) -> LabelledSegments:
    """Make a record of some candidates of one recording."""
    return replace(
        manual,
        bounds=np.array([one.bounds for one in chosen], dtype=np.int64).reshape(-1, 2),
        labels=tuple(one.label for one in chosen),
        distances=np.zeros(len(chosen)),
        layers=(),
    )


def _score(score: RecognitionScore) -> dict[str, Any]:
    return {
        "accuracy": score.accuracy,
        "n_compared": score.n_compared,
        "per_class": score.per_class,
        "confusion": score.confusion,
    }
