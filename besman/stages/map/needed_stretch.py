"""How much slower a joint path must be for an arm's limits of speed, acceleration and torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.robot.dynamics import inverse_dynamics
from besman.robot.model import Robot
from besman.stages.map.joint_spline import JointSpline

FloatArray = npt.NDArray[np.float64]


# The limits are met between the samples that are looked at, too.
RESERVE = 1.002


_FINE_HZ = 4000.0


COARSE_HZ = 1000.0


# Nearer to the limit than this share the arm's own weight leaves no torque to move.
_GREATEST_STATIC_SHARE = 0.999
# What exceeds a limit by more will not be mended by a small change of the path.
_HOPELESS_SHARE = 1.02


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
    time = spline.times(_FINE_HZ)
    velocities, accelerations = spline.rates_at(time)
    speed = float(np.max(np.abs(velocities) / limits.velocity))
    pull = float(np.max(np.abs(accelerations) / limits.acceleration))
    # The control points say more where a spline is rough, the samples where it is smooth.
    hull_speed = float(np.max(np.abs(spline.velocity_points()) / limits.velocity))
    hull_pull = float(np.max(np.abs(spline.acceleration_points()) / limits.acceleration))
    every = max(1, round(_FINE_HZ / COARSE_HZ))
    coarse = spline.positions_at(time[::every]), velocities[::every], accelerations[::every]
    return max(
        min(RESERVE * speed, hull_speed),
        float(np.sqrt(min(RESERVE**2 * pull, hull_pull))),
        RESERVE * torque_stretch(robot, *coarse),
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
        count; 0 where no stretch beyond 1 helps, as a limit is exceeded both in motion and at rest.

    References
    ----------
    J. M. Hollerbach: Dynamic scaling of manipulator trajectories, 1984, section 3.
    doi:10.1115/1.3149652
    """
    limit = robot.limits.torque
    still = np.zeros_like(positions)
    gravity = inverse_dynamics(robot, positions, still, still)
    torques = inverse_dynamics(robot, positions, velocities, accelerations)
    if np.any(np.minimum(torques * np.sign(gravity), np.abs(gravity)) > _HOPELESS_SHARE * limit):
        return 0.0
    moving = torques - gravity
    room = limit - np.sign(moving) * gravity
    carried = np.abs(gravity) < _GREATEST_STATIC_SHARE * limit
    squares = np.abs(moving[carried]) / room[carried]
    return float(np.sqrt(squares.max(initial=0.0)))
