"""What speeds, accelerations and jumps of a path cost, and their share of the normal equations."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]

# In metres of pose error: a speed at its limit, an acceleration at its limit, one unit of speed or
# acceleration beyond what the movement needs.
_SPEED_M = 1e-4
_PULL_M = 1e-4
_RUSH_M = 0.02
_JERK_M = 1e-3


@compiled
def time_cost(angles: FloatArray, scales: FloatArray, rush: FloatArray) -> float:
    """Sum the squares of speeds, accelerations and jumps."""
    n_poses, n = angles.shape
    total = 0.0
    for index in range(1, n_poses):
        for j in range(n):
            speed = (angles[index, j] - angles[index - 1, j]) * scales[0, j]
            total += (_SPEED_M * speed) ** 2 + (_RUSH_M * max(0.0, abs(speed) - rush[0])) ** 2
            if index > 1:
                pull = angles[index, j] - 2.0 * angles[index - 1, j] + angles[index - 2, j]
                pull *= scales[1, j]
                total += (_PULL_M * pull) ** 2 + (_JERK_M * max(0.0, abs(pull) - rush[1])) ** 2
    return total


@compiled
def add_time(
    angles: FloatArray, scales: FloatArray, rush: FloatArray, band: FloatArray, downhill: FloatArray
) -> None:
    """Add speeds, accelerations and jumps to the normal equations; row and lower diagonal."""
    n_poses, n = angles.shape
    for index in range(1, n_poses):
        for j in range(n):
            here, last = index * n + j, (index - 1) * n + j
            speed = (angles[index, j] - angles[index - 1, j]) * scales[0, j]
            weight, pulled = _SPEED_M**2, _SPEED_M**2 * speed
            if abs(speed) > rush[0]:
                weight += _RUSH_M**2
                pulled += _RUSH_M**2 * (speed - np.sign(speed) * rush[0])
            weight, pulled = weight * scales[0, j] ** 2, pulled * scales[0, j]
            band[here, 0] += weight
            band[last, 0] += weight
            band[here, n] -= weight
            downhill[here] -= pulled
            downhill[last] += pulled
            if index > 1:
                first = last - n
                pull = angles[index, j] - 2.0 * angles[index - 1, j] + angles[index - 2, j]
                pull *= scales[1, j]
                weight, pulled = _PULL_M**2, _PULL_M**2 * pull
                if abs(pull) > rush[1]:
                    weight += _JERK_M**2
                    pulled += _JERK_M**2 * (pull - np.sign(pull) * rush[1])
                weight, pulled = weight * scales[1, j] ** 2, pulled * scales[1, j]
                band[here, 0] += weight
                band[last, 0] += 4.0 * weight
                band[first, 0] += weight
                band[here, n] -= 2.0 * weight
                band[last, n] -= 2.0 * weight
                band[here, 2 * n] += weight
                downhill[here] -= pulled
                downhill[last] += 2.0 * pulled
                downhill[first] -= pulled
