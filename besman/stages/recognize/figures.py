"""Figures of a run that need more than one stage's record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from besman.classifiers.draw_examples import Candidate
from besman.records import LabelledRecording, LabelledSegments
from besman.records.layers import side_of
from besman.stages.recognize.examples import find_candidates
from besman.stages.recognize.model import RecognitionModel
from besman.stages.recognize.naming import name_recordings
from besman.stages.recognize.scores import RecognitionScore, score_labels


def recognize_results(
    recordings: tuple[LabelledRecording, ...],
    recognized: tuple[LabelledSegments, ...],
    truth: tuple[LabelledSegments | None, ...],
    model: RecognitionModel,
    *,
    idle_s: float,
    idle_speed_m_s: float,
) -> dict[str, Any]:
    """Return the counts by label; with truth also how many labels are right.

    Parameters
    ----------
    recordings : tuple of LabelledRecording
    recognized : tuple of LabelledSegments
        What the stage gave, in the order of the recordings.
    truth : tuple of LabelledSegments or None
        In the same order.
    model : RecognitionModel
        Its examples do not count.
    idle_s, idle_speed_m_s : float
        What rest is, as training takes it: a stretch without a label that lasts longer, in seconds,
        and in which the hand is slower, metres per second.

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
    whole, n_left_out = _comparable(known, manual, model, idle_s, idle_speed_m_s)
    found = tuple(recognized[row] for row in rows)
    detected = score_labels(found, whole, lengths, model, np.inf)
    named = name_recordings(model, known, whole)
    by_hand = score_labels(named, whole, lengths, model, np.inf)
    return {
        **results,
        **_score(detected),
        **{f"{key}_manual": value for key, value in _score(by_hand).items()},
        "n_left_out": n_left_out,
    }


def _comparable(
    recordings: tuple[LabelledRecording, ...],
    manual: tuple[LabelledSegments, ...],
    model: RecognitionModel,
    idle_s: float,
    idle_speed_m_s: float,
) -> tuple[tuple[LabelledSegments, ...], int]:
    """Return the manual segments and rests of each recording, and how many stretches are neither.

    Parameters
    ----------
    recordings : tuple of LabelledRecording
    manual : tuple of LabelledSegments
        In the same order.
    model : RecognitionModel
        Its markers say whose building blocks are compared.
    idle_s, idle_speed_m_s : float
        As in `recognize_results`.
    """
    side = side_of(model.recipe.markers)

    def find(speed_m_s: float) -> list[Candidate]:
        return find_candidates(recordings, manual, idle_s, speed_m_s, side)

    chosen = find(idle_speed_m_s)
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
