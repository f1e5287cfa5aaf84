"""Mean and variance of the distances of trajectory fragments that are seen at one time."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# A pair of fragments is compared at no more instants than this, so that cost is linear in time.
_MAX_SAMPLES = 48
# Below so many pairs the compiler, which takes half a second and 100 MB, does not pay.
_FEW_PAIRS = 50_000
_PAIRS_AT_ONCE = 2048


def average_distances(
    first: IntArray,
    second: IntArray,
    start: IntArray,
    stop: IntArray,
    offset: IntArray,
    samples: FloatArray,
    step: int,
    stride: int,
) -> tuple[FloatArray, FloatArray]:
    """Average the distance of each pair of fragments over the frames that both are seen in.

    Parameters
    ----------
    first, second : int array, shape (E,)
        The fragments of each pair; they share a frame.
    start, stop, offset, samples, step
        As in `besman.stages.label.fragments.Fragments`.
    stride : int
        Frames between two compared instants.

    Returns
    -------
    mean, variance : array, shape (E,)
        Metres and metres squared.
    """
    function = _average_by_rows if len(first) < _FEW_PAIRS else compile_average()
    return function(first, second, start, stop, offset, samples, step, stride)


def _average_by_rows(
    first: IntArray,
    second: IntArray,
    start: IntArray,
    stop: IntArray,
    offset: IntArray,
    samples: FloatArray,
    step: int,
    stride: int,
) -> tuple[FloatArray, FloatArray]:
    """Add up one instant of many pairs at a time, in the order of `_average_plain`, compiled."""
    mean, variance = np.empty(len(first)), np.empty(len(first))
    for head in range(0, len(first), _PAIRS_AT_ONCE):
        pairs = slice(head, head + _PAIRS_AT_ONCE)
        i, j = first[pairs], second[pairs]
        begin = np.maximum(start[i], start[j])
        common = np.minimum(stop[i], stop[j]) - begin
        n = np.minimum(common, np.clip(common // stride, 4, _MAX_SAMPLES))
        row_i, row_j = (offset[k] + step * (begin - start[k]) for k in (i, j))
        total, squares = np.zeros(len(i)), np.zeros(len(i))
        for instant in range(int(n.max())):
            on = np.flatnonzero(instant < n)
            frame = step * ((2 * instant + 1) * common[on] // (2 * n[on]))
            steps = (samples[row_i[on] + frame] - samples[row_j[on] + frame]) ** 2
            square = steps[:, 0] + steps[:, 1] + steps[:, 2]
            squares[on] += square
            total[on] += np.sqrt(square)
        mean[pairs] = total / n
        variance[pairs] = np.maximum(squares / n - mean[pairs] ** 2, 0.0)
    return mean, variance


def _average_plain(
    first: IntArray,
    second: IntArray,
    start: IntArray,
    stop: IntArray,
    offset: IntArray,
    samples: FloatArray,
    step: int,
    stride: int,
) -> tuple[FloatArray, FloatArray]:
    """Return mean and variance of the distance of each pair; compiled below."""
    mean = np.empty(len(first))
    variance = np.empty(len(first))
    for pair in range(len(first)):
        i, j = first[pair], second[pair]
        begin = max(start[i], start[j])
        common = min(stop[i], stop[j]) - begin
        n = min(common, max(4, min(_MAX_SAMPLES, common // stride)))
        row_i = offset[i] + step * (begin - start[i])
        row_j = offset[j] + step * (begin - start[j])
        total = 0.0
        squares = 0.0
        for k in range(n):
            frame = step * ((2 * k + 1) * common // (2 * n))
            square = 0.0
            for axis in range(3):
                square += (samples[row_i + frame, axis] - samples[row_j + frame, axis]) ** 2
            squares += square
            total += square**0.5
        mean[pair] = total / n
        variance[pair] = max(squares / n - mean[pair] ** 2, 0.0)
    return mean, variance


@cache
def compile_average() -> Callable[..., tuple[FloatArray, FloatArray]]:
    """Compile the loop over pairs; numba is only loaded when it is needed.

    Returns
    -------
    callable
        As `average_distances`.
    """
    import numba

    compiled: Callable[..., tuple[FloatArray, FloatArray]] = numba.njit(cache=True)(_average_plain)
    return compiled
