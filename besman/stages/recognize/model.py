"""What recognition learns: a classifier and how features are made, as arrays and names only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.classifiers.kinds import CLASSIFIER_NAMES, classifier_kind
from besman.classifiers.nearest_neighbour import classify, fit_spread, scale
from besman.classifiers.novelty import UNKNOWN, fit_threshold, measure_novelty, rms_distances
from besman.exceptions import RecognitionError
from besman.records import LabelledRecording, Record, freeze
from besman.stages.recognize.features import OBJECT_FEATURES, count_channels, extract_features

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Recipe(Record, stored_as="besman.recognition.model:Recipe"):
    """How features are made.

    Attributes
    ----------
    features, markers, objects : tuple of str
        See `besman.stages.recognize.features.extract_features`.
    n_points : int
        Points per segment.
    """

    features: tuple[str, ...]
    markers: tuple[str, ...]
    objects: tuple[str, ...]
    n_points: int

    def extract(self, recording: LabelledRecording, bounds: npt.ArrayLike) -> FloatArray:
        """Compute the features of segments, shape (S, P, C)."""
        return extract_features(
            recording, bounds, self.features, self.markers, self.objects, self.n_points
        )

    def without_objects(self) -> Recipe:
        """Return the same without the features of objects."""
        features = tuple(name for name in self.features if name not in OBJECT_FEATURES)
        return Recipe(features, self.markers, (), self.n_points)

    @property
    def object_channels(self) -> npt.NDArray[np.bool_]:
        """Which channels are of objects, shape (C,)."""
        of_objects = [name in OBJECT_FEATURES for name in self.features]
        return np.repeat(of_objects, count_channels(self.features, self.markers))


@dataclass(frozen=True, eq=False)
class RecognitionModel(
    Record,
    stored_as="besman.recognition.model:RecognitionModel",
    finite=("centre", "spread", "examples"),
):
    """A trained classifier of segments.

    Attributes
    ----------
    method : str
        One of `besman.classifiers.kinds.CLASSIFIERS`.
    settings : dict
        Parameters of its classifier.
    recipe : Recipe
        How features are made.
    centre, spread : array, shape (C,)
        Scaling of the channels, from the examples alone.
    examples : array, shape (N, P * C)
        Scaled features of the examples.
    labels : tuple of str, length N
        Their classes.
    sources : tuple of str, length N
        Recording of each example.
    bounds : int array, shape (N, 2)
        Rows of each example in its recording.
    threshold : float
        Distance to the nearest example beyond which a segment is ``unknown``.
    parameters : dict of array
        What a Markov model or network learnt.
    fallback : RecognitionModel or None
        The same without features of objects, for segments in which an object was not seen.
    data_sha256 : str
        Checksum of the recordings and manual segments that the examples were drawn from.
    """

    method: str
    settings: dict[str, Any]
    recipe: Recipe
    centre: FloatArray
    spread: FloatArray
    examples: FloatArray
    labels: tuple[str, ...]
    sources: tuple[str, ...]
    bounds: npt.NDArray[np.int64]
    threshold: float
    parameters: dict[str, Any] = field(default_factory=dict)
    fallback: RecognitionModel | None = None
    data_sha256: str = ""

    def __post_init__(self) -> None:
        freeze(
            self,
            {"centre": ("C",), "spread": ("C",), "examples": ("N", "W"), "bounds": ("N", 2)},
            bounds=np.int64,
        )
        n_examples, width = self.examples.shape
        expected = self.recipe.n_points * len(self.centre)
        if (
            self.method not in CLASSIFIER_NAMES
            or len(self.labels) != n_examples
            or width != expected
        ):
            raise RecognitionError(
                f"model {self.method!r}: got {n_examples} examples of {width} values, expected "
                f"{len(self.labels)} of {expected} and a method of {', '.join(CLASSIFIER_NAMES)}"
            )

    @property
    def classes(self) -> tuple[str, ...]:
        """What can be told apart, sorted."""
        return tuple(sorted(set(self.labels)))


@dataclass(frozen=True)
class Examples:
    """Labelled segments to learn from.

    Attributes
    ----------
    labels : tuple of str, length N
    sources : tuple of str, length N
    bounds : int array, shape (N, 2)
    data_sha256 : str
        See `RecognitionModel`.
    """

    labels: tuple[str, ...]
    sources: tuple[str, ...]
    bounds: npt.NDArray[np.int64]
    data_sha256: str = ""


def fit_model(
    values: FloatArray,
    examples: Examples,
    recipe: Recipe,
    method: str,
    settings: dict[str, Any],
    unknown_factor: float | None,
    with_fallback: bool = True,
) -> RecognitionModel:
    """Learn to tell classes apart.

    Parameters
    ----------
    values : array, shape (N, P, C)
        Features of the examples.
    examples : Examples
        What they are.
    recipe : Recipe
        How the features were made.
    method : str
        One of `besman.classifiers.kinds.CLASSIFIERS`.
    settings : dict
        Parameters of its classifier.
    unknown_factor : float or None
        See `besman.classifiers.novelty.fit_threshold`; None: every segment gets a known class.
    with_fallback : bool
        Whether to learn a second time without features of objects, if there are any.

    Returns
    -------
    RecognitionModel

    Raises
    ------
    RecognitionError
        If a feature is not a number, or a classifier needs more than one class or what is not
        installed.
    """
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values).all(axis=(1, 2))))
        raise RecognitionError(f"features of example {row} must be finite, got NaN or infinity")
    fallback = None
    of_objects = recipe.object_channels
    if with_fallback and of_objects.any() and not of_objects.all():
        fallback = fit_model(
            values[:, :, ~of_objects],
            examples,
            recipe.without_objects(),
            method,
            settings,
            unknown_factor,
        )
    centre, spread = fit_spread(values, count_channels(recipe.features, recipe.markers))
    vectors = scale(values, centre, spread)
    if settings.get("n_neighbors", 1) > len(vectors):
        raise RecognitionError(
            f"n_neighbors: got {settings['n_neighbors']}, expected at most the number of examples, "
            f"{len(vectors)}"
        )
    parameters: dict[str, Any] = {}
    if classifier_kind(method).learns_parameters:
        classifier = make_classifier(method, settings, values.shape[2])
        parameters = classifier.fit(vectors, np.array(examples.labels)).parameters_
    threshold = np.inf
    if unknown_factor is not None:
        threshold = fit_threshold(vectors, examples.labels, unknown_factor)
    return RecognitionModel(
        method,
        settings,
        recipe,
        centre,
        spread,
        vectors,
        examples.labels,
        examples.sources,
        examples.bounds,
        threshold,
        parameters,
        fallback,
        examples.data_sha256,
    )


def make_classifier(method: str, settings: dict[str, Any], n_channels: int) -> Any:
    """Return the untrained classifier of a method, under scikit-learn's interface."""
    return classifier_kind(method).make(settings, n_channels)


def restore_classifier(model: RecognitionModel) -> Any:
    """Return the trained classifier of a model."""
    classifier = make_classifier(model.method, model.settings, len(model.centre))
    if model.parameters:
        return classifier.restore(model.classes, model.parameters, model.examples.shape[1])
    return classifier.fit(model.examples, np.array(model.labels))


def classify_features(
    model: RecognitionModel, values: FloatArray
) -> tuple[tuple[str, ...], FloatArray]:
    """Name segments by their features.

    Parameters
    ----------
    model : RecognitionModel
    values : array, shape (S, P, C)
        Features made by the model's recipe.

    Returns
    -------
    labels : tuple of str, length S
        A class, or ``unknown`` if the segment is too far from all examples.
    uncertainty : array, shape (S,)
        Distance to the nearest example (nearest neighbours, warped or not; in spreads of a
        feature), or one minus the probability of the class (Markov models, network).

    Raises
    ------
    RecognitionError
        If a feature is not a number.
    """
    vectors = scale(values, model.centre, model.spread)
    if model.method == "nearest_neighbour" and model.settings.get("n_neighbors", 1) == 1:
        # One matrix of distances tells all; importing scikit-learn would take longer than that.
        labels, uncertainty = classify(vectors, model.examples, model.labels)
        novelty = uncertainty
    else:
        if not np.isfinite(vectors).all():
            raise RecognitionError("features must be finite, got NaN or infinity")
        if len(vectors) == 0:
            return (), np.empty(0)
        classifier = restore_classifier(model)
        labels = tuple(str(label) for label in classifier.predict(vectors))
        uncertainty = classifier.uncertainty(vectors)
        novelty = measure_novelty(vectors, model.examples)
    known = novelty <= model.threshold
    return tuple(
        label if ok else UNKNOWN for label, ok in zip(labels, known, strict=True)
    ), uncertainty


def name_segments(
    model: RecognitionModel, recording: LabelledRecording, bounds: npt.ArrayLike
) -> tuple[tuple[str, ...], FloatArray]:
    """Name segments of a recording; see `classify_features`.

    Where a marker of an object is missing or was not seen within a segment, that segment is named
    without the features of objects.
    """
    rows = np.asarray(bounds, dtype=np.int64).reshape(-1, 2)
    if model.fallback is None:
        return classify_features(model, model.recipe.extract(recording, rows))
    seen = _objects_seen(recording, rows, model.recipe.objects)
    labels = np.full(len(rows), "", dtype=object)
    uncertainty = np.empty(len(rows))
    for one, chosen in ((model, seen), (model.fallback, ~seen)):
        if chosen.any():
            values = one.recipe.extract(recording, rows[chosen])
            labels[chosen], uncertainty[chosen] = classify_features(one, values)
    return tuple(labels.tolist()), uncertainty


def rank_classes(
    model: RecognitionModel, recording: LabelledRecording, bounds: npt.ArrayLike
) -> FloatArray:
    """Return how far segments of a recording are from the nearest example of every class.

    Parameters
    ----------
    model : RecognitionModel
        Of any method; only its examples are looked at.
    recording : LabelledRecording
    bounds : int array, shape (S, 2)
        Half-open rows.

    Returns
    -------
    array, shape (S, C)
        By the order of ``model.classes``; distances as `classify_features` measures them, without
        the features of objects where an object was not seen.

    Raises
    ------
    RecognitionError
        If features cannot be made of a segment.
    """
    rows = np.asarray(bounds, dtype=np.int64).reshape(-1, 2)
    fallback = model.fallback or model
    seen = np.ones(len(rows), dtype=bool)
    if model.fallback is not None:
        seen = _objects_seen(recording, rows, model.recipe.objects)
    found = np.empty((len(rows), len(model.classes)))
    labels = np.array(model.labels)
    for one, chosen in ((model, seen), (fallback, ~seen)):
        if chosen.any():
            values = one.recipe.extract(recording, rows[chosen])
            apart = rms_distances(scale(values, one.centre, one.spread), one.examples)
            found[chosen] = np.stack(
                [apart[:, labels == name].min(axis=1) for name in model.classes], axis=1
            )
    return found


def _objects_seen(
    recording: LabelledRecording, rows: npt.NDArray[np.int64], objects: Sequence[str]
) -> npt.NDArray[np.bool_]:
    """Tell of each segment whether all markers of objects were seen throughout."""
    if not set(objects) <= set(recording.markers):
        return np.zeros(len(rows), dtype=bool)
    columns = [recording.markers.index(name) for name in objects]
    gaps = np.isnan(recording.positions[:, columns]).any(axis=(1, 2)).cumsum()
    before = np.concatenate([[0], gaps])
    return np.asarray(before[rows[:, 1]] == before[rows[:, 0]])
