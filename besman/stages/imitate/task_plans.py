"""Whole tasks as chained motion plans: one a block, with its goal's frame and gripper events."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from besman.config.stage import Items, Truth, Work
from besman.exceptions import PlanError
from besman.geometry.frames import rotation_to_quaternion
from besman.motion.adapt_task import frame_matrix, keep_task_limits
from besman.motion.rest_at_ends import rest_at_both_ends
from besman.motion.velocity_dmp import fit_velocity_weights, roll_out_velocity
from besman.records import BlockPlan, MappedTask, TaskPlan
from besman.records.layers import IDLE
from besman.records.whole_tasks import Frame
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.stages.imitate.accuracy import least_weights, refuse_if_task_lost
from besman.stages.imitate.methods import ImitateStage

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

RATE_HZ = 1000.0
# A shorter rest is part of the blocks beside it.
_LEAST_REST_S = 0.1
_FIT_EVERY = 5
# In less time an arm would have to jump: it speeds up within the movement then.
_LEAST_LEAD_S = 0.02


class _Span(NamedTuple):
    """A block or a rest: its label, the block that its goal is that of, and its rows at 1 kHz."""

    label: str
    block: int
    start: int
    end: int


class ImitateTasks:
    """Imitates every block of a whole task by a primitive that begins as the last one ends.

    Parameters
    ----------
    config : imitate stage
        Its ``n_weights``, ``error_mm``, ``greatest_error_mm`` and leads; the kind of plan is that
        of `besman.motion.velocity_dmp`.
    """

    def __init__(self, config: ImitateStage) -> None:
        self.config = config

    def run(
        self, tasks: tuple[MappedTask, ...], robot: Robot, work: Work = Work()
    ) -> tuple[TaskPlan, ...]:
        """Fit a plan of each task.

        Parameters
        ----------
        tasks : tuple of MappedTask
        robot : Robot
            With its tool.
        work : Work

        Raises
        ------
        PlanError
            If no task is imitated within the arm's limits, and as near as permitted.
        """
        config = self.config
        leads = (config.lead_in_s, config.lead_out_s)
        greatest = config.greatest_error_mm

        def fit(task: MappedTask) -> TaskPlan:
            plan = plan_task(task, robot, config.n_weights, leads, 1e-3 * config.error_mm)
            refuse_if_task_lost(plan, None if greatest is None else 1e-3 * greatest)
            return plan

        here = replace(work, jobs=1, workers=None)
        return tuple(here.map(fit, tasks, name=lambda task: task.name))

    def items(self, tasks: tuple[MappedTask, ...], *records: Any) -> Items:
        """Count the tasks."""
        return Items(len(tasks), "tasks")

    def figures(self, plans: tuple[TaskPlan, ...], truth: Truth, *records: Any) -> dict[str, Any]:
        """Return the blocks of each plan with their frames, and how far they are off."""
        errors = [plan.rmse for plan in plans]
        blocks = [block for plan in plans for block in plan.blocks]
        numbers = [block.weights.shape[1] for block in blocks]
        away = [block.path_error for block in blocks if block.path_error is not None]
        wanted_m = 1e-3 * self.config.error_mm
        return {
            "rmse_rad": {"mean": float(np.mean(errors)), "max": float(np.max(errors))},
            "position_error_m": {"max": max(away) if away else None},
            "n_weights": {"min": min(numbers), "max": max(numbers)},
            "wanted_error_m": wanted_m,
            "beyond": [
                plan.name
                for plan in plans
                if plan.path_error is not None and plan.path_error > wanted_m
            ],
            "plans": {
                plan.name: {
                    "duration_s": plan.duration,
                    "blocks": [
                        {
                            "label": block.label,
                            "duration_s": block.duration,
                            "frame": block.frame,
                            "n_weights": block.weights.shape[1],
                            "position_error_m": block.path_error,
                        }
                        for block in plan.blocks
                    ],
                    "gripper": [
                        {"time_s": float(at), "command": event}
                        for at, event in zip(plan.events_s, plan.events, strict=True)
                    ],
                }
                for plan in plans
            },
        }


def plan_task(
    task: MappedTask,
    robot: Robot,
    n_weights: int | None = None,
    leads_s: tuple[float, float] = (0.0, 0.0),
    wanted_m: float = 0.001,
) -> TaskPlan:
    """Fit chained primitives to a mapped task.

    Each begins with the position and velocity with which the one before ends, and without
    acceleration; the first begins and the last ends at rest. Where the imitation exceeds a limit
    of velocity, acceleration or torque at 1 kHz, the task is slower, evenly.

    Parameters
    ----------
    task : MappedTask
    robot : Robot
    n_weights : int, optional
        Weights per joint of each block; None for the least of
        `besman.stages.imitate.accuracy.NUMBERS` that keep the block's tool as near as wanted, for
        each block by itself.
    leads_s : pair of float
        Before and after, to speed up from rest and to slow down to it; see
        `besman.motion.rest_at_ends.rest_at_both_ends`. Shorter, or 0, where a joint would leave its
        range in them.
    wanted_m : float
        Greatest distance of the tool at the same time, metres.

    Raises
    ------
    PlanError
        If the imitation leaves the joints' ranges, the arm touches itself or cannot bear its load.
    """
    from scipy.interpolate import CubicSpline

    own = task.trajectory
    leads_s = (
        _lead_in_range(leads_s[0], own.positions[0], -own.velocities[0], robot),
        _lead_in_range(leads_s[1], own.positions[-1], own.velocities[-1], robot),
    )
    way = rest_at_both_ends(own.time, own.positions, own.velocities, *leads_s)
    spline = CubicSpline(*way, bc_type="clamped")
    # A whole number of steps, so that the end is one of them.
    n_steps = max(round(float(way[0][-1]) * RATE_HZ), 2)
    time = np.linspace(0.0, float(way[0][-1]), n_steps + 1)
    positions, velocities = spline(time), spline(time, 1)
    spans = _divide(task, leads_s[0], n_steps)
    movement = (time, positions, velocities)
    blocks = tuple(_fit_block(task, span, movement, robot, n_weights, wanted_m) for span in spans)
    events = sorted(
        (float(at) + leads_s[0], kind)
        for hold in task.holds_s
        for at, kind in zip(hold, ("close", "open"), strict=True)
    )
    plan = TaskPlan(
        name=task.name,
        label=own.label,
        joint_names=own.joint_names,
        blocks=blocks,
        objects=task.objects,
        object_poses=_standing(task, 0),
        target_poses=_standing(task, -1),
        events_s=np.array([at for at, _ in events]),
        events=tuple(_command(kind) for _, kind in events),
        opening_m=task.opening_m,
        rmse=0.0,
    )
    return _measure(keep_task_limits(plan, robot), spans, positions, robot)


def _measure(plan: TaskPlan, spans: list[_Span], positions: FloatArray, robot: Robot) -> TaskPlan:
    """Write into a plan how far it is from the positions at 1 kHz that it imitates."""
    blocks, square, n = [], 0.0, 0
    for block, span in zip(plan.blocks, spans, strict=True):
        rows = _fitted_rows(span)
        moved = _roll_out(block, span, rows)
        square += float(np.sum((moved - positions[rows]) ** 2))
        n += moved.size
        blocks.append(replace(block, path_error=_greatest_m(moved, positions[rows], robot)))
    return replace(plan, blocks=tuple(blocks), rmse=float(np.sqrt(square / n)))


def _fitted_rows(span: _Span) -> IntArray:
    """Return the rows at 1 kHz that a block is fitted to, its ends among them."""
    return np.append(np.arange(span.start, span.end, _FIT_EVERY), span.end)


def _roll_out(block: BlockPlan, span: _Span, rows: IntArray) -> FloatArray:
    """Return the joints of a block at rows of its span, however slow it is, shape (T, n)."""
    time = (rows - span.start) * (block.duration / (span.end - span.start))
    ends = (block.start, block.goal, block.start_velocity, block.goal_velocity)
    return roll_out_velocity(block.weights, *ends, block.duration, np.zeros(2), time)[0]


def _greatest_m(moved: FloatArray, wanted: FloatArray, robot: Robot) -> float:
    """Return the greatest distance of the tool at the same time, metres."""
    there, here = (forward_kinematics(robot.chain, q)[:, :3, 3] for q in (moved, wanted))
    return float(np.linalg.norm(there - here, axis=1).max())


def _lead_in_range(
    lead_s: float, positions: FloatArray, velocities: FloatArray, robot: Robot
) -> float:
    """Return how long a lead may be, in which joints move on from where they are.

    Velocities (n,) point away from the movement; a joint moves by half of its own times the lead.
    """
    limits = robot.limits
    bound = np.where(velocities > 0, limits.position_max, limits.position_min)
    room = np.maximum((bound - positions) * np.sign(velocities), 0.0)
    longest = np.full_like(room, np.inf)
    np.divide(2.0 * room, np.abs(velocities), out=longest, where=velocities != 0)
    lead_s = min(lead_s, (1.0 - 1e-6) * float(longest.min()))
    return lead_s if lead_s >= _LEAST_LEAD_S else 0.0


def _command(kind: str) -> Literal["close", "open"]:
    return "close" if kind == "close" else "open"


def _divide(task: MappedTask, lead_in_s: float, n_steps: int) -> list[_Span]:
    """Divide a task's rows at 1 kHz among its blocks and the rests between them, without a gap."""
    rows = np.round((task.bounds_s + lead_in_s) * RATE_HZ).astype(np.int64)
    rows[0, 0], rows[-1, 1] = 0, n_steps
    spans: list[_Span] = []
    for k, (label, (start, end)) in enumerate(zip(task.labels, rows.tolist(), strict=True)):
        begin = spans[-1].end if spans else 0
        if start - begin >= _LEAST_REST_S * RATE_HZ:
            spans.append(_Span(IDLE, k - 1, begin, start))
            begin = start
        # Blocks that a person let overlap share their rows in the order of time.
        spans.append(_Span(label, k, begin, max(end, begin + 2)))
    last = spans[-1]
    spans[-1] = last._replace(end=n_steps)
    if spans[-1].end - spans[-1].start < 2:
        raise PlanError(f"{task.name}: {last.label}: no time is left for it")
    return spans


def _fit_block(
    task: MappedTask,
    span: _Span,
    movement: tuple[FloatArray, FloatArray, FloatArray],
    robot: Robot,
    n_weights: int | None,
    wanted_m: float,
) -> BlockPlan:
    """Fit the primitive of one block or rest to its part of a movement at 1 kHz."""
    time, positions, velocities = movement
    rows = _fitted_rows(span)
    first, last = velocities[span.start], velocities[span.end]
    frame, thing = find_frame(task, span.block)
    goal = positions[span.end]
    reached = forward_kinematics(robot.chain, goal[np.newaxis])[0]
    at = _frame_pose(task, frame, thing)
    inside = at[:3, :3].T @ np.column_stack([reached[:3, :3], reached[:3, 3] - at[:3, 3]])

    def fit(number: int) -> BlockPlan:
        block = BlockPlan(
            span.label,
            fit_velocity_weights(
                time[rows] - time[span.start], positions[rows], first, last, number
            ),
            positions[span.start],
            goal,
            first,
            last,
            float(time[span.end] - time[span.start]),
            frame,
            thing,
            np.concatenate([inside[:, 3], rotation_to_quaternion(inside[:, :3])]),
        )
        moved = _roll_out(block, span, rows)
        return replace(block, path_error=_greatest_m(moved, positions[rows], robot))

    return least_weights(fit, len(rows), wanted_m) if n_weights is None else fit(n_weights)


def find_frame(task: MappedTask, block: int) -> tuple[Frame, str]:
    """Tell what the goal of a block is relative to.

    A block leads to an object if that is grasped before the next block is over, and not held at the
    block's own end; it leads to where the object is put if it holds the object and lets go of it
    before the next block begins. Any other leads to a place in the world.

    Parameters
    ----------
    task : MappedTask
    block : int
        Index of the block.

    Returns
    -------
    frame : "world", "object" or "target"
    thing : str
        The object; "" in the world.
    """
    start, end = task.bounds_s[block]
    after = task.bounds_s[block + 1] if block + 1 < len(task.labels) else np.array([np.inf, np.inf])
    middle = 0.5 * (start + end)
    for (grasp, release), thing in zip(task.holds_s, task.held, strict=True):
        if middle < release <= after.mean() and grasp < end - 0.5 * (end - start):
            return "target", thing
        if middle < grasp <= after.mean() and release > end:
            return "object", thing
    return "world", ""


def _frame_pose(task: MappedTask, frame: Frame, thing: str) -> FloatArray:
    """Return the pose of a frame in the robot's world, shape (4, 4)."""
    if frame == "world":
        return np.eye(4)
    standing = _standing(task, 0 if frame == "object" else -1)
    return frame_matrix(standing[task.objects.index(thing)])


def _standing(task: MappedTask, sample: int) -> FloatArray:
    """Return where objects stand at a sample, upright, shape (O, 7)."""
    half = 0.5 * np.nan_to_num(task.object_headings[sample])
    none = np.zeros_like(half)
    turn = np.column_stack([np.cos(half), none, none, np.sin(half)])
    return np.hstack([task.object_positions[sample], turn])
