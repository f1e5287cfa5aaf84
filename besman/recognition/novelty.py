"""How far from all examples is too far: segments that are none of the known classes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

UNKNOWN = "unknown"
"""Label of a segment that is like no example."""

_QUANTILE = 0.95


def fit_threshold(examples: FloatArray, labels: Sequence[str], factor: float) -> float:
    """Find the distance beyond which a segment is of no known class.

    Every example is left out once, and its distance to the nearest other one of its class taken:
    so far apart are segments of one class. The threshold is the 95 % quantile of these distances
    times a factor, which covers people and places that are not among the examples. If no class has
    two examples, the nearest examples of different classes take their place: what is farther from
    all classes than they are from each other is like none of them.

    Parameters
    ----------
    examples : array, shape (N, F)
        Scaled features.
    labels : sequence of str, length N
        Their classes.
    factor : float
        Tolerance.

    Returns
    -------
    float
        In units of `distances`; infinite if there is a single example.
    """
    apart = distances(examples, examples)
    np.fill_diagonal(apart, np.inf)
    names = np.asarray(labels)
    same = names[:, np.newaxis] == names
    for wanted, tolerance in ((same, factor), (~same, 1.0)):
        nearest = np.where(wanted, apart, np.inf).min(axis=1)
        known = nearest[np.isfinite(nearest)]
        if len(known):
            return float(tolerance * np.quantile(known, _QUANTILE))
    return float("inf")


def measure_novelty(vectors: FloatArray, examples: FloatArray) -> FloatArray:
    """Return the distance of each vector to the nearest example of any class, shape (S,)."""
    if len(vectors) == 0:
        return np.empty(0)
    return np.asarray(distances(vectors, examples).min(axis=1))


def distances(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return root mean square differences between vectors, shape (len(a), len(b))."""
    from scipy.spatial.distance import cdist

    return np.asarray(cdist(a, b) / np.sqrt(a.shape[1]))
