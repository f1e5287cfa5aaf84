"""Straight up with what is held: the arm's movement after a grasp."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from besman.robot.ik_kernel import follow_paths
from besman.robot.inverse_kinematics import IkWeights, joint_box
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import time_stretch
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

_N_HEIGHTS = 9
_ROUNDS, _TOLERANCE = 60, 1e-10
_GREATEST_ERROR_M, _GREATEST_ERROR_RAD = 0.005, 0.05
# A movement is looked at in 51 places; between them it can be this much faster.
_N_PLACES, _MARGIN = 51, 1.02


def plan_lift(
    robot: Robot, joints: FloatArray, height: float, duration: float
) -> tuple[CubicSpline, float] | None:
    """Plan to raise the tool without turning it.

    Parameters
    ----------
    robot : Robot
        The arm with its tool.
    joints : array, shape (n,)
        Where it begins, rad.
    height : float
        Metres.
    duration : float
        Seconds; longer if the arm's limits require it.

    Returns
    -------
    path : CubicSpline
        Joint angles (n,) over the share of the way, 0 to 1.
    duration : float
        Seconds.

    None if the arm cannot reach that high.
    """
    share = np.linspace(0.0, 1.0, _N_HEIGHTS)
    poses = np.repeat(forward_kinematics(robot.chain, joints)[None], _N_HEIGHTS, axis=0)
    poses[:, 2, 3] += height * share
    chain = robot.chain
    low, high = joint_box(robot)
    found, errors = follow_paths(
        chain.placements,
        chain.axes,
        chain.tip,
        low,
        high,
        joints,
        IkWeights().as_array(),
        False,
        poses[None],
        joints[None],
        0,
        _ROUNDS,
        _TOLERANCE,
    )
    if (errors[0, 0] > [_GREATEST_ERROR_M, _GREATEST_ERROR_RAD]).any():
        return None
    steps = np.concatenate([joints[None], found[0, 0, 1:]])
    path = CubicSpline(share, steps, bc_type="natural")
    _, velocities, accelerations = move_along(path, 1.0, np.linspace(0.0, 1.0, _N_PLACES))
    least = _MARGIN * time_stretch(robot.limits, velocities, accelerations)
    return path, max(duration, least)


def move_along(
    path: CubicSpline, duration: float, time: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Follow a path with least jerk, from rest to rest.

    Parameters
    ----------
    path : CubicSpline
        Joint angles over the share of the way.
    duration : float
        Seconds.
    time : array, shape (T,)
        Seconds since the start; the arm rests outside of it.

    Returns
    -------
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.
    """
    x = np.clip(np.asarray(time) / duration, 0.0, 1.0)[:, None]
    share = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    speed = 30.0 * x**2 * (1.0 - x) ** 2 / duration
    gain = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / duration**2
    slope, bend = path(share[:, 0], 1), path(share[:, 0], 2)
    return path(share[:, 0]), slope * speed, slope * gain + bend * speed**2
