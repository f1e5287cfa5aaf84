"""Whether a model from a file is one: nothing in it is taken on trust."""

from __future__ import annotations

from typing import Any

import numpy as np

from besman.exceptions import RecognitionError, nearest
from besman.records.frozen import GREATEST
from besman.stages.recognize.features import FEATURE_NAMES, count_channels
from besman.stages.recognize.model import Recipe, RecognitionModel

# Least and greatest value of every parameter of a method's classifier.
_SETTINGS: dict[str, dict[str, tuple[float, float]]] = {
    "nearest_neighbour": {"n_neighbors": (1, 10**6)},
    "dtw": {"band_points": (0, 10**6)},
    "hmm": {"n_states": (1, 1000), "random_state": (0, 2**32 - 1), "smallest_variance": (0.0, 1e6)},
    "lstm": {
        "n_cells": (1, 10_000),
        "batch_size": (1, 10**6),
        "patience": (1, 10**6),
        "max_epochs": (1, 10**6),
        "random_state": (0, 2**32 - 1),
        "learning_rate": (0.0, 1.0),
    },
}
_MOST_POINTS = 10_000
_SUM_TOLERANCE = 1e-6


def check_model(model: RecognitionModel) -> None:
    """Refuse a model whose parts do not fit each other.

    Raises
    ------
    RecognitionError
        If features, settings, examples or learnt parameters are none, or not of one model.
    """
    _check_recipe(model.recipe, len(model.centre))
    n_examples = len(model.labels)
    if n_examples == 0 or len(model.sources) != n_examples or len(model.bounds) != n_examples:
        raise RecognitionError(
            f"model: got {n_examples} labels, {len(model.sources)} sources and "
            f"{len(model.bounds)} bounds; expected one of each an example, and at least one"
        )
    if np.any(model.bounds[:, 0] < 0) or np.any(model.bounds[:, 1] <= model.bounds[:, 0]):
        raise RecognitionError("model: bounds: expected half-open rows, each end after its start")
    if not np.all(model.spread > 0):
        raise RecognitionError("model: spread: expected more than 0 of every channel")
    if not model.threshold >= 0:
        raise RecognitionError(f"model: threshold: got {model.threshold:g}, expected 0 or more")
    _check_settings(model)
    _check_parameters(model)
    fallback = model.fallback
    if fallback is not None and (
        fallback.fallback is not None
        or fallback.method != model.method
        or fallback.recipe != model.recipe.without_objects()
    ):
        raise RecognitionError("model: fallback: expected the same without features of objects")


def _check_recipe(recipe: Recipe, n_channels: int) -> None:
    """Refuse features that are none, or that give another number of channels."""
    unknown = [name for name in recipe.features if name not in FEATURE_NAMES]
    if unknown:
        raise RecognitionError(
            f"model: no feature {unknown[0]!r}; {nearest(unknown[0], FEATURE_NAMES)}"
        )
    if not 1 <= recipe.n_points <= _MOST_POINTS:
        raise RecognitionError(f"model: n_points: got {recipe.n_points}, expected 1 to 10000")
    expected = sum(count_channels(recipe.features, recipe.markers))
    if n_channels != expected or not expected:
        raise RecognitionError(
            f"model: got {n_channels} channels, expected {expected} of the features "
            f"{', '.join(recipe.features)} and {len(recipe.markers)} markers"
        )


def _check_settings(model: RecognitionModel) -> None:
    """Refuse parameters that a method's classifier does not take."""
    allowed = _SETTINGS[model.method]
    for name, value in model.settings.items():
        if name not in allowed:
            raise RecognitionError(f"model: no setting {name!r:.40}; {nearest(name, allowed)}")
        low, high = allowed[name]
        kinds = (int, float) if isinstance(high, float) else (int,)
        if type(value) not in kinds or not low <= value <= high:
            raise RecognitionError(
                f"model: {name}: got {value!r:.40}, expected {low:g} to {high:g}"
            )
    if model.settings.get("n_neighbors", 1) > len(model.labels):
        raise RecognitionError(
            f"model: n_neighbors: got {model.settings['n_neighbors']}, expected at most the number "
            f"of examples, {len(model.labels)}"
        )


def _check_parameters(model: RecognitionModel) -> None:
    """Refuse what a Markov model or network cannot have learnt."""
    shapes = _shapes(model)
    if set(model.parameters) != set(shapes):
        odd = sorted(set(model.parameters) ^ set(shapes))
        raise RecognitionError(f"model: parameters: {odd[0]!r:.60} is missing or unknown")
    for name, shape in shapes.items():
        value = model.parameters[name]
        fits = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.shape == shape
        # Half precision cannot hold what it is compared with.
        if not fits or not np.all(np.abs(value.astype(np.float64)) <= GREATEST):
            raise RecognitionError(
                f"model: parameters: {name}: expected finite numbers of shape {shape}"
            )
        part = name.split("_")[0]
        # A row of each is a distribution.
        if part in ("startprob", "transmat") and (
            np.any(value < 0) or np.any(np.abs(value.sum(axis=-1) - 1) > _SUM_TOLERANCE)
        ):
            raise RecognitionError(f"model: parameters: {name}: expected rows that sum to 1")
        if part == "covars" and not np.all(value > 0):
            raise RecognitionError(f"model: parameters: {name}: expected variances above 0")


def _shapes(model: RecognitionModel) -> dict[str, tuple[int, ...]]:
    """Return the shape of every parameter that a model of this method has."""
    n_channels, n_classes = len(model.centre), len(model.classes)
    if model.method == "hmm":
        return {
            f"{part}_{code}": shape
            for code in range(n_classes)
            for part, shape in _hmm_shapes(model.parameters.get(f"startprob_{code}"), n_channels)
        }
    if model.method == "lstm":
        n_cells = int(model.settings.get("n_cells", 25))
        return {
            "lstm.weight_ih_l0": (4 * n_cells, n_channels),
            "lstm.weight_hh_l0": (4 * n_cells, n_cells),
            "lstm.bias_ih_l0": (4 * n_cells,),
            "lstm.bias_hh_l0": (4 * n_cells,),
            "dense.weight": (n_classes, n_cells),
            "dense.bias": (n_classes,),
        }
    return {}


def _hmm_shapes(start: Any, n_channels: int) -> list[tuple[str, tuple[int, ...]]]:
    """Return the shapes of a Markov model's parts; a class may have fewer states than allowed."""
    n_states = start.shape[0] if isinstance(start, np.ndarray) and start.ndim == 1 else 1
    return [
        ("startprob", (n_states,)),
        ("transmat", (n_states, n_states)),
        ("means", (n_states, n_channels)),
        ("covars", (n_states, n_channels)),
    ]
