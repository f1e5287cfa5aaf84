"""A configuration near one that is wanted, in which an arm touches nothing."""

from __future__ import annotations

import numpy as np

from besman.records import FloatArray
from besman.robot.branches import joint_box
from besman.robot.collision import distances
from besman.robot.model import Robot

_ROUNDS = 12
_PROBE_RAD, _LONGEST_RAD = 1e-4, 0.3
_BEYOND_M = 1e-3


def move_clear(robot: Robot, positions: FloatArray, clearance_m: float) -> FloatArray:
    """Move an arm a little away from itself, its pedestal and the floor.

    Newton steps along the gradient of the least distance, by differences; a step is the shortest
    that brings the distance to what is wanted, were it linear.

    Parameters
    ----------
    robot : Robot
    positions : array, shape (n,)
        What is wanted, rad.
    clearance_m : float
        Distance that is to be kept, metres.

    Returns
    -------
    array, shape (n,)
        Within the joints' ranges, rad; `positions` where they keep it. Of an arm that is deep in
        something the last try, which may not.
    """
    low, high = joint_box(robot)
    found = np.clip(positions, low, high)
    probes = _PROBE_RAD * np.eye(robot.n)
    for _ in range(_ROUNDS):
        rows = np.vstack([found, found + probes, found - probes])
        near = distances(robot.chain, rows).min(axis=1)
        lacks = clearance_m - near[0]
        # An arm without capsules is infinitely far from everything.
        if lacks <= 0.0 or not np.isfinite(near).all():
            break
        slope = (near[1 : robot.n + 1] - near[robot.n + 1 :]) / (2 * _PROBE_RAD)
        step = slope * (lacks + _BEYOND_M) / max(float(slope @ slope), 1e-9)
        length = float(np.linalg.norm(step))
        found = np.clip(found + step * min(1.0, _LONGEST_RAD / max(length, 1e-12)), low, high)
    return found
