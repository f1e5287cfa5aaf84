"""A task whose gripper is square to what it takes, and puts it down as it has taken it."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from besman.geometry.frames import rotation_to_quaternion
from besman.motion.adapt_task import follow_goal, frame_matrix, keep_block_range, keep_task_limits
from besman.motion.grasp_postures import Postures
from besman.motion.grasp_way import GraspWay, poses_from
from besman.motion.velocity_dmp import fit_velocity_weights, roll_out_velocity
from besman.records import BlockPlan, TaskPlan
from besman.records.layers import IDLE
from besman.robot.ik_kernel import follow_paths
from besman.robot.inverse_kinematics import IkWeights, joint_box
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

_N_SAMPLES, _N_WEIGHTS = 101, 20


def aim_grasps(plan: TaskPlan, robot: Robot, way: GraspWay) -> TaskPlan:
    """Bring a task to where a gripper has its objects, within the limits of its arm.

    Parameters
    ----------
    plan : TaskPlan
    robot : Robot
        The plan's arm with its gripper.
    way : GraspWay

    Returns
    -------
    TaskPlan
        See `lead_grasps`.

    Raises
    ------
    PlanError
        If a goal is out of reach, or the arm cannot keep its limits: it names the block.
    """
    led = lead_grasps(plan, robot, way)
    return led if led is plan else keep_task_limits(led, robot)


def lead_grasps(
    plan: TaskPlan, robot: Robot, way: GraspWay, postures: Postures | None = None
) -> TaskPlan:
    """Bring the goals of blocks that lead to an object, or to its place, to where a gripper has it.

    A person takes a thing a little differently every time, shifts it between the fingers, and has
    fingers that give way; a gripper holds what it has, and meets what is in its way. So it comes
    straight to the object, with which it goes straight up, and down to its place, where it is as
    it was at the object; and leaves straight. These short ways are blocks of their own, at rest at
    their ends; between them blocks keep their shape and lead to the ends of the straight ways.

    Parameters
    ----------
    plan : TaskPlan
    robot : Robot
        The plan's arm with its gripper.
    way : GraspWay
    postures : Postures, optional
        Of the plan, for who brings it to its objects in several ways.

    Returns
    -------
    TaskPlan
        Within the joints' ranges, as fast as it comes. The same one, if it takes nothing and goes
        no higher.

    Raises
    ------
    OutOfReachError
        If a goal is out of reach: it names the block.
    PlanError
        If there are not so many postures.
    """
    if way.higher_m == 0 and all(block.frame == "world" for block in plan.blocks):
        return plan
    goals = (postures or Postures(plan, robot)).choose(way)
    blocks: list[BlockPlan] = []
    events: list[tuple[float, Literal["close", "open"]]] = []
    following = (*plan.blocks[1:], None)
    for block, after, goal in zip(plan.blocks, following, goals, strict=True):
        if blocks:
            block = _start_where(block, blocks[-1])
        if block.frame == "world":
            blocks.append(_raise(block, robot, way.higher_m))
            continue
        standing = plan.object_poses if block.frame == "object" else plan.target_poses
        frame = frame_matrix(standing[plan.objects.index(block.thing)])
        taking = block.frame == "object"
        first, at, last = way.ends(taking)
        still, pose = np.zeros_like(goal), _as_pose(first)
        led = replace(block, goal=goal, goal_velocity=still, goal_pose=pose, path_error=None)
        blocks.append(_raise(led, robot, way.higher_m))
        if after is None or (after.frame, after.thing) != (block.frame, block.thing):
            blocks.append(_straight(plan.name, robot, blocks[-1], frame, at, way.straight_s))
            now = float(sum(one.duration for one in blocks))
            events.append((now, "close" if taking else "open"))
            blocks.append(_straight(plan.name, robot, blocks[-1], frame, last, way.straight_s))
    return replace(
        plan,
        blocks=tuple(keep_block_range(block, robot.limits) for block in blocks),
        events_s=np.array([at for at, _ in events]),
        events=tuple(kind for _, kind in events),
    )


def _start_where(block: BlockPlan, last: BlockPlan) -> BlockPlan:
    """Return a block that begins where the last one ends, as fast as that."""
    same = np.array_equal(block.start, last.goal)
    return replace(
        block,
        start=last.goal,
        start_velocity=last.goal_velocity,
        path_error=block.path_error if same else None,
    )


def _straight(
    name: str, robot: Robot, last: BlockPlan, frame: FloatArray, wanted: FloatArray, seconds: float
) -> BlockPlan:
    """Return the block of a straight way of least jerk from where the last one ends to a pose."""
    poses = poses_from(robot, last.goal, frame @ wanted)
    goal = follow_goal(name, robot, last, poses)
    time = np.linspace(0.0, seconds, _N_SAMPLES)
    x = time / seconds
    path = CubicSpline(np.linspace(0.0, 1.0, len(poses)), _follow(robot, last.goal, goal, poses))
    still = np.zeros_like(goal)
    positions = path(x**3 * (10.0 - 15.0 * x + 6.0 * x**2))
    weights = fit_velocity_weights(time, positions, still, still, _N_WEIGHTS)
    return replace(
        last,
        weights=weights,
        start=last.goal,
        goal=goal,
        start_velocity=still,
        goal_velocity=still,
        duration=seconds,
        goal_pose=_as_pose(wanted),
        path_error=None,
    )


def _raise(block: BlockPlan, robot: Robot, higher_m: float) -> BlockPlan:
    """Return a block whose middle is higher, with the same ends; a rest stays as it is."""
    if higher_m == 0 or block.label == IDLE:
        return block
    time = np.linspace(0.0, block.duration, _N_SAMPLES)
    ends = (block.start, block.goal, block.start_velocity, block.goal_velocity)
    path, _, _ = roll_out_velocity(block.weights, *ends, block.duration, np.zeros(2), time)
    poses = forward_kinematics(robot.chain, path)
    x = time / block.duration
    poses[:, 2, 3] += higher_m * 64.0 * x**3 * (1.0 - x) ** 3
    raised = _follow(robot, path[0], path[-1], poses)
    number = min(block.weights.shape[1], _N_SAMPLES // 2)
    weights = fit_velocity_weights(time, raised, *ends[2:], number)
    return replace(block, weights=weights, path_error=None)


def _follow(robot: Robot, start: FloatArray, goal: FloatArray, poses: FloatArray) -> FloatArray:
    """Return the joints at poses (N, 4, 4) between two that are known, shape (N, n)."""
    chain = robot.chain
    low, high = joint_box(robot)
    found, _ = follow_paths(
        chain.placements,
        chain.axes,
        chain.tip,
        low,
        high,
        start,
        IkWeights().as_array(),
        False,
        poses[None],
        start[None],
        0,
        60,
        1e-12,
    )
    return np.concatenate([start[None], found[0, 0, 1:-1], goal[None]])


def _as_pose(matrix: FloatArray) -> FloatArray:
    """Return position (m) and quaternion wxyz, shape (7,)."""
    return np.concatenate([matrix[:3, 3], rotation_to_quaternion(matrix[None, :3, :3])[0]])
