"""How far from all examples is too far: segments that are none of the known classes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

UNKNOWN = "unknown"
"""Label of a segment that is like no example."""

# Chosen on synthetic captures and one subject of the real recordings (benchmarks/README.md).
_KEPT, _OUTSIDE, _TOWARDS_OUTSIDE = 0.95, 0.25, 0.7
_FEW, _ALONE = 0.5, 2.0
# Of more distances than this, to load SciPy takes less time than to do without.
_MANY = 100_000


def fit_threshold(examples: FloatArray, labels: Sequence[str], factor: float = 1.0) -> float:
    """Find the distance to the nearest example beyond which a segment is of no known class.

    The examples themselves say how far that is. Each is left out once: its distance to the nearest
    of all others is what a segment of a known class would get. Each class is left out once: the
    distance of its examples to those of all other classes is what a segment of an unknown class
    would get. The threshold lies between the 95 % quantile of the former and the lower quartile of
    the latter, 0.7 of the way on a logarithmic scale; where the two overlap, it is the 95 %
    quantile, so that known segments are kept.

    Parameters
    ----------
    examples : array, shape (N, F)
        Scaled features.
    labels : sequence of str, length N
        Their classes.
    factor : float
        What the threshold is multiplied by.

    Returns
    -------
    float
        In units of `rms_distances`. With a single example of each class it is the median distance
        between classes; with a single class, twice the 95 % quantile; with a single example,
        infinite.
    """
    apart = rms_distances(examples, examples)
    np.fill_diagonal(apart, np.inf)
    names = np.asarray(labels)
    same = names[:, np.newaxis] == names
    outside = np.where(same, np.inf, apart).min(axis=1)
    known = apart.min(axis=1)[same.sum(axis=1) > 1]
    several = bool(np.isfinite(outside).all())
    if len(known) == 0:
        return factor * float(np.quantile(outside, _FEW)) if several else float("inf")
    near = float(np.quantile(known, _KEPT))
    if not several:
        return factor * _ALONE * near
    far = max(near, float(np.quantile(outside, _OUTSIDE)))
    # Examples that are all alike leave no scale but that of what is outside.
    near = max(near, 1e-3 * far)
    threshold: float = factor * near ** (1.0 - _TOWARDS_OUTSIDE) * far**_TOWARDS_OUTSIDE
    return threshold


def measure_novelty(vectors: FloatArray, examples: FloatArray) -> FloatArray:
    """Return the distance of each vector to the nearest example of any class, shape (S,)."""
    if len(vectors) == 0:
        return np.empty(0)
    return np.asarray(rms_distances(vectors, examples).min(axis=1))


def rms_distances(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return root mean square differences between vectors, shape (len(a), len(b))."""
    if len(a) * len(b) > _MANY:
        from scipy.spatial.distance import cdist

        return np.asarray(cdist(a, b) / np.sqrt(a.shape[1]))
    # The same to the last digit.
    squares = np.zeros((len(a), len(b)))
    for one, other in zip(a.T, b.T, strict=True):
        squares += np.square(one[:, np.newaxis] - other)
    return np.asarray(np.sqrt(squares) / np.sqrt(a.shape[1]))
