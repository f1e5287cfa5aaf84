"""The recognition stage: building blocks get names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import BeforeValidator, Field, field_validator

from besman.classifiers.draw_examples import draw_examples
from besman.config.stage import Items, Stage, Training, Truth, Work
from besman.exceptions import RecognitionError, nearest
from besman.person.body import find_body
from besman.records import LabelledRecording, LabelledSegments, Segments
from besman.records.files import digest
from besman.records.layers import Side, hand_side, side_of
from besman.stages.recognize.examples import find_candidates
from besman.stages.recognize.features import BODY_MARKERS, FEATURE_NAMES
from besman.stages.recognize.figures import recognize_results
from besman.stages.recognize.model import (
    Examples,
    Recipe,
    RecognitionModel,
    fit_model,
)
from besman.stages.recognize.naming import name_recordings
from besman.stages.recognize.one_throw import OneThrowConfig


class _TrainedStage(Stage):
    """What all methods have in common: examples, features, and what is unknown.

    Attributes
    ----------
    model : str, optional
        A model file of ``besman train``, in place of labelled examples; the settings of training
        then do not matter.
    examples_per_class : int
        Labelled segments of each class to learn from; of a class with fewer, all are taken.
    seed : int
        Seed of the draw of examples, and of what is random in a method.
    features : tuple of str
        Features besides those of an object; names as in
        `besman.stages.recognize.features.FEATURE_NAMES`.
    object_features : tuple of str
        Features of an object, if there is one.
    markers : "auto" or tuple of str
        Markers whose positions, displacements and speeds are features, and which tell the arms to
        look at. ``auto`` takes hand, elbow and shoulder of every arm that the recordings have; of
        one arm if the manual segments have layers of hands.
    objects : "auto" or tuple of str
        Markers on the object that is handled. ``auto`` takes every marker of a camera system that
        is not on the body and has no gap in the recordings that are learnt from.
    n_points : int or "mean"
        Points that every segment is interpolated to; ``mean``: as many as the examples have on
        average.
    idle_s : float
        Stretches without a manual label longer than this, seconds, are examples of ``idle``,
        unless the hand moves in them.
    idle_speed_m_s : float
        Faster than this, metres per second, a hand does not rest.
    classes : tuple of str, optional
        Classes to learn; all that are labelled if not given.
    unknown_factor : float, optional
        Segments farther from all examples than the distance that the examples suggest (see
        `besman.classifiers.novelty.fit_threshold`), times this, are ``unknown``; null: every
        segment gets a known class.
    """

    method: str
    model: str | None = None
    examples_per_class: int = Field(default=5, ge=1)
    seed: int = Field(default=0, ge=0)
    features: Annotated[tuple[str, ...], Field(min_length=1)] = (
        "positions",
        "hand_orientation",
        "displacements",
        "log_hand_speed",
    )
    object_features: tuple[str, ...] = ("log_object_distance", "log_object_speed")
    markers: Literal["auto"] | Annotated[tuple[str, ...], Field(min_length=1)] = "auto"
    objects: Literal["auto"] | tuple[str, ...] = "auto"
    n_points: Annotated[int, Field(ge=2)] | Literal["mean"] = 25
    idle_s: float = Field(default=0.25, ge=0)
    idle_speed_m_s: float = Field(default=0.4, gt=0)
    classes: tuple[str, ...] | None = None
    unknown_factor: float | None = Field(default=1.0, gt=0)

    @field_validator("features", "object_features")
    @classmethod
    def _check_features(cls, features: tuple[str, ...]) -> tuple[str, ...]:
        for name in features:
            if name not in FEATURE_NAMES:
                raise ValueError(f"no feature {name!r}; {nearest(name, FEATURE_NAMES)}")
        return features

    @property
    def settings(self) -> dict[str, Any]:
        """Parameters of the classifier."""
        return {}

    @property
    def learns(self) -> bool:
        """Whether it learns from labelled examples."""
        return self.model is None

    @property
    def training(self) -> Training[RecognitionModel]:
        """Learning, as a step of its own."""
        return Training(self, self.train, self.examples_per_class)

    def items(
        self,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[Segments | LabelledSegments, ...],
        model: RecognitionModel,
    ) -> Items:
        """Count the segments."""
        return Items(sum(len(found.bounds) for found in segments), "segments")

    def figures(
        self,
        recognized: tuple[LabelledSegments, ...],
        truth: Truth,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[Segments | LabelledSegments, ...],
        model: RecognitionModel,
    ) -> dict[str, Any]:
        """Return the counts by label, and how many are right; see `recognize_results`."""
        return recognize_results(
            recordings,
            recognized,
            truth.blocks,
            model,
            idle_s=self.idle_s,
            idle_speed_m_s=self.idle_speed_m_s,
        )

    def train(
        self,
        recordings: tuple[LabelledRecording, ...],
        truth: tuple[LabelledSegments, ...],
        work: Work = Work(),
    ) -> RecognitionModel:
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
        RecognitionModel

        Raises
        ------
        RecognitionError
            If a class has no examples, or features cannot be made of an example.
        """
        layered = hand_side(truth)
        side = layered or "right"
        if self.markers != "auto":
            side = side_of(self.markers)
        candidates = find_candidates(recordings, truth, self.idle_s, self.idle_speed_m_s, side)
        labels = [candidate.label for candidate in candidates]
        drawn = draw_examples(labels, self.examples_per_class, self.seed, self.classes)
        chosen = [candidates[index] for index in drawn]
        recipe = self.make_recipe(
            [candidate.recording for candidate in candidates],
            [int(c.bounds[1] - c.bounds[0]) for c in chosen],
            layered,
        )
        values = np.concatenate([recipe.extract(c.recording, [c.bounds]) for c in chosen])
        examples = Examples(
            labels=tuple(candidate.label for candidate in chosen),
            sources=tuple(candidate.recording.source for candidate in chosen),
            bounds=np.array([candidate.bounds for candidate in chosen]),
            data_sha256=digest((recordings, truth)),
        )
        return fit_model(values, examples, recipe, self.method, self.settings, self.unknown_factor)

    def make_recipe(
        self,
        recordings: Sequence[LabelledRecording],
        lengths: Sequence[int],
        side: Side | None = None,
    ) -> Recipe:
        """Decide how features are made, by what the recordings have.

        Parameters
        ----------
        recordings : sequence of LabelledRecording
            What is learnt from.
        lengths : sequence of int
            Samples of each example.
        side : "right" or "left", optional
            Arm that ``markers: auto`` takes; all arms if not given.
        """
        first = recordings[0]
        body = find_body(first.markers, first.source)
        of_arms = tuple(
            name for arm in body.arms if side in (None, arm.side) for name in arm.markers
        )
        markers = of_arms if self.markers == "auto" else self.markers
        objects = self._find_objects(recordings)
        features = self.features
        arms = body.arms_of(markers)
        if first.orientations is None and not all(arm.cluster for arm in arms):
            # A suit that exports positions alone does not tell how the hand is turned.
            features = tuple(name for name in features if name != "hand_orientation")
        if objects:
            features += tuple(name for name in self.object_features if name not in features)
        if not features:
            raise RecognitionError(
                f"{first.source}: hand_orientation needs three markers on the hand or a suit's "
                "orientations, got neither, and there is no other feature"
            )
        mean = max(2, round(float(np.mean(lengths))))
        n_points = mean if self.n_points == "mean" else self.n_points
        return Recipe(features, markers, objects, n_points)

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[Segments | LabelledSegments, ...],
        model: RecognitionModel,
        work: Work = Work(),
    ) -> tuple[LabelledSegments, ...]:
        """Name segments.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
            The recordings.
        segments : tuple of Segments or LabelledSegments
            Segments of each recording, in the same order; labels are not looked at.
        model : RecognitionModel
            What `train` learnt.
        work : Work
            How to run.

        Returns
        -------
        tuple of LabelledSegments
            Labels and their uncertainty.

        Raises
        ------
        RecognitionError
            If features cannot be made of a segment.
        """
        return name_recordings(model, recordings, segments, work)

    def _find_objects(self, recordings: Sequence[LabelledRecording]) -> tuple[str, ...]:
        """Return the object's markers."""
        if self.objects != "auto":
            return self.objects
        if "back_top" not in recordings[0].markers:
            return ()
        return tuple(
            name
            for name in recordings[0].markers
            if name not in BODY_MARKERS
            and all(
                name in recording.markers and np.isfinite(recording.marker(name)).all()
                for recording in recordings
            )
        )


class RecognizeConfig(_TrainedStage):
    """Nearest neighbours over few labelled examples of each class.

    Attributes
    ----------
    n_neighbors : int
        Examples that vote.
    """

    method: Literal["nearest_neighbour"] = "nearest_neighbour"
    n_neighbors: int = Field(default=1, ge=1)

    @property
    def settings(self) -> dict[str, Any]:
        """Parameters of the classifier."""
        return {"n_neighbors": self.n_neighbors}


class DtwConfig(_TrainedStage):
    """Nearest neighbour under dynamic time warping.

    Attributes
    ----------
    band_points : int
        How far warped time may run ahead or behind.
    """

    method: Literal["dtw"] = "dtw"
    band_points: int = Field(default=5, ge=0)

    @property
    def settings(self) -> dict[str, Any]:
        """Parameters of the classifier."""
        return {"band_points": self.band_points}


class HmmConfig(_TrainedStage):
    """One hidden Markov model a class.

    Attributes
    ----------
    n_states : int
        Hidden states.
    """

    libraries: ClassVar[tuple[str, ...]] = ("hmmlearn",)

    method: Literal["hmm"] = "hmm"
    n_states: int = Field(default=1, ge=1)

    @property
    def settings(self) -> dict[str, Any]:
        """Parameters of the classifier."""
        return {"n_states": self.n_states, "random_state": self.seed}


class LstmConfig(_TrainedStage):
    """A network with one layer of long short-term memory.

    Attributes
    ----------
    n_cells, batch_size, patience, max_epochs : int
        See `besman.classifiers.lstm.LstmClassifier`.
    """

    libraries: ClassVar[tuple[str, ...]] = ("torch",)

    method: Literal["lstm"] = "lstm"
    n_cells: int = Field(default=25, ge=1)
    batch_size: int = Field(default=16, ge=1)
    patience: int = Field(default=10, ge=1)
    max_epochs: int = Field(default=150, ge=1)

    @property
    def settings(self) -> dict[str, Any]:
        """Parameters of the classifier."""
        names = ("n_cells", "batch_size", "patience", "max_epochs")
        return {name: getattr(self, name) for name in names} | {"random_state": self.seed}


RecognizeMethod = RecognizeConfig | DtwConfig | HmmConfig | LstmConfig
CONFIGS: dict[str, type[RecognizeMethod]] = {
    config.model_fields["method"].default: config for config in get_args(RecognizeMethod)
}


def _default_method(value: Any) -> Any:
    """Take the nearest neighbour where no method is named."""
    if isinstance(value, dict) and "method" not in value:
        return {"method": "nearest_neighbour", **value}
    return value


TrainedStage = Annotated[
    RecognizeMethod, Field(discriminator="method"), BeforeValidator(_default_method)
]
"""All methods that learn."""

RecognizeStage = Annotated[
    RecognizeMethod | OneThrowConfig,
    Field(discriminator="method"),
    BeforeValidator(_default_method),
]
"""All methods under one key: ``recognize: {method: ...}``."""
