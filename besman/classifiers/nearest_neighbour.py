"""Scaling of features, and classification by the nearest labelled example."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.classifiers.novelty import rms_distances
from besman.exceptions import RecognitionError

FloatArray = npt.NDArray[np.float64]


def fit_scale(values: FloatArray, widths: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Find smallest values and ranges, to scale to [0, 1] as thesis 5.3.2 does.

    The channels of one feature share one range, the greatest of them: a coordinate in which
    nothing moves would otherwise be scaled up until its noise counts like movement. With 5 examples
    per class of real movements this raises the accuracy from 0.87 to 0.90 (positions alone).

    Parameters
    ----------
    values : array, shape (N, P, C)
        Features of training examples.
    widths : sequence of int
        Channels of each feature, C in all.

    Returns
    -------
    low, span : array, shape (C,)
        A feature that is constant has span 1.
    """
    low = values.min(axis=(0, 1))
    ranges = values.max(axis=(0, 1)) - low
    parts = np.split(ranges, np.cumsum(widths)[:-1])
    span = np.concatenate([np.full(len(part), part.max()) for part in parts])
    return low, np.where(span > 0, span, 1.0)


def fit_spread(values: FloatArray, widths: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Find centres and spreads, so that every feature counts the same in a distance.

    The spread of a feature is its root mean square distance from its mean over the examples, all
    its channels together: unlike the range it does not depend on the number of channels, nor on the
    two most extreme values.

    Parameters
    ----------
    values : array, shape (N, P, C)
        Features of training examples.
    widths : sequence of int
        Channels of each feature, C in all.

    Returns
    -------
    centre, spread : array, shape (C,)
        For `scale`; a feature that is constant has spread 1.
    """
    centre = values.mean(axis=(0, 1))
    variance = ((values - centre) ** 2).mean(axis=(0, 1))
    parts = np.split(variance, np.cumsum(widths)[:-1])
    spread = np.sqrt(np.concatenate([np.full(len(part), part.sum()) for part in parts]))
    # Rounding leaves a trace of spread in what is constant.
    return centre, np.where(spread > 1e-9, spread, 1.0)


def scale(values: FloatArray, low: FloatArray, span: FloatArray) -> FloatArray:
    """Scale features (S, P, C) and flatten them to (S, P * C)."""
    return ((values - low) / span).reshape(len(values), values.shape[1] * values.shape[2])


def classify(
    vectors: FloatArray, examples: FloatArray, labels: Sequence[str]
) -> tuple[tuple[str, ...], FloatArray]:
    """Give every vector the label of its nearest example.

    Parameters
    ----------
    vectors : array, shape (S, F)
        Scaled features.
    examples : array, shape (N, F)
        Scaled features of the examples.
    labels : sequence of str, length N
        Their classes.

    Returns
    -------
    labels : tuple of str, length S
        Of equally near examples the first one counts.
    distances : array, shape (S,)
        Root mean square difference to the nearest example, in units of the scaled features: ranges
        after `fit_scale`, spreads after `fit_spread`.

    Raises
    ------
    RecognitionError
        If a feature is not a number.
    """
    if not np.isfinite(vectors).all():
        row = int(np.argmin(np.isfinite(vectors).all(axis=1)))
        raise RecognitionError(f"features of segment {row} must be finite, got NaN or infinity")
    if len(vectors) == 0:
        return (), np.empty(0)
    apart = rms_distances(vectors, examples)
    nearest_example = apart.argmin(axis=1)
    return tuple(labels[k] for k in nearest_example), apart.min(axis=1)
