"""Smooth joint trajectories within the arm's limits, as fast as a small change of path allows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError
from besman.mapping.joint_spline import JointSpline, fit_spline
from besman.robot.collision import distances
from besman.robot.dynamics import inverse_dynamics
from besman.robot.limits import resample
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

# The limits are met between the samples that are looked at, too.
_RESERVE = 1.002
_FINE_HZ = 4000.0
_COARSE_HZ = 1000.0
_ROUNDING = 1e-10
# Nearer to the limit than this share the arm's own weight leaves no torque to move.
_GREATEST_STATIC_SHARE = 0.999


@dataclass(frozen=True)
class ChangeTolerance:
    """How far the tool may leave its path so that time is stretched less.

    Attributes
    ----------
    position : float
        Metres.
    orientation : float
        Radians. If one of both is 0, only limits of position change the path.
    free_spin : bool
        The rotation about the tool's z axis does not matter.
    """

    position: float = 0.005
    orientation: float = float(np.radians(5.0))
    free_spin: bool = False


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
        See `besman.mapping.joint_spline.fit_spline`.
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
        # Not before: cvxpy takes longer to import than a path to scale.
        from besman.mapping.path_change import shorten

        try:
            changed = shorten(robot, spline, positions, tolerance, least)
            if not inside or _may_replace(robot, changed, spline):
                spline = changed
        except MappingError:
            limits = robot.limits
            points = np.clip(spline.points, limits.position_min, limits.position_max)
            spline = spline.moved(points)
    return _stretched(robot, spline, least)


def needed_stretch(robot: Robot, spline: JointSpline) -> float:
    """Find by how much time must be stretched evenly so that all limits but of position hold.

    A stretch s divides velocities by s, and accelerations and what torques exceed gravity's by
    s^2: the answer is exact for every sample, with a small reserve for the time between them.

    Parameters
    ----------
    robot : Robot
    spline : JointSpline

    Returns
    -------
    float
        Below 1 if there is room. Torques do not count where gravity alone exceeds their limits.
    """
    limits = robot.limits
    positions, velocities, accelerations = spline.at(spline.times(_FINE_HZ))
    speed = float(np.max(np.abs(velocities) / limits.velocity))
    pull = float(np.max(np.abs(accelerations) / limits.acceleration))
    # The control points say more where a spline is rough, the samples where it is smooth.
    hull_speed = float(np.max(np.abs(spline.velocity_points()) / limits.velocity))
    hull_pull = float(np.max(np.abs(spline.acceleration_points()) / limits.acceleration))
    every = max(1, round(_FINE_HZ / _COARSE_HZ))
    coarse = [values[::every] for values in (positions, velocities, accelerations)]
    return max(
        min(_RESERVE * speed, hull_speed),
        float(np.sqrt(min(_RESERVE**2 * pull, hull_pull))),
        _RESERVE * torque_stretch(robot, *coarse),
    )


def torque_stretch(
    robot: Robot, positions: FloatArray, velocities: FloatArray, accelerations: FloatArray
) -> float:
    """Find by how much time must be stretched evenly so that torque limits hold.

    The torque of a movement stretched by s is g(q) + (tau - g(q)) / s^2 with gravity's torque g.

    Parameters
    ----------
    robot : Robot
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.

    Returns
    -------
    float
        Smallest stretch, 0 if nothing moves. Samples at which gravity alone reaches a limit do not
        count.

    References
    ----------
    J. M. Hollerbach: Dynamic scaling of manipulator trajectories, 1984, section 3.
    doi:10.1115/1.3149652
    """
    limit = robot.limits.torque
    still = np.zeros_like(positions)
    gravity = inverse_dynamics(robot, positions, still, still)
    moving = inverse_dynamics(robot, positions, velocities, accelerations) - gravity
    room = limit - np.sign(moving) * gravity
    carried = np.abs(gravity) < _GREATEST_STATIC_SHARE * limit
    squares = np.abs(moving[carried]) / room[carried]
    return float(np.sqrt(squares.max(initial=0.0)))


def _may_replace(robot: Robot, changed: JointSpline, spline: JointSpline) -> bool:
    """Whether a changed path is faster and brings no collision that was not there before."""
    if needed_stretch(robot, changed) >= needed_stretch(robot, spline):
        return False
    time = spline.times(_COARSE_HZ)
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
        _, *dense = resample(path.time, path.positions, path.velocities, path.accelerations)
        limits = robot.limits
        speed = float(np.max(np.abs(dense[1]) / limits.velocity))
        pull = float(np.max(np.abs(dense[2]) / limits.acceleration))
        more = max(speed, float(np.sqrt(pull)), torque_stretch(robot, *dense))
        if more <= 1.0 + _ROUNDING:
            break
        stretch *= more * _RESERVE
    return path
