"""The damped step of least norm that makes residuals small, without going where nothing changes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_TINY = 1e-12


def damped_step(
    rows: FloatArray,
    residuals: FloatArray,
    trust: FloatArray,
    damping: float,
    reach: float,
    floor: FloatArray,
) -> FloatArray:
    """Return the step of a linear model, damped after Levenberg and Marquardt.

    Parameters
    ----------
    rows : array, shape (M, D)
        Slopes of the residuals.
    residuals : array, shape (M,)
    trust : array, shape (D,)
        What each coordinate is scaled by before the step of least norm is sought.
    damping : float
        Of the normal equations, in squared residuals per squared unit.
    reach : float
        Greatest length.
    floor : array, shape (D,)
        The step goes no lower: a coordinate that would stops there, and the others make up for it.

    Returns
    -------
    array, shape (D,)
    """
    step, free = np.zeros(len(trust)), trust > 0
    while True:
        scaled = rows * np.where(free, trust, 0.0)
        left = residuals + rows[:, ~free] @ step[~free]
        system = scaled @ scaled.T + damping * np.eye(len(rows))
        step[free] = -trust[free] * (scaled.T @ np.linalg.solve(system, left))[free]
        step *= min(1.0, reach / max(float(np.linalg.norm(step)), _TINY))
        low = free & (step < floor)
        if not low.any():
            return step
        free &= ~low
        step[low] = floor[low]
