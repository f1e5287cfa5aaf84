"""Proposals for a person to accept, mend or reject: borders of vMCI, labels of the nearest example.

Both come with a confidence. That of a border is its posterior probability; that of a stretch the
least of its two borders' and of one minus that of any border left out inside it. That of a label
compares the distance a to the nearest example of its class with the distance b to the nearest of
any other class, (b - a) / (b + a), and falls with a where a is greater than the examples suggest
(`besman.classifiers.novelty.fit_threshold`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from besman.classifiers.draw_examples import Candidate
from besman.classifiers.kinds import classifier_kind
from besman.exceptions import RecognitionError
from besman.records import FloatArray, LabelledRecording, LabelledSegments
from besman.records.layers import Side
from besman.stages.recognize.examples import find_candidates
from besman.stages.recognize.model import (
    Examples,
    Recipe,
    RecognitionModel,
    fit_model,
    name_segments,
    rank_classes,
)
from besman.stages.recognize.stage import RecognizeConfig
from besman.stages.segment.stage import ValleyVmciConfig

_NEAR_S = 0.06  # the grid of the probabilities is 20 Hz
_LONGEST_S = 30.0
_LONG_RECORDING_S = 300.0
_ALONE = 0.5  # confidence of the only label there is an example of


class ProposedSegment(NamedTuple):
    """A stretch of a recording that may be a segment: half-open rows, confidence of its borders."""

    start: int
    end: int
    confidence: float


class Name(NamedTuple):
    """A label and its confidence."""

    label: str
    confidence: float


def propose_stretches(recording: LabelledRecording, hand: str) -> list[ProposedSegment]:
    """Cut a recording where besman's default segmentation does.

    Parameters
    ----------
    recording : LabelledRecording
    hand : str
        Marker of the hand that is looked at.

    Returns
    -------
    list of ProposedSegment
        Together they cover the recording.

    Raises
    ------
    SegmentationError
        If the hand was not seen throughout.
    """
    duration = len(recording.time) / recording.rate_hz
    longest = _LONGEST_S if duration > _LONG_RECORDING_S else None
    (found,) = ValleyVmciConfig(markers=(hand,), longest_s=longest).run((recording,))
    probability, n = found.border_probability, len(recording.time)
    near = max(1, round(_NEAR_S * recording.rate_hz))

    def border(row: int) -> float:
        if row in (0, n) or not len(probability):
            return 1.0
        return float(probability[max(0, row - near) : row + near + 1].max())

    stretches = []
    for start, end in found.bounds.tolist():
        inside = probability[start + near + 1 : end - near]
        left_out = float(inside.max()) if len(inside) else 0.0
        confidence = min(border(start), border(end), 1.0 - left_out)
        stretches.append(ProposedSegment(start, end, round(confidence, 4)))
    return stretches


class Teacher:
    """Names stretches after what is labelled so far; keeps the features that it computed."""

    def __init__(self) -> None:
        self._features: WeakKeyDictionary[
            LabelledRecording, dict[tuple[Recipe, int, int], FloatArray]
        ] = WeakKeyDictionary()

    def learn(
        self,
        recordings: Sequence[LabelledRecording],
        truth: Sequence[LabelledSegments],
        side: Side,
    ) -> RecognitionModel | None:
        """Learn from all labelled segments.

        Parameters
        ----------
        recordings : sequence of LabelledRecording
            The same objects at every call.
        truth : sequence of LabelledSegments
            Of some of them, matched by source.
        side : "right" or "left"
            Arm that the segments are of.

        Returns
        -------
        RecognitionModel or None
            None if nothing is labelled.
        """
        stage = RecognizeConfig()
        plain = [dataclasses.replace(one, layers=()) for one in truth if len(one.labels)]
        if not plain:
            return None
        candidates = find_candidates(recordings, plain, stage.idle_s, stage.idle_speed_m_s, side)
        # A spline through the positions needs them.
        candidates = [one for one in candidates if one.bounds[1] - one.bounds[0] >= 2]
        if not candidates:
            return None
        recipe = stage.make_recipe([one.recording for one in candidates], [2], side)
        values = self._extract(candidates, recipe)
        examples = Examples(
            labels=tuple(one.label for one in candidates),
            sources=tuple(one.recording.source for one in candidates),
            bounds=np.array([one.bounds for one in candidates]),
        )
        return fit_model(values, examples, recipe, stage.method, stage.settings, 1.0)

    def _extract(self, candidates: Sequence[Candidate], recipe: Recipe) -> FloatArray:
        """Return the features of examples; those of one recording are computed at once."""
        missing: dict[LabelledRecording, list[tuple[int, int]]] = {}
        for recording, bounds, _ in candidates:
            if (recipe, *bounds) not in self._features.setdefault(recording, {}):
                missing.setdefault(recording, []).append(bounds)
        for recording, rows in missing.items():
            values = recipe.extract(recording, rows)
            for bounds, one in zip(rows, values, strict=True):
                self._features[recording][recipe, *bounds] = one
        return np.stack([self._features[one.recording][recipe, *one.bounds] for one in candidates])


def name_stretches(
    models: Sequence[RecognitionModel], recording: LabelledRecording, bounds: npt.ArrayLike
) -> list[Name | None]:
    """Name stretches of a recording by the model that is most sure.

    Parameters
    ----------
    models : sequence of RecognitionModel
    recording : LabelledRecording
    bounds : int array, shape (S, 2)
        Half-open rows.

    Returns
    -------
    list of (Name or None), length S
        None where no model can say anything.
    """
    rows = np.asarray(bounds, dtype=np.int64).reshape(-1, 2)
    best: list[Name | None] = [None] * len(rows)
    for model in models:
        try:
            names = _name(model, recording, rows)
        except RecognitionError:
            # The model looks at markers that were not seen here.
            continue
        best = [
            new if old is None or new.confidence > old.confidence else old
            for old, new in zip(best, names, strict=True)
        ]
    return best


def _name(
    model: RecognitionModel, recording: LabelledRecording, rows: npt.NDArray[np.int64]
) -> list[Name]:
    """Name stretches by one model."""
    if classifier_kind(model.method).learns_parameters:
        labels, uncertainty = name_segments(model, recording, rows)
        return [
            Name(label, float(np.clip(1 - u, 0, 1)))
            for label, u in zip(labels, uncertainty, strict=True)
        ]
    apart = rank_classes(model, recording, rows)
    order = np.argsort(apart, axis=1)
    names = []
    for row, places in zip(apart, order, strict=True):
        near = float(row[places[0]])
        far = float(row[places[1]]) if len(row) > 1 else 2 * model.threshold
        confidence = _ALONE
        if np.isfinite(far):
            confidence = max(0.0, (far - near) / (far + near)) if far + near > 0 else 1.0
        if near > model.threshold:
            confidence *= model.threshold / near
        names.append(Name(model.classes[places[0]], round(confidence, 4)))
    return names
