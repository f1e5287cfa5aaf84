"""Dynamic time warping, compiled: two rows of the band, given up where another is nearer."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def squared_distance(
    first: FloatArray, second: FloatArray, band: int, enough: float
) -> float:  # pragma: no cover
    """Return the least sum of squared differences along a warping path within a band.

    Parameters
    ----------
    first, second : array, shape (P, C)
    band : int
        A point is compared with those at most so many before and after it (Sakoe-Chiba).
    enough : float
        Infinity is returned as soon as every path costs at least this.

    References
    ----------
    H. Sakoe, S. Chiba 1978, doi:10.1109/TASSP.1978.1163055
    """
    n, n_channels = first.shape
    # The cost up to the point before stands one place to the right; what was never reached is inf.
    before, row = np.full(n + 1, np.inf), np.full(n + 1, np.inf)
    before[0] = 0.0
    for i in range(n):
        low, high = max(0, i - band), min(n, i + band + 1)
        left, least = np.inf, np.inf
        row[low] = np.inf
        for j in range(low, high):
            apart = 0.0
            for c in range(n_channels):
                difference = first[i, c] - second[j, c]
                apart += difference * difference
            left = min(left, before[j], before[j + 1]) + apart
            row[j + 1] = left
            least = min(least, left)
        if least >= enough:
            return np.inf
        if high < n:
            row[high + 1] = np.inf
        before, row = row, before
    return float(before[n])


@njit(cache=True, nogil=True)
def nearest_warped(
    sequences: FloatArray, examples: FloatArray, band: int
) -> tuple[IntArray, FloatArray]:  # pragma: no cover
    """Find the nearest example of every sequence, the first of equals.

    Parameters
    ----------
    sequences : array, shape (S, P, C)
    examples : array, shape (N, P, C)
    band : int
        As of `squared_distance`.

    Returns
    -------
    index : int array, shape (S,)
    distance : array, shape (S,)
        Root of the least sum of squared differences.
    """
    index = np.zeros(len(sequences), dtype=np.int64)
    distance = np.empty(len(sequences))
    for s in range(len(sequences)):
        nearest = np.inf
        for e in range(len(examples)):
            apart = squared_distance(sequences[s], examples[e], band, nearest)
            if apart < nearest:
                nearest = apart
                index[s] = e
        distance[s] = np.sqrt(nearest)
    return index, distance
