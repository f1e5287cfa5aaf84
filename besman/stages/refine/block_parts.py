"""The parts of a whole task that are refined each by itself: take, put, leave."""

from __future__ import annotations

from dataclasses import replace
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from besman.exceptions import PlanError
from besman.motion.adapt_task import frame_matrix, keep_task_limits
from besman.motion.grasp_goals import lead_grasps
from besman.motion.grasp_way import GraspWay
from besman.motion.task_rollout import stretch_task
from besman.records import BlockPlan, TaskPlan
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.block_trials import BlockGoal

FloatArray = npt.NDArray[np.float64]

GOALS: tuple[BlockGoal, ...] = ("take", "put", "leave")
# What a unit of the search is: metres along the box's axes, radians of yaw and pitch; how much
# higher the middle of a way is, how far the gripper leaves, metres; how much slower it all is.
_POSE = (0.02, 0.02, 0.02, 0.15, 0.15)
_UNITS: dict[BlockGoal, FloatArray] = {
    "take": np.array([*_POSE, 0.04]),
    "put": np.array([*_POSE, 0.04, 0.03]),
    "leave": np.array([0.04, 0.1]),
}

# Level, ahead along x, closing along y.
_SQUARE = [[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]


# Ways to and from a box end a part: to it, and on.
_N_STRAIGHT = 2


class Part(NamedTuple):
    """Blocks of a task with one outcome.

    Attributes
    ----------
    goal : "take", "put" or "leave"
    plan : TaskPlan
        Of these blocks alone.
    tool : array, shape (4, 4)
        Where the tool was shown to be at the end, in the frame of the object or its place; where
        the part before has it, if it leads to neither.
    """

    goal: BlockGoal
    plan: TaskPlan
    tool: FloatArray


def n_parameters(goal: BlockGoal) -> int:
    """Return how many parameters a part has."""
    return len(_UNITS[goal])


def split_task(plan: TaskPlan, scratch: bool = False) -> tuple[Part, ...]:
    """Split a task at the borders after which its box is in the hand, and at its place.

    Parameters
    ----------
    plan : TaskPlan
        As imitated; one object is taken and put once.
    scratch : bool
        Without what was shown: blocks without a shape, and a tool that is square to the box, in
        its middle. Order and goals' frames stay, and where the arm rests.

    Raises
    ------
    PlanError
        If it does not take and put one thing.
    """
    parts = []
    tool = np.eye(4)
    for goal, blocks in zip(GOALS, _divide(plan), strict=True):
        if not blocks:
            continue
        if scratch:
            blocks = tuple(replace(b, weights=np.zeros_like(b.weights)) for b in blocks)
        if goal != "leave":
            tool = np.array(_SQUARE) if scratch else frame_matrix(blocks[-1].goal_pose)
        parts.append(_part(goal, plan, blocks, tool))
    return tuple(parts)


def split_aimed(plan: TaskPlan, way: GraspWay) -> tuple[Part, ...]:
    """Split a task that has been brought to its box, so that 0 is as it was brought there.

    Parameters
    ----------
    plan : TaskPlan
        Of `besman.motion.grasp_goals.lead_grasps`.
    way : GraspWay
        The one that it was brought in.

    Raises
    ------
    PlanError
        As of `split_task`.
    """
    parts = []
    for goal, blocks in zip(GOALS, _divide(plan), strict=True):
        # The straight ways are made anew.
        kept = blocks if goal == "leave" else blocks[:-_N_STRAIGHT]
        if kept:
            parts.append(_part(goal, plan, kept, way.tool))
    return tuple(parts)


def _divide(plan: TaskPlan) -> list[tuple[BlockPlan, ...]]:
    """Return the blocks of the three parts of a task."""
    frames = [block.frame for block in plan.blocks]
    order = [frame for frame, _ in groupby(frame for frame in frames if frame != "world")]
    if order != ["object", "target"]:
        raise PlanError(f"{plan.name}: expected one object that is taken and put, once")
    cuts = [len(frames) - frames[::-1].index(frame) for frame in order]
    ends = [0, *cuts, len(frames)]
    return [plan.blocks[first:stop] for first, stop in pairwise(ends)]


def _part(goal: BlockGoal, plan: TaskPlan, blocks: tuple[BlockPlan, ...], tool: FloatArray) -> Part:
    """Return blocks as a part, at rest at its ends."""
    still = np.zeros(len(plan.joint_names))
    blocks = (replace(blocks[0], start_velocity=still, path_error=None), *blocks[1:])
    blocks = (*blocks[:-1], replace(blocks[-1], goal_velocity=still, path_error=None))
    return Part(goal, replace(plan, blocks=blocks, events_s=np.empty(0), events=()), tool)


def shape_part(
    part: Part, way: GraspWay, robot: Robot, x: FloatArray, last: TaskPlan | None
) -> TaskPlan:
    """Return a part as parameters say, within the arm's limits, from where the last one has ended.

    Parameters
    ----------
    part, way, robot, x, last
        As of `lead_part`.

    Raises
    ------
    PlanError
        If it is out of the arm's reach or limits.
    """
    led = lead_part(part, way, robot, x, last)
    if part.goal == "leave":
        led = stretch_task(led, float(np.exp(abs(x[1] * _UNITS[part.goal][1]))))
    return keep_task_limits(led, robot)


def lead_part(
    part: Part, way: GraspWay, robot: Robot, x: FloatArray, last: TaskPlan | None
) -> TaskPlan:
    """Return a part as parameters say, as fast as it comes.

    Parameters
    ----------
    part : Part
    way : GraspWay
        The straight ways.
    robot : Robot
    x : array, shape (D,)
        In units of the search; 0 is what was shown.
    last : TaskPlan, optional
        The part before; this one begins where it ends.

    Raises
    ------
    OutOfReachError
        If it is out of reach.
    """
    values = x * _UNITS[part.goal]
    plan = part.plan
    if last is not None:
        first = replace(
            plan.blocks[0],
            start=last.blocks[-1].goal,
            start_velocity=last.blocks[-1].goal_velocity,
            path_error=None,
        )
        plan = replace(plan, blocks=(first, *plan.blocks[1:]))
    if part.goal == "leave":
        return lead_grasps(plan, robot, replace(way, higher_m=abs(values[0])))
    tool = np.array(part.tool)
    tool[:3, 3] += values[:3]
    turn = Rotation.from_euler("ZY", values[3:5]).as_matrix()
    tool[:3, :3] = turn @ tool[:3, :3]
    after_m = way.after_m + values[6] if part.goal == "put" else way.after_m
    moved = replace(
        way, grasp=tool, pitch_rad=0.0, higher_m=abs(values[5]), after_m=max(after_m, 0.02)
    )
    return lead_grasps(plan, robot, moved)
