"""A whole task for other places of its objects, within the limits of its arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.exceptions import OutOfReachError, PlanError, nearest
from besman.geometry.frames import quaternion_to_rotation
from besman.motion.task_rollout import sample_task, stretch_task
from besman.motion.velocity_dmp import split_shape
from besman.records import BlockPlan, TaskPlan
from besman.robot.ik_kernel import follow_paths
from besman.robot.inverse_kinematics import IkWeights, joint_box
from besman.robot.limits import check_limits, time_stretch
from besman.robot.model import Robot
from besman.robot.parts import JointLimits

FloatArray = npt.NDArray[np.float64]

MISS_M, MISS_RAD = 0.005, 0.05
"""How far off a goal that is within reach is at most."""

# A goal is brought to its new place in steps, so that the arm stays on its branch.
_N_STEPS = 33
_ROUNDS, _TOLERANCE = 60, 1e-12
_MARGIN = 1.0 + 1e-3
# Between the places that are looked at a movement can be beyond its range by a hair.
_RESERVE = 1e-3
# Torque falls with the square of the stretch, but for weight.
_SLOWER, _SLOWEST = 1.05, 2.0


def move_task(
    plan: TaskPlan,
    robot: Robot,
    objects: Mapping[str, npt.ArrayLike] | None = None,
    targets: Mapping[str, npt.ArrayLike] | None = None,
) -> TaskPlan:
    """Give the objects of a task other places to be taken from and to be put to.

    Goals that are relative to an object, or to where it is put, move with it; blocks begin where
    the one before ends, and keep their shape, velocities at their ends, and duration unless the
    arm's limits ask for more.

    Parameters
    ----------
    plan : TaskPlan
    robot : Robot
        The plan's arm with its tool.
    objects, targets : mapping of str to array, shape (7,), optional
        Where objects stand before and after, in the robot's world frame: position (m) and
        quaternion wxyz. Those that are not named stay where they are.

    Raises
    ------
    PlanError
        If there is no such object, a block's goal is out of reach, or the arm cannot keep its
        limits: it names the block.
    """
    poses = {
        "object": _moved(plan, plan.object_poses, objects or {}),
        "target": _moved(plan, plan.target_poses, targets or {}),
    }
    blocks: list[BlockPlan] = []
    for block in plan.blocks:
        start = blocks[-1].goal if blocks else block.start
        goal = block.goal
        if block.frame != "world":
            before = plan.object_poses if block.frame == "object" else plan.target_poses
            row = plan.objects.index(block.thing)
            goal = _move_goal(plan, robot, block, before[row], poses[block.frame][row])
        blocks.append(replace(block, start=start, goal=goal))
    moved = replace(
        plan,
        blocks=tuple(blocks),
        object_poses=poses["object"],
        target_poses=poses["target"],
    )
    return keep_task_limits(moved, robot)


def _moved(plan: TaskPlan, poses: FloatArray, changes: Mapping[str, npt.ArrayLike]) -> FloatArray:
    """Return the poses of all objects, some of them changed."""
    moved = np.array(poses)
    for name, values in changes.items():
        if name not in plan.objects:
            raise PlanError(f"{plan.name}: no object {name!r}; {nearest(name, plan.objects)}")
        pose = np.asarray(values, dtype=np.float64)
        if pose.shape != (7,) or not np.isfinite(pose).all() or not np.any(pose[3:]):
            raise PlanError(
                f"{plan.name}: {name}: a pose must be finite, shape (7,): position (m) and "
                f"quaternion wxyz; got {pose.tolist()}"
            )
        moved[plan.objects.index(name)] = pose
        moved[plan.objects.index(name), 3:] /= np.linalg.norm(pose[3:])
    return moved


def _move_goal(
    plan: TaskPlan, robot: Robot, block: BlockPlan, before: FloatArray, after: FloatArray
) -> FloatArray:
    """Return the joints at the goal of a block whose frame moves, shape (n,)."""
    if np.array_equal(before, after):
        return block.goal
    shares = np.linspace(0.0, 1.0, _N_STEPS)[:, np.newaxis]
    # Quaternions of one hemisphere, so that the frame turns the short way.
    turned = after[3:] * (1.0 if before[3:] @ after[3:] >= 0 else -1.0)
    ways = (1 - shares) * before + shares * np.concatenate([after[:3], turned])
    ways[:, 3:] /= np.linalg.norm(ways[:, 3:], axis=1, keepdims=True)
    poses = np.stack([frame_matrix(way) @ frame_matrix(block.goal_pose) for way in ways])
    return follow_goal(plan.name, robot, block, poses)


def follow_goal(name: str, robot: Robot, block: BlockPlan, poses: FloatArray) -> FloatArray:
    """Return the joints at the goal of a block that is brought to another place, shape (n,).

    Parameters
    ----------
    name : str
        Of the plan, for the message.
    robot : Robot
    block : BlockPlan
    poses : array, shape (N, 4, 4)
        From where its goal is to where it is to be, in small steps, metres in the robot's world.

    Raises
    ------
    OutOfReachError
        If that is out of reach.
    """
    chain = robot.chain
    low, high = joint_box(robot)
    found, errors = follow_paths(
        chain.placements,
        chain.axes,
        chain.tip,
        low,
        high,
        np.array(block.goal),
        IkWeights().as_array(),
        False,
        poses[None],
        np.array(block.goal)[None],
        0,
        _ROUNDS,
        _TOLERANCE,
    )
    miss_m, miss_rad = errors[0, 0, -1]
    if miss_m > MISS_M or miss_rad > MISS_RAD:
        raise too_far(name, block.label, block.frame, block.thing, robot.name, (miss_m, miss_rad))
    return np.asarray(found[0, 0, -1])


def too_far(
    name: str, label: str, frame: str, thing: str, robot: str, miss: tuple[float, float]
) -> OutOfReachError:
    """Return the error of a block's goal that is missed by so many metres and radians."""
    return OutOfReachError(
        f"{name}: {label}: its goal at the {frame} {thing!r} is out of reach of {robot} by "
        f"{1e3 * miss[0]:.0f} mm and {np.degrees(miss[1]):.0f} degrees",
        label,
    )


def frame_matrix(pose: npt.ArrayLike) -> FloatArray:
    """Return a pose, position (m) and quaternion wxyz, shape (7,), as a matrix, shape (4, 4)."""
    values = np.asarray(pose, dtype=np.float64)
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_to_rotation(values[3:])
    matrix[:3, 3] = values[:3]
    return matrix


def keep_block_range(block: BlockPlan, limits: JointLimits) -> BlockPlan:
    """Scale down the shape of every joint that would leave its range, just enough.

    The movement is the quintic between its ends, with their velocities, plus the shape, so that the
    greatest share of it that fits follows in closed form. The ends stay.

    Parameters
    ----------
    block : BlockPlan
    limits : JointLimits
        Of the arm.

    Returns
    -------
    BlockPlan
        The same one, if it keeps the range.
    """
    ends = (block.start, block.goal, block.start_velocity, block.goal_velocity)
    rest, shape = split_shape(block.weights, *ends, block.duration)
    bound = np.where(shape > 0, limits.position_max, limits.position_min)
    room = np.maximum((bound - rest) * np.sign(shape), 0.0)
    fits = np.full_like(room, 1.0)
    np.divide(room, np.abs(shape), out=fits, where=np.abs(shape) > room)
    share = fits.min(axis=0)
    if np.all(share >= 1.0):
        return block
    share = np.where(share < 1.0, (1.0 - _RESERVE) * share, 1.0)
    return replace(block, weights=share[:, np.newaxis] * block.weights)


def keep_task_limits(plan: TaskPlan, robot: Robot) -> TaskPlan:
    """Keep the arm's limits at 1 kHz: less shape for the range, more time for all else.

    Parameters
    ----------
    plan : TaskPlan
    robot : Robot

    Raises
    ------
    PlanError
        If it leaves the joints' ranges, the arm touches itself, its pedestal or the floor, or it
        cannot bear its load.
    """
    blocks = tuple(keep_block_range(block, robot.limits) for block in plan.blocks)
    plan = replace(plan, blocks=blocks)
    *_, velocities, accelerations = sample_task(plan)
    factor = time_stretch(robot.limits, velocities, accelerations)
    # Without the margin: what was stretched keeps its limits, and is not stretched again.
    if factor > 1.0:
        plan = stretch_task(plan, _MARGIN * factor)
    slower = 1.0
    while True:
        report = check_limits(robot, *sample_task(plan)[1:])
        if report.position or report.self_collisions:
            what = "leaves its joint range" if report.position else "touches itself or the floor"
            raise PlanError(
                f"{plan.name}: block by block the arm {what} in "
                f"{report.position or report.self_collisions} of {report.samples} samples"
            )
        if not report.torque and not report.velocity and not report.acceleration:
            return plan
        slower *= _SLOWER
        if slower > _SLOWEST:
            raise PlanError(
                f"{plan.name}: block by block it asks for {report.torque_ratio:.2f} of the torque "
                "limit, twice as slow too"
            )
        plan = stretch_task(plan, _SLOWER)
