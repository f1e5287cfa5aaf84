"""Slopes in many coordinates at once: all of them change in every try."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def two_level_design(n: int) -> FloatArray:
    """Return the signs of n coordinates in an orthogonal array of two levels [1]_.

    A slope is told by all tries, so that it is as little blurred by roughness as if each coordinate
    alone had been tried as often as all are.

    Parameters
    ----------
    n : int

    Returns
    -------
    array, shape (T, n)
        -1 and 1; T is the power of two above n, at least 4.

    References
    ----------
    .. [1] R. L. Plackett, J. P. Burman: The design of optimum multifactorial experiments.
       Biometrika 33(4), 1946, DOI 10.1093/biomet/33.4.305.
    """
    from scipy.linalg import hadamard

    size = max(1 << n.bit_length(), 4)
    return np.asarray(hadamard(size)[:, 1 : n + 1], dtype=np.float64)


def fit_slopes(ways: FloatArray, values: FloatArray, ridge: float = 1e-3) -> FloatArray:
    """Return slopes (M, D) by least squares on values (T, M) at ways (T, D); NaN is left out."""
    slopes = np.zeros((values.shape[1], ways.shape[1]))
    for column, row in zip(values.T, slopes, strict=True):
        known = np.isfinite(column)
        if known.sum() < 2:
            continue
        apart = ways[known] - ways[known].mean(axis=0)
        system = apart.T @ apart + ridge * np.eye(ways.shape[1])
        row[:] = np.linalg.solve(system, apart.T @ (column[known] - column[known].mean()))
    return slopes
