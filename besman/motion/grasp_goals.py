"""A task whose gripper is square to what it takes, and puts it down as it has taken it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from besman.exceptions import OutOfReachError
from besman.geometry.frames import rotation_to_quaternion
from besman.motion.adapt_task import (
    MISS_M,
    MISS_RAD,
    follow_goal,
    frame_matrix,
    keep_task_limits,
)
from besman.motion.velocity_dmp import fit_velocity_weights, roll_out_velocity
from besman.records import BlockPlan, TaskPlan
from besman.records.layers import IDLE
from besman.robot.ik_kernel import follow_paths
from besman.robot.inverse_kinematics import IkWeights, joint_box, solve_path
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

_N_STEPS = 33
_N_SAMPLES, _N_WEIGHTS = 101, 20


@dataclass(frozen=True, eq=False)
class GraspWay:
    """How a gripper has an object, and how it comes to it and leaves it.

    Attributes
    ----------
    grasp : array, shape (4, 4)
        Pose of the tool centre point in the frame of an object, metres.
    pitch_rad : float
        How far the tool is turned about the axis along which it closes, down.
    before_m, after_m : float
        From where on it comes straight ahead along its z axis, and how far it leaves along it.
    up_m : float
        How far it goes straight up after it has taken something, and down to put it.
    straight_s : float
        How long each straight way takes.
    higher_m : float
        How much higher the middle of every other way from place to place is than it was shown.
    """

    grasp: FloatArray
    pitch_rad: float = 0.0
    before_m: float = 0.1
    after_m: float = 0.15
    up_m: float = 0.05
    straight_s: float = 1.0
    higher_m: float = 0.0

    @property
    def tool(self) -> FloatArray:
        """Where the tool has the object, shape (4, 4)."""
        turned = np.array(self.grasp)
        # Down is where z is turned to; x may point to either side.
        side = np.sign(np.cross(turned[:3, 0], turned[:3, 2])[2])
        turn = Rotation.from_rotvec(side * self.pitch_rad * -turned[:3, 0]).as_matrix()
        turned[:3, :3] = turn @ turned[:3, :3]
        return turned

    def back(self, distance_m: float) -> FloatArray:
        """Return where the tool is so far behind that, shape (4, 4)."""
        moved = self.tool
        moved[:3, 3] -= distance_m * moved[:3, 2]
        return moved

    @property
    def above(self) -> FloatArray:
        """Where the straight way up from an object ends, and that down to its place begins."""
        moved = self.tool
        moved[2, 3] += self.up_m
        return moved


def aim_grasps(plan: TaskPlan, robot: Robot, way: GraspWay) -> TaskPlan:
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

    Returns
    -------
    TaskPlan
        The same one, if it takes nothing.

    Raises
    ------
    PlanError
        If a goal is out of reach, or the arm cannot keep its limits: it names the block.
    """
    blocks: list[BlockPlan] = []
    events: list[tuple[float, Literal["close", "open"]]] = []
    following = (*plan.blocks[1:], None)
    for block, after in zip(plan.blocks, following, strict=True):
        if blocks:
            block = _start_where(block, blocks[-1])
        if block.frame == "world":
            blocks.append(_raise(block, robot, way.higher_m))
            continue
        standing = plan.object_poses if block.frame == "object" else plan.target_poses
        frame = frame_matrix(standing[plan.objects.index(block.thing)])
        taking = block.frame == "object"
        first = way.back(way.before_m) if taking else way.above
        led = _aim(plan.name, robot, block, frame, (first, way.tool))
        blocks.append(_raise(led, robot, way.higher_m))
        if after is None or (after.frame, after.thing) != (block.frame, block.thing):
            blocks.append(_straight(plan.name, robot, blocks[-1], frame, way.tool, way.straight_s))
            at = float(sum(one.duration for one in blocks))
            events.append((at, "close" if taking else "open"))
            last = way.above if taking else way.back(way.after_m)
            blocks.append(_straight(plan.name, robot, blocks[-1], frame, last, way.straight_s))
    if not events:
        return plan
    aimed = replace(
        plan,
        blocks=tuple(blocks),
        events_s=np.array([at for at, _ in events]),
        events=tuple(kind for _, kind in events),
    )
    return keep_task_limits(aimed, robot)


def _start_where(block: BlockPlan, last: BlockPlan) -> BlockPlan:
    """Return a block that begins where the last one ends, as fast as that."""
    same = np.array_equal(block.start, last.goal)
    return replace(
        block,
        start=last.goal,
        start_velocity=last.goal_velocity,
        path_error=block.path_error if same else None,
    )


def _aim(
    name: str,
    robot: Robot,
    block: BlockPlan,
    frame: FloatArray,
    ends: tuple[FloatArray, FloatArray],
) -> BlockPlan:
    """Return a block that leads to where a straight way begins in a frame, and is at rest there.

    Where the arm's own posture does not reach that, it is another in which all of the way is.
    """
    wanted = ends[0]
    poses = _steps(robot, block.goal, frame @ wanted)
    try:
        goal = follow_goal(name, robot, block, poses)
    except OutOfReachError:
        found = solve_path(robot, _between(frame @ wanted, frame @ ends[1]))
        if max(found.position_error) > MISS_M or max(found.orientation_error) > MISS_RAD:
            raise
        goal = found.positions[0]
    still = np.zeros_like(goal)
    return replace(
        block, goal=goal, goal_velocity=still, goal_pose=_as_pose(wanted), path_error=None
    )


def _straight(
    name: str, robot: Robot, last: BlockPlan, frame: FloatArray, wanted: FloatArray, seconds: float
) -> BlockPlan:
    """Return the block of a straight way of least jerk from where the last one ends to a pose."""
    poses = _steps(robot, last.goal, frame @ wanted)
    goal = follow_goal(name, robot, last, poses)
    time = np.linspace(0.0, seconds, _N_SAMPLES)
    x = time / seconds
    path = CubicSpline(np.linspace(0.0, 1.0, _N_STEPS), _follow(robot, last.goal, goal, poses))
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


def _steps(robot: Robot, joints: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return poses on the straight way from where the tool is to where it is wanted."""
    return _between(forward_kinematics(robot.chain, joints[np.newaxis])[0], wanted)


def _between(here: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return poses on the straight way between two, shape (N, 4, 4)."""
    shares = np.linspace(0.0, 1.0, _N_STEPS)
    ends: Sequence[FloatArray] = (here[:3, :3], wanted[:3, :3])
    poses = np.tile(np.eye(4), (_N_STEPS, 1, 1))
    poses[:, :3, :3] = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack(ends)))(shares).as_matrix()
    poses[:, :3, 3] = here[:3, 3] + shares[:, np.newaxis] * (wanted[:3, 3] - here[:3, 3])
    return poses
