"""The recursion of the low-pass filter, compiled."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


@numba.njit(cache=True, nogil=True)
def filter_columns(
    values: FloatArray, ahead: FloatArray, back: FloatArray, states: FloatArray
) -> FloatArray:  # pragma: no cover
    """Filter columns (T, K), in the transposed direct form II from its states (2, K) on."""
    found = np.empty_like(values)
    for column in range(values.shape[1]):
        first, second = states[0, column], states[1, column]
        for row in range(len(values)):
            value = values[row, column]
            new = ahead[0] * value + first
            first = ahead[1] * value - back[1] * new + second
            second = ahead[2] * value - back[2] * new
            found[row, column] = new
    return found
