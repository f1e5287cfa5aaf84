"""How far from all examples is too far: segments that are none of the known classes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

UNKNOWN = "unknown"
"""Label of a segment that is like no example."""

_WITHIN, _BETWEEN = 0.95, 0.5


def fit_threshold(examples: FloatArray, labels: Sequence[str], factor: float) -> float:
    """Find the distance beyond which a segment is of no known class.

    Every example is left out once. Its distance to the nearest other example of its class tells how
    far apart segments of one class are, that to the nearest example of another class how far apart
    classes are. A segment is unknown if it is farther from all examples than `factor` times the
    95 % quantile of the former, and than the median of the latter. The second bound matters for
    few examples: of two throws of one person the distance is no measure for a third.

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
    within = np.where(same, apart, np.inf).min(axis=1)
    between = np.where(same, np.inf, apart).min(axis=1)
    bounds = [
        tolerance * float(np.quantile(nearest[np.isfinite(nearest)], quantile))
        for nearest, tolerance, quantile in ((within, factor, _WITHIN), (between, 1.0, _BETWEEN))
        if np.isfinite(nearest).any()
    ]
    return max(bounds, default=float("inf"))


def measure_novelty(vectors: FloatArray, examples: FloatArray) -> FloatArray:
    """Return the distance of each vector to the nearest example of any class, shape (S,)."""
    if len(vectors) == 0:
        return np.empty(0)
    return np.asarray(distances(vectors, examples).min(axis=1))


def distances(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return root mean square differences between vectors, shape (len(a), len(b))."""
    from scipy.spatial.distance import cdist

    return np.asarray(cdist(a, b) / np.sqrt(a.shape[1]))
