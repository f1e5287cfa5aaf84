"""Smooth joint trajectories within the arm's limits, as fast as a small change of path allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from besman.exceptions import MappingError
from besman.robot.collision import distances
from besman.robot.limits import resample_trajectory
from besman.robot.model import Robot
from besman.stages.map.joint_spline import JointSpline, fit_spline
from besman.stages.map.needed_stretch import (
    COARSE_HZ,
    RESERVE,
    ChangeTolerance,
    FloatArray,
    needed_stretch,
    torque_stretch,
)
from besman.stages.map.path_change import shorten

_ROUNDING = 1e-10


@dataclass(frozen=True, eq=False)
class ScaledPath:
    """A joint trajectory within limits of position, velocity, acceleration and torque.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds from 0.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2: one quintic spline and its own derivatives.
    stretch : float
        Duration over the duration before, at least 1.
    """

    time: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    stretch: float


def scale_path(
    robot: Robot,
    time: FloatArray,
    positions: FloatArray,
    *,
    tolerance: ChangeTolerance = ChangeTolerance(),
    knot_spacing_s: float = 0.05,
    least_duration_s: float = 0.0,
) -> ScaledPath:
    """Smooth a path in joint space and bring it within the arm's limits at every time.

    Time is stretched evenly, as little as a change of the tool's path within the tolerance allows;
    the change is the smallest that does. Without need of either the path is smoothed alone.
    Velocities at start and end are those of the movement: it need not begin or end at rest.

    Torque limits are kept unless the arm's own weight exceeds them: no stretch helps then.

    Parameters
    ----------
    robot : Robot
    time : array, shape (T,)
        Seconds; T at least three.
    positions : array, shape (T, n)
        rad.
    tolerance : ChangeTolerance
    knot_spacing_s : float
        See `besman.stages.map.joint_spline.fit_spline`.
    least_duration_s : float
        Shorter movements are stretched to this duration, seconds.

    Returns
    -------
    ScaledPath
        Its stretch is never greater than plain stretching of the smoothed path needs, unless that
        exceeds a limit of position.
    """
    spline = fit_spline(time, positions, knot_spacing_s)
    least = max(1.0, least_duration_s / float(time[-1] - time[0]))
    inside = spline.inside(robot.limits)
    changeable = tolerance.position > 0 and tolerance.orientation > 0
    if not inside or (changeable and needed_stretch(robot, spline) > least):
        try:
            changed = shorten(robot, spline, positions, tolerance, least)
            if not inside or _may_replace(robot, changed, spline):
                spline = changed
        except MappingError:
            limits = robot.limits
            points = np.clip(spline.points, limits.position_min, limits.position_max)
            spline = spline.moved(points)
    return _stretched(robot, spline, least)


def _may_replace(robot: Robot, changed: JointSpline, spline: JointSpline) -> bool:
    """Whether a changed path is faster and brings no collision that was not there before."""
    if needed_stretch(robot, changed) >= needed_stretch(robot, spline):
        return False
    time = spline.times(COARSE_HZ)
    if np.min(distances(robot.chain, changed.at(time)[0])) > 0:
        return True
    return bool(np.min(distances(robot.chain, spline.at(time)[0])) <= 0)


def _stretched(robot: Robot, spline: JointSpline, least: float) -> ScaledPath:
    """Stretch time until the limits hold at 1 kHz."""
    positions, velocities, accelerations = spline.samples()
    stretch = max(least, needed_stretch(robot, spline))
    for _ in range(10):
        path = ScaledPath(
            time=spline.time * stretch,
            positions=positions,
            velocities=velocities / stretch,
            accelerations=accelerations / stretch**2,
            stretch=stretch,
        )
        _, *dense = resample_trajectory(
            path.time, path.positions, path.velocities, path.accelerations
        )
        limits = robot.limits
        speed = float(np.max(np.abs(dense[1]) / limits.velocity))
        pull = float(np.max(np.abs(dense[2]) / limits.acceleration))
        more = max(speed, float(np.sqrt(pull)), torque_stretch(robot, *dense))
        if more <= 1.0 + _ROUNDING:
            break
        stretch *= more * RESERVE
    return path
