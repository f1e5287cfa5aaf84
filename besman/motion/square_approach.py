"""An approach that comes straight and square to what a gripper takes.

A person's hand closes around a thing from the side while it is still moving. Fingers on rails, open
by little more than the thing is wide, push it over on that way: they have to come to it along the
direction in which they reach, as where whole tasks are brought to grippers, see
`besman.motion.grasp_goals`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from besman.geometry.frames import quaternion_to_rotation, rotation_to_quaternion
from besman.geometry.quaternions import conjugate, from_rotation_vector, multiply, rotation_vector
from besman.motion.dmp_fit import fit_weights
from besman.motion.rollout import roll_out_plans
from besman.records import AnyPlan, MotionPlan
from besman.robot.branches import IkWeights, follow_all
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

# Poses of a path that are followed, and samples that weights are fitted to.
_N_POSES, _N_SAMPLES = 101, 1001
# From this much farther away than the straight way it begins to bend; from there on the whole way
# is moved to where the goal is.
_BEND_M, _MOVED_M = 0.25, 0.5
# How far the arm may be beside the way, and what is no other goal; metres and radians.
_MISS, _SAME = 2e-3, 1e-4
_ROUNDS, _TOLERANCE = 60, 1e-12
# Home only settles what a pose leaves open.
_WEIGHTS = IkWeights(home=1e-5)


def square_approach(
    plan: AnyPlan, robot: Robot, position: FloatArray, rotation: FloatArray, straight_m: float
) -> AnyPlan:
    """Bring the end of a movement to a pose, straight along that pose's z axis.

    What is far from the end stays as it was shown.

    Parameters
    ----------
    plan : MotionPlan or CartesianPlan
        At rest at its end. Of other kinds than ``joint_dmp`` none is changed.
    robot : Robot
        With the gripper.
    position : array, shape (3,)
        Where the tool's centre point is to end, in the robot's world, metres.
    rotation : array, shape (3, 3)
        The tool there: z points to where it comes.
    straight_m : float
        Length of the straight way.

    Returns
    -------
    MotionPlan or CartesianPlan
        The same one if it ends there already, or the arm cannot follow such a way within its range.
        No limits of speed are kept.
    """
    if not isinstance(plan, MotionPlan) or plan.kind != "joint_dmp":
        return plan
    time = np.linspace(0.0, plan.duration, _N_POSES)
    shown = forward_kinematics(robot.chain, roll_out_plans([plan], time)[0][0])
    turn = rotation_vector(
        multiply(
            rotation_to_quaternion(rotation[None])[0],
            conjugate(rotation_to_quaternion(shown[-1:, :3, :3])[0]),
        )
    )
    moved = position - shown[-1, :3, 3]
    if np.linalg.norm(moved) < _SAME and np.linalg.norm(turn) < _SAME:
        return plan
    poses = _straighten(shown, moved, turn, rotation, straight_m)
    goals = _on_the_way(shown[-1], moved, turn)
    joints = _follow(robot, goals, plan.goal, 0)[-1]
    path = _follow(robot, poses, joints, _N_POSES - 1)
    beside = np.abs(forward_kinematics(robot.chain, path) - poses).max(axis=(1, 2))
    # On the way there a joint may be at its limit.
    straight = np.linalg.norm(poses[:, :3, 3] - position, axis=1) <= straight_m
    if beside[straight].max() > _MISS:
        return plan
    smooth = np.linspace(0.0, plan.duration, _N_SAMPLES)
    positions = CubicSpline(time, path, bc_type="clamped")(smooth)
    weights = fit_weights(smooth, positions, plan.weights.shape[1])
    return replace(plan, weights=weights, start=positions[0], goal=positions[-1])


def _straighten(
    shown: FloatArray, moved: FloatArray, turn: FloatArray, rotation: FloatArray, straight_m: float
) -> FloatArray:
    """Return the poses (T, 4, 4) of a way whose last part is straight."""
    left = shown[:, :3, 3] - shown[-1, :3, 3]
    distance = np.linalg.norm(left, axis=1)
    far = _rise((distance - straight_m) / _BEND_M)[:, None]
    # Behind the goal, as far from it as on the way that was shown.
    behind = -distance[:, None] * rotation[:, 2]
    poses = shown.copy()
    poses[:, :3, 3] = shown[-1, :3, 3] + far * left + (1.0 - far) * behind
    whole = max(float(distance[0]), _SAME)
    near = _rise(1.0 - distance / min(_MOVED_M, whole))[:, None]
    poses[:, :3, 3] += near * moved
    # Turned in the second half of the way.
    share = _rise(2.0 * (1.0 - distance / whole))[:, None]
    poses[:, :3, :3] = quaternion_to_rotation(from_rotation_vector(share * turn)) @ poses[:, :3, :3]
    return poses


def _on_the_way(start: FloatArray, moved: FloatArray, turn: FloatArray) -> FloatArray:
    """Return the poses (T, 4, 4) from one to the one that it is moved and turned to."""
    share = np.linspace(0.0, 1.0, _N_POSES)[:, None]
    poses = np.tile(start, (_N_POSES, 1, 1))
    poses[:, :3, 3] += share * moved
    poses[:, :3, :3] = quaternion_to_rotation(from_rotation_vector(share * turn)) @ start[:3, :3]
    return poses


def _follow(robot: Robot, poses: FloatArray, joints: FloatArray, anchor: int) -> FloatArray:
    """Return the joints (T, n) at poses (T, 4, 4), from those at one of them on."""
    found, _ = follow_all(
        robot, poses[None], np.array(joints)[None], anchor, _WEIGHTS, False,
        rounds=_ROUNDS, tolerance=_TOLERANCE,
    )  # fmt: skip
    return np.asarray(found[0, 0])


def _rise(share: FloatArray) -> FloatArray:
    """Rise from 0 to 1 where the share does, without jumps of acceleration."""
    x = np.clip(share, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))
