"""A whole action on one arm: mapped, and as a plan of chained blocks with gripper events."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from besman.exceptions import PlanError
from besman.records.frozen import FloatArray, Record, ShapeError, freeze
from besman.records.trajectories import JointTrajectory

Frame = Literal["world", "object", "target"]
"""What a block's goal is relative to: nothing, where an object stands, or where it is put."""

# Ends of blocks that are one are one but for rounding.
_JOINED = 1e-6


@dataclass(frozen=True, eq=False)
class MappedTask(
    Record, stored_as="MappedTask", finite=("bounds_s", "object_positions", "holds_s", "opening_m")
):
    """A `BlockDemonstration` in the workspace of one arm, on the clock of its trajectory.

    Attributes
    ----------
    trajectory : JointTrajectory
        Through all blocks and rests.
    labels : tuple of str, length B
    bounds_s : array, shape (B, 2)
        Start and end of each block, seconds.
    objects : tuple of str, length O
    object_positions : array, shape (T, O, 3)
        Metres in the robot's world frame, at the samples of the trajectory.
    object_headings : array, shape (T, O)
        Radians from the world's x axis; NaN where they are not known.
    holds_s : array, shape (H, 2)
        When an object begins and ceases to move with the tool, seconds.
    held : tuple of str, length H
    opening_m : float
        How far the hand was opened at most, metres; 0 where the fingers were not seen.
    """

    trajectory: JointTrajectory
    labels: tuple[str, ...]
    bounds_s: FloatArray
    objects: tuple[str, ...]
    object_positions: FloatArray
    object_headings: FloatArray
    holds_s: FloatArray
    held: tuple[str, ...]
    opening_m: float

    def __post_init__(self) -> None:
        freeze(
            self,
            {
                "bounds_s": ("B", 2),
                "object_positions": ("T", "O", 3),
                "object_headings": ("T", "O"),
                "holds_s": ("H", 2),
            },
        )
        if len(self.object_positions) != len(self.trajectory.time):
            raise ShapeError(
                f"MappedTask.object_positions must have {len(self.trajectory.time)} samples, got "
                f"{len(self.object_positions)}"
            )

    @property
    def name(self) -> str:
        """Name of the demonstration."""
        return self.trajectory.name


@dataclass(frozen=True, eq=False)
class BlockPlan(
    Record,
    stored_as="BlockPlan",
    finite=("weights", "start", "goal", "start_velocity", "goal_velocity", "duration", "goal_pose"),
):
    """One block of a task: a primitive of `besman.motion.velocity_dmp` without leads.

    Attributes
    ----------
    label : str
        The block, or ``idle``.
    weights : array, shape (n, K)
    start, goal : array, shape (n,)
        rad.
    start_velocity, goal_velocity : array, shape (n,)
        rad/s.
    duration : float
        Seconds.
    frame : "world", "object" or "target"
        What the goal is relative to.
    thing : str
        The object that is meant; "" in the world.
    goal_pose : array, shape (7,)
        Pose of the tool centre point at the goal in that frame: position (m), quaternion wxyz. The
        frame of an object has its origin in its centre, z up, and x along its heading.
    path_error : float, optional
        Greatest distance of the tool from what the block imitates at the same time, evenly
        stretched as the task is, metres; None where that is not known.
    """

    label: str
    weights: FloatArray
    start: FloatArray
    goal: FloatArray
    start_velocity: FloatArray
    goal_velocity: FloatArray
    duration: float
    frame: Frame
    thing: str
    goal_pose: FloatArray
    path_error: float | None = None

    def __post_init__(self) -> None:
        ends = ("start", "goal", "start_velocity", "goal_velocity")
        shapes: dict[str, tuple[int | str, ...]] = dict.fromkeys(ends, ("n",))
        freeze(self, shapes | {"weights": ("n", "K"), "goal_pose": (7,)})
        if not self.duration > 0:
            raise PlanError(
                f"{self.label}: duration: got {self.duration:g} s, expected more than 0"
            )


@dataclass(frozen=True, eq=False)
class TaskPlan(
    Record,
    stored_as="TaskPlan",
    finite=("object_poses", "target_poses", "events_s", "opening_m", "between_poses"),
    later=("between_poses",),
):
    """Blocks in their order, each beginning where and as fast as the one before ends.

    Attributes
    ----------
    name, label : str
        Of the demonstration, and of the action.
    joint_names : tuple of str, length n
    blocks : tuple of BlockPlan
        Rests among them; the first begins and the last ends at rest.
    objects : tuple of str, length O
    object_poses, target_poses : array, shape (O, 7)
        Where each stands before and after, in the robot's world frame: position (m), quaternion
        wxyz, upright.
    events_s : array, shape (E,)
        When the gripper closes or opens, seconds from the start of the first block, rising.
    events : tuple of "close" or "open", length E
    opening_m : float
        As of `MappedTask`.
    rmse : float
        Root mean square error of the imitation, rad.
    between_poses : array, shape (V, 7)
        Where objects are put to be taken again, as `object_poses`.

    Raises
    ------
    PlanError
        If blocks do not join, or the task does not begin and end at rest.
    """

    name: str
    label: str
    joint_names: tuple[str, ...]
    blocks: tuple[BlockPlan, ...]
    objects: tuple[str, ...]
    object_poses: FloatArray
    target_poses: FloatArray
    events_s: FloatArray
    events: tuple[Literal["close", "open"], ...]
    opening_m: float
    rmse: float
    between_poses: FloatArray = field(default_factory=lambda: np.empty((0, 7)))

    def __post_init__(self) -> None:
        poses = {"object_poses": ("O", 7), "target_poses": ("O", 7), "between_poses": ("V", 7)}
        freeze(self, {**poses, "events_s": ("E",)})
        if not self.blocks:
            raise PlanError(f"{self.name}: a task has at least one block, got none")
        rests = (self.blocks[0].start_velocity, self.blocks[-1].goal_velocity)
        if any(np.any(np.abs(velocity) > _JOINED) for velocity in rests):
            raise PlanError(f"{self.name}: a task begins and ends at rest; got a velocity there")
        for before, after in zip(self.blocks, self.blocks[1:], strict=False):
            for end, start in (("goal", "start"), ("goal_velocity", "start_velocity")):
                off = np.max(np.abs(getattr(before, end) - getattr(after, start)))
                if not off <= _JOINED:
                    raise PlanError(
                        f"{self.name}: {after.label}: {start}: {off:g} off from where "
                        f"{before.label} ends; expected the same"
                    )

    @property
    def duration(self) -> float:
        """Seconds of all blocks."""
        return float(sum(block.duration for block in self.blocks))

    @property
    def path_error(self) -> float | None:
        """Greatest distance of the tool from what is imitated at the same time, metres."""
        known = [block.path_error for block in self.blocks if block.path_error is not None]
        return max(known) if known else None

    @property
    def starts_s(self) -> FloatArray:
        """When each block begins, and the last ends, shape (B + 1,)."""
        return np.concatenate([[0.0], np.cumsum([block.duration for block in self.blocks])])
