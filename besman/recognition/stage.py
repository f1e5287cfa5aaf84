"""The recognition stage: building blocks get names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator

from besman.exceptions import RecognitionError, nearest
from besman.manual_segments import complete_truth
from besman.recognition.examples import draw_examples
from besman.recognition.features import (
    BODY_MARKERS,
    FEATURE_NAMES,
    OBJECT_FEATURES,
    count_channels,
    extract_features,
)
from besman.recognition.nearest_neighbour import (
    NearestNeighbourModel,
    classify,
    fit_scale,
    scale,
)
from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.stage import Stage, Work


class RecognizeConfig(Stage):
    """One nearest neighbour over few labelled examples of each class.

    Attributes
    ----------
    examples_per_class : int
        Labelled segments of each class to learn from; of a class with fewer, all are taken.
    seed : int
        Seed of the draw of examples.
    features : tuple of str
        Features besides those of an object; names as in thesis 5.3.2.
    markers : tuple of str
        Markers whose positions and speeds are features.
    objects : "auto" or tuple of str
        Markers on the object that is handled: distance to the hand and speed become features.
        ``auto`` takes every marker that is not on the body and has no gap in the recordings that
        are learnt from.
    n_points : int
        Points that every segment is interpolated to.
    idle_s : float
        Stretches without a manual label longer than this, seconds, are examples of ``idle``.
    classes : tuple of str, optional
        Classes to learn; all that are labelled if not given.
    """

    method: Literal["nearest_neighbour"] = "nearest_neighbour"
    examples_per_class: int = Field(default=5, ge=1)
    seed: int = Field(default=0, ge=0)
    features: Annotated[tuple[str, ...], Field(min_length=1)] = (
        "positions",
        "hand_orientation",
    )
    markers: Annotated[tuple[str, ...], Field(min_length=1)] = ("hand_top", "elbow", "shoulder")
    objects: Literal["auto"] | tuple[str, ...] = "auto"
    n_points: int = Field(default=25, ge=2)
    idle_s: float = Field(default=0.25, ge=0)
    classes: tuple[str, ...] | None = None

    @field_validator("features")
    @classmethod
    def _check_features(cls, features: tuple[str, ...]) -> tuple[str, ...]:
        for name in features:
            if name not in FEATURE_NAMES:
                raise ValueError(f"no feature {name!r}; {nearest(name, FEATURE_NAMES)}")
        return features

    def train(
        self,
        recordings: tuple[LabelledRecording, ...],
        truth: tuple[LabelledSegments, ...],
        work: Work = Work(),
    ) -> NearestNeighbourModel:
        """Learn from manual segments.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
            Recordings; those without manual segments teach nothing.
        truth : tuple of LabelledSegments
            Manual segments of some of the recordings, matched by source.
        work : Work
            How to run.

        Returns
        -------
        NearestNeighbourModel
            Examples, how to make features, and where the examples come from.

        Raises
        ------
        RecognitionError
            If a class has no examples, or features cannot be made of an example.
        """
        by_source = {recording.source: recording for recording in recordings}
        candidates = []
        for manual in truth:
            if manual.source not in by_source:
                raise RecognitionError(
                    f"manual segments of {manual.source!r} have no recording; "
                    f"{nearest(manual.source, by_source)}"
                )
            recording = by_source[manual.source]
            whole = complete_truth(manual, len(recording.time), self.idle_s)
            candidates += [
                (recording, bounds, label)
                for bounds, label in zip(whole.bounds, whole.labels, strict=True)
            ]
        labels = [label for _, _, label in candidates]
        chosen = [
            candidates[index]
            for index in draw_examples(labels, self.examples_per_class, self.seed, self.classes)
        ]
        objects = self._find_objects([recording for recording, _, _ in candidates])
        features = self.features
        if objects:
            features += tuple(name for name in OBJECT_FEATURES if name not in features)
        values = np.concatenate(
            [
                extract_features(recording, bounds, features, self.markers, objects, self.n_points)
                for recording, bounds, _ in chosen
            ]
        )
        low, span = fit_scale(values, count_channels(features, self.markers))
        return NearestNeighbourModel(
            examples=scale(values, low, span),
            labels=tuple(label for _, _, label in chosen),
            low=low,
            span=span,
            features=features,
            markers=self.markers,
            objects=objects,
            n_points=self.n_points,
            sources=tuple(recording.source for recording, _, _ in chosen),
            bounds=np.array([bounds for _, bounds, _ in chosen]),
        )

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[Segments | LabelledSegments, ...],
        model: NearestNeighbourModel,
        work: Work = Work(),
    ) -> tuple[LabelledSegments, ...]:
        """Name segments.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
            The recordings.
        segments : tuple of Segments or LabelledSegments
            Segments of each recording, in the same order; labels are not looked at.
        model : NearestNeighbourModel
            What `train` learnt.
        work : Work
            How to run.

        Returns
        -------
        tuple of LabelledSegments
            Labels, and the distance to the nearest example as their uncertainty.

        Raises
        ------
        RecognitionError
            If features cannot be made of a segment.
        """
        results = []
        for index, (recording, found) in enumerate(zip(recordings, segments, strict=True)):
            values = extract_features(
                recording,
                found.bounds,
                model.features,
                model.markers,
                model.objects,
                model.n_points,
            )
            vectors = scale(values, model.low, model.span)
            labels, distances = classify(vectors, model.examples, model.labels)
            results.append(
                LabelledSegments(
                    found.bounds,
                    labels,
                    distances,
                    found.rate_hz,
                    found.source,
                    found.first_frame,
                )
            )
            work.progress((index + 1) / len(recordings))
        return tuple(results)

    def _find_objects(self, recordings: Sequence[LabelledRecording]) -> tuple[str, ...]:
        """Return the object's markers."""
        if self.objects != "auto":
            return self.objects
        return tuple(
            name
            for name in recordings[0].markers
            if name not in BODY_MARKERS
            and all(
                name in recording.markers and np.isfinite(recording.marker(name)).all()
                for recording in recordings
            )
        )
