"""What a joint trajectory asks of an arm: time stretch, interpolation and the check of limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.robot.collision import distances
from besman.robot.dynamics import inverse_dynamics
from besman.robot.model import Robot
from besman.robot.parts import JointLimits

FloatArray = npt.NDArray[np.float64]

# Rounding must not turn a trajectory at its limit into one beyond it.
_TOLERANCE = 1e-9
RATE_HZ = 1000.0
"""Samples a second in which trajectories are checked and exported."""


@dataclass(frozen=True)
class LimitReport:
    """What a joint trajectory violates.

    Attributes
    ----------
    samples : int
        How many were checked.
    position, velocity, acceleration : int
        Samples at which some joint exceeds the limit.
    self_collisions : int
        Samples at which the arm touches itself, its pedestal or the floor.
    position_excess, velocity_ratio, acceleration_ratio : float
        Greatest excess beyond a position limit (rad), greatest share of the other two.
    least_distance : float
        Metres to itself, its pedestal or the floor.
    torque : int
        Samples at which some joint's torque, by inverse dynamics, exceeds the limit.
    torque_ratio : float
        Greatest share of the torque limits.
    jerk : int
        Steps from sample to sample in which some joint's acceleration changes faster than allowed.
    jerk_ratio : float
        Greatest share of the jerk limits; 0 where the robot states none.
    """

    samples: int
    position: int
    velocity: int
    acceleration: int
    self_collisions: int
    position_excess: float
    velocity_ratio: float
    acceleration_ratio: float
    least_distance: float
    torque: int = 0
    torque_ratio: float = 0.0
    jerk: int = 0
    jerk_ratio: float = 0.0

    @property
    def violations(self) -> int:
        """Samples beyond a limit of position, velocity, acceleration or torque, each counted."""
        return self.position + self.velocity + self.acceleration + self.torque

    @property
    def kept(self) -> bool:
        """Whether the arm can take it: all limits, that of the jerk too, and no collision."""
        return not (self.violations or self.jerk or self.self_collisions)


def check_limits(
    robot: Robot, positions: FloatArray, velocities: FloatArray, accelerations: FloatArray
) -> LimitReport:
    """Check every sample of a joint trajectory.

    Parameters
    ----------
    robot : Robot
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2; sampled at 1 kHz, see `resample_trajectory`.

    Returns
    -------
    LimitReport
    """
    limits = robot.limits
    excess = np.maximum(limits.position_min - positions, positions - limits.position_max)
    speed = np.abs(velocities) / limits.velocity
    pull = np.abs(accelerations) / limits.acceleration
    shock = RATE_HZ * np.abs(np.diff(accelerations, axis=0)) / limits.jerk
    load = np.abs(inverse_dynamics(robot, positions, velocities, accelerations)) / limits.torque
    distance = distances(robot.chain, positions).min(axis=1)
    return LimitReport(
        samples=len(positions),
        # Written so that NaN is a violation.
        position=int(np.sum(~np.all(excess <= _TOLERANCE, axis=1))),
        velocity=int(np.sum(~np.all(speed <= 1.0 + _TOLERANCE, axis=1))),
        acceleration=int(np.sum(~np.all(pull <= 1.0 + _TOLERANCE, axis=1))),
        self_collisions=int(np.sum(~(distance > 0.0))),
        position_excess=float(max(np.max(excess), 0.0)),
        velocity_ratio=float(np.max(speed)),
        acceleration_ratio=float(np.max(pull)),
        least_distance=float(np.min(distance)),
        torque=int(np.sum(~np.all(load <= 1.0 + _TOLERANCE, axis=1))),
        torque_ratio=float(np.max(load)),
        jerk=int(np.sum(~np.all(shock <= 1.0 + _TOLERANCE, axis=1))),
        jerk_ratio=float(np.max(shock, initial=0.0)),
    )


def time_stretch(
    limits: JointLimits,
    velocities: FloatArray,
    accelerations: FloatArray,
    step_s: float | None = None,
) -> float:
    """Find by how much a movement must be slowed down evenly.

    Stretching time by s divides velocities by s, accelerations by s^2 and jerks by s^3.

    Parameters
    ----------
    limits : JointLimits
    velocities, accelerations : array, shape (..., n)
        rad/s, rad/s^2.
    step_s : float, optional
        Seconds between the accelerations, shape (T, n), if the jerk limits are to be kept too:
        the acceleration changes evenly from one to the next.

    Returns
    -------
    float
        Smallest stretch that meets the limits everywhere; below 1 if there is room.
    """
    speed = float(np.max(np.abs(velocities) / limits.velocity))
    pull = float(np.max(np.abs(accelerations) / limits.acceleration))
    least = max(speed, float(np.sqrt(pull)))
    if step_s is None or not np.isfinite(limits.jerk).any():
        return least
    shock = float(np.max(np.abs(np.diff(accelerations, axis=0)) / limits.jerk)) / step_s
    return max(least, float(np.cbrt(shock)))


def resample_trajectory(
    time: FloatArray,
    positions: FloatArray,
    velocities: FloatArray,
    accelerations: FloatArray,
    rate_hz: float = 1000.0,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Interpolate a joint trajectory by the quintic polynomials that its samples define.

    Twice continuously differentiable; exact where the trajectory is a spline of degree five or
    less with its knots at samples.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.
    rate_hz : float
        Samples per second of the result.

    Returns
    -------
    time : array, shape (R,)
        From the first to the last sample, seconds.
    positions, velocities, accelerations : array, shape (R, n)
    """
    count = int(np.floor((time[-1] - time[0]) * rate_hz + 1e-9)) + 1
    dense = np.minimum(time[0] + np.arange(count) / rate_hz, time[-1])
    if dense[-1] < time[-1] - 1e-9:
        dense = np.append(dense, time[-1])
    piece = np.clip(np.searchsorted(time, dense, side="right") - 1, 0, len(time) - 2)
    powers = _quintic_powers(np.diff(time)[:, None], positions, velocities, accelerations)
    c0, c1, c2, c3, c4, c5 = powers[:, piece]
    u = (dense - time[piece])[:, None]
    return (
        dense,
        c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5)))),
        c1 + u * (2 * c2 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5))),
        2 * c2 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5)),
    )


def _quintic_powers(
    step: FloatArray, positions: FloatArray, velocities: FloatArray, accelerations: FloatArray
) -> FloatArray:
    """Return the coefficients (6, T - 1, n) of the polynomials between samples, lowest power first.

    A quintic is given by value and two derivatives at both ends of its step (T - 1, 1) seconds.
    """
    start, v, a = positions[:-1], velocities[:-1], accelerations[:-1]
    # What the first three powers leave over at the end, in units of the step.
    way = positions[1:] - start - step * (v + step * a / 2)
    speed = step * (velocities[1:] - v - step * a)
    pull = step**2 * (accelerations[1:] - a)
    return np.stack(
        [
            start,
            v,
            a / 2,
            (10 * way - 4 * speed + pull / 2) / step**3,
            (-15 * way + 7 * speed - pull) / step**4,
            (6 * way - 3 * speed + pull / 2) / step**5,
        ]
    )
