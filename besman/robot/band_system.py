"""Linear equations whose matrix is a band about its diagonal."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]


@compiled
def solve_band(band: FloatArray, vector: FloatArray, width: int) -> None:
    """Solve a symmetric positive definite band system in place by Cholesky.

    Parameters
    ----------
    band : array, shape (N, width + 1)
        Row i holds the entries (i, i), (i, i - 1), ... (i, i - width); overwritten.
    vector : array, shape (N,)
        Right side; overwritten by the solution.
    width : int
        Number of lower diagonals.
    """
    size = len(vector)
    for i in range(size):
        for j in range(max(0, i - width), i + 1):
            total = band[i, i - j]
            for k in range(max(0, i - width), j):
                total -= band[i, i - k] * band[j, j - k]
            if i == j:
                band[i, 0] = np.sqrt(max(total, 1e-30))
            else:
                band[i, i - j] = total / band[j, 0]
        total = vector[i]
        for k in range(max(0, i - width), i):
            total -= band[i, i - k] * vector[k]
        vector[i] = total / band[i, 0]
    for i in range(size - 1, -1, -1):
        vector[i] /= band[i, 0]
        for k in range(max(0, i - width), i):
            vector[k] -= band[i, i - k] * vector[i]
