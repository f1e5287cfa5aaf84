"""A hand's and an arm's movement over time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from besman.records.frozen import FloatArray, Record, freeze


@dataclass(frozen=True, eq=False)
class HandTrajectory(
    Record,
    stored_as="besman.records:HandTrajectory",
    finite=("time", "poses"),
    later=("target_by",),
):
    """The hand of one selected demonstration.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds from the start of the segment.
    poses : array, shape (T, 7)
        Position (m) and quaternion (w, x, y, z) of the hand frame in the person's back frame.
    name : str
        ``source:segment``, unique within a run.
    label : str
        Class of the segment.
    target : array, shape (3,)
        Where the thrown object met the ground, metres in the back frame; NaN if nothing is thrown.
    target_by : str, optional
        What told the target, see `besman.stages.select.targets.Aim`; None if there is none.
    grasp : array, shape (7,)
        What the tool centre point is to follow, in the hand frame: position (m) and quaternion
        (w, x, y, z). NaN for either where the robot's tool says it, as ``hand_to_tcp`` does.
    """

    time: FloatArray
    poses: FloatArray
    name: str
    label: str
    target: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    grasp: FloatArray = field(default_factory=lambda: np.full(7, np.nan))
    target_by: str | None = None

    def __post_init__(self) -> None:
        freeze(self, {"time": ("T",), "poses": ("T", 7), "target": (3,), "grasp": (7,)})


@dataclass(frozen=True, eq=False)
class JointTrajectory(
    Record,
    stored_as="besman.records:JointTrajectory",
    finite=(
        "time",
        "positions",
        "velocities",
        "accelerations",
        "poses",
        "position_error",
        "orientation_error",
        "time_stretch",
    ),
    distinct=("joint_names",),
):
    """A movement of one robot arm.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds from 0, strictly rising.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.
    joint_names : tuple of str, length n
    poses : array, shape (T, 7)
        The mapped demonstration in the robot's world frame (floor below the base, z up), that the
        joint trajectory follows: position (m) and quaternion wxyz of the tool centre point.
    position_error : array, shape (T,)
        Metres between tool centre point and mapped demonstration.
    orientation_error : array, shape (T,)
        Radians between them.
    time_stretch : float
        Duration over the demonstration's duration.
    target : array, shape (3,)
        The demonstrated target in the robot's world frame, NaN if there is none.
    name, label
        As in `HandTrajectory`.
    """

    time: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    joint_names: tuple[str, ...]
    poses: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    time_stretch: float
    target: FloatArray
    name: str
    label: str

    def __post_init__(self) -> None:
        freeze(
            self,
            {
                "time": ("T",),
                "positions": ("T", "n"),
                "velocities": ("T", "n"),
                "accelerations": ("T", "n"),
                "poses": ("T", 7),
                "position_error": ("T",),
                "orientation_error": ("T",),
                "target": (3,),
            },
        )
