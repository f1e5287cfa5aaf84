"""The plain tracker to compare with: per-frame Hungarian assignment with constant velocity."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def track_frames(
    positions: FloatArray, first_positions: FloatArray, first_frame: int = 0, gate_m: float = 0.2
) -> IntArray:
    """Name the points of each frame by where the markers are expected.

    A marker that was seen in the last two frames is expected to keep its velocity, a marker that
    is hidden is expected where it was seen last. The start is given, correctly named.

    Parameters
    ----------
    positions : array, shape (T, C, 3)
        Unnamed points, NaN where none, metres.
    first_positions : array, shape (M, 3)
        True positions of the markers at `first_frame`, metres.
    first_frame : int
        Where tracking begins.
    gate_m : float
        A point farther than this from its marker's expectation is not taken.

    Returns
    -------
    int array, shape (T, C)
        Marker of each point, -1 for none.
    """
    named = np.full(positions.shape[:2], -1, dtype=np.int64)
    # A marker that the start does not show cannot be found.
    last = np.where(np.isfinite(first_positions), first_positions, 1e6)
    velocity = np.zeros_like(last)
    for frame in range(first_frame, len(positions)):
        points = np.flatnonzero(np.isfinite(positions[frame, :, 0]))
        cost = np.linalg.norm((last + velocity)[:, None] - positions[frame, points][None], axis=2)
        markers, chosen = linear_sum_assignment(np.minimum(cost, gate_m))
        taken = cost[markers, chosen] < gate_m
        markers, chosen = markers[taken], points[chosen[taken]]
        named[frame, chosen] = markers
        seen = positions[frame, chosen]
        step = np.zeros_like(last)
        step[markers] = seen - last[markers]
        velocity = step
        last = last.copy()
        last[markers] = seen
    return named
