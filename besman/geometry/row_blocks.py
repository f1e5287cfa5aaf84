"""What is computed of each row alone, a block of rows at a time: temporary arrays stay small."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

_ROWS = 2**15


def by_rows(
    function: Callable[..., npt.NDArray[Any]], *arrays: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Apply a function to blocks of rows and put its results together.

    Parameters
    ----------
    function : callable
        Takes as many arrays; returns one with a row for each of theirs that depends on no other
        row, so that blocks give the bits of the whole.
    arrays : arrays, shape (T, ...)

    Returns
    -------
    array, shape (T, ...)
    """
    n_rows = len(arrays[0])
    if n_rows <= _ROWS:
        return function(*arrays)
    found: npt.NDArray[Any] | None = None
    for start in range(0, n_rows, _ROWS):
        rows = slice(start, start + _ROWS)
        some = function(*(array[rows] for array in arrays))
        if found is None:
            found = np.empty((n_rows, *some.shape[1:]), some.dtype)
        found[rows] = some
    assert found is not None
    return found


def measure_apart(one: npt.NDArray[np.float64], two: npt.NDArray[np.float64]) -> Any:
    """Return how far two markers, (T, 3), are from each other in every frame, shape (T,)."""
    return by_rows(lambda a, b: np.linalg.norm(a - b, axis=1), one, two)
