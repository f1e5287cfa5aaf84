"""The capsule of least volume along some axes, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]

# Radii that are tried, in those of the smallest circle.
_WIDER = (1.0, 1.03, 1.07, 1.12, 1.2)


@compiled
def fit_along(points: FloatArray, axes: FloatArray, ends: FloatArray) -> float:
    """Write the ends of the capsule of least volume along one of some axes; return its radius.

    The smallest circle around the projection is found by steps towards the farthest point [1]_.

    References
    ----------
    .. [1] M. Badoiu and K. L. Clarkson: Smaller core-sets for balls, SODA 2003.
    """
    count, least, best = len(points), np.inf, 0.0
    x, y, z, square = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    side, across = np.empty(3), np.empty(3)
    for index in range(len(axes)):
        axis = axes[index]
        _fill_sides(axis, side, across)
        for k in range(count):
            p = points[k]
            x[k] = p[0] * side[0] + p[1] * side[1] + p[2] * side[2]
            y[k] = p[0] * across[0] + p[1] * across[1] + p[2] * across[2]
            z[k] = p[0] * axis[0] + p[1] * axis[1] + p[2] * axis[2]
        right, up = (x.min() + x.max()) / 2, (y.min() + y.max()) / 2
        for step in range(2, 200):
            far, farthest = -1.0, 0
            for k in range(count):
                away = (x[k] - right) ** 2 + (y[k] - up) ** 2
                if away > far:
                    far, farthest = away, k
            right += (x[farthest] - right) / step**1.5
            up += (y[farthest] - up) / step**1.5
        for k in range(count):
            square[k] = (x[k] - right) ** 2 + (y[k] - up) ** 2
        circle = np.sqrt(square.max())
        for share in _WIDER:
            radius, low, high = circle * share, np.inf, -np.inf
            for k in range(count):
                rest = np.sqrt(max(radius * radius - square[k], 0.0))
                low, high = min(low, z[k] + rest), max(high, z[k] - rest)
            if low > high:
                low = high = (low + high) / 2
            volume = np.pi * radius**2 * (high - low + 4 / 3 * radius)
            if volume < least:
                least, best = volume, radius
                for row in range(3):
                    middle = right * side[row] + up * across[row]
                    ends[0, row], ends[1, row] = middle + low * axis[row], middle + high * axis[row]
    return best


@compiled
def _fill_sides(axis: FloatArray, side: FloatArray, across: FloatArray) -> None:
    """Write two unit vectors at right angles to an axis and to each other."""
    if abs(axis[0]) < 0.6:
        side[0], side[1], side[2] = 0.0, axis[2], -axis[1]
    else:
        side[0], side[1], side[2] = -axis[2], 0.0, axis[0]
    length = np.sqrt(side[0] ** 2 + side[1] ** 2 + side[2] ** 2)
    for row in range(3):
        side[row] /= length
    across[0] = axis[1] * side[2] - axis[2] * side[1]
    across[1] = axis[2] * side[0] - axis[0] * side[2]
    across[2] = axis[0] * side[1] - axis[1] * side[0]
