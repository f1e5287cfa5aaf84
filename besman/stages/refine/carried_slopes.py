"""Slopes of an outcome, carried from a motion to one in another posture of the arm.

An outcome comes of what the tool does: how it depends on that is the same in every posture. How the
tool depends on the joints is not, but known without a simulation. So a change of one motion stands
for that change of the other which moves the tool most like it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.geometry.frames import rotation_to_quaternion
from besman.geometry.quaternions import rotation_vector
from besman.motion.rollout import roll_out_plans
from besman.records import AnyPlan
from besman.robot.kinematics import forward_kinematics, jacobian
from besman.robot.model import Robot
from besman.stages.refine.plan_space import Space

FloatArray = npt.NDArray[np.float64]

# Shares of the movement at which the tool is looked at: the half in which things leave, or end.
_PLACES = np.linspace(0.5, 1.0, 26)
# What a metre of the tool's position, as much as a unit of these, counts: s, m, m s.
_OF_VELOCITY, _OF_ROTATION, _OF_TURNING = 0.5, 0.5, 0.05
# Differences to both sides, in units: as far as slopes of outcomes are measured.
_DIFFERENCE = 0.5
# Of the greatest singular value: what moves the tool less than that cannot be told apart.
_RIDGE = 0.05


def tool_slopes(
    space: Space, point: FloatArray, robot: Robot, coordinates: Sequence[int]
) -> FloatArray:
    """Return how the tool's movement depends on the coordinates of a search, without a simulation.

    Parameters
    ----------
    space : Space
        Of joint movements.
    point : array, shape (D,)
        Where.
    robot : Robot
    coordinates : sequence of int
        The others are left at 0.

    Returns
    -------
    array, shape (F, D)
        Of position, velocity, rotation and angular velocity in all places, weighed.
    """
    columns = np.zeros((len(point), 12 * len(_PLACES)))
    poses = _tool_at(space.plan_at(point), robot)[0]
    for at in coordinates:
        sides = []
        for side in (_DIFFERENCE, -_DIFFERENCE):
            moved = point.copy()
            moved[at] += side
            sides.append(_features(*_tool_at(space.plan_at(moved), robot), poses))
        columns[at] = (sides[0] - sides[1]) / (2 * _DIFFERENCE)
    return np.asarray(columns.T / np.sqrt(len(_PLACES)))


def _tool_at(plan: AnyPlan, robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Return poses (T, 4, 4) and twists (T, 6) of the tool at the places."""
    positions, velocities, _ = roll_out_plans([plan], _PLACES * plan.duration, robot)
    slopes = jacobian(robot.chain, positions[0])
    twists = np.einsum("tij,tj->ti", slopes, velocities[0])
    return forward_kinematics(robot.chain, positions[0]), twists


def _features(poses: FloatArray, twists: FloatArray, others: FloatArray) -> FloatArray:
    """Return what describes the tool's movement, shape (F,), turned from other poses."""
    turned = poses[:, :3, :3] @ np.swapaxes(others[:, :3, :3], 1, 2)
    parts = (
        poses[:, :3, 3],
        _OF_VELOCITY * twists[:, :3],
        _OF_ROTATION * rotation_vector(rotation_to_quaternion(turned)),
        _OF_TURNING * twists[:, 3:],
    )
    return np.concatenate(parts, axis=1).ravel()


def carry_slopes(slopes: FloatArray, there: FloatArray, here: FloatArray) -> FloatArray:
    """Return the slopes of outcomes at one motion by those at another.

    Parameters
    ----------
    slopes : array, shape (W, R, D)
        Of the outcomes there.
    there, here : array, shape (F, D)
        Of the tool's movement, see `tool_slopes`.

    Returns
    -------
    array, shape (W, R, D)
        Of the outcomes here.
    """
    ridge = (_RIDGE * np.linalg.norm(there, 2)) ** 2
    system = there.T @ there + ridge * np.eye(there.shape[1])
    return np.asarray(slopes @ np.linalg.solve(system, there.T @ here))
