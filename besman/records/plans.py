"""Motion plans: dynamical movement primitives of joints, and of the tool's pose."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from besman.exceptions import PlanError
from besman.records.frozen import FloatArray, Record, freeze


@dataclass(frozen=True, eq=False)
class MotionPlan(
    Record,
    stored_as="besman.records:MotionPlan",
    finite=("weights", "start", "goal", "duration", "start_velocity", "goal_velocity"),
    distinct=("joint_names",),
    later=("path_rmse", "path_error"),
):
    """A joint-space dynamical movement primitive. Its movement starts and ends at rest.

    Attributes
    ----------
    weights : array, shape (n, K)
        Weights of the forcing term.
    start, goal : array, shape (n,)
        rad; where the primitive starts and ends.
    duration : float
        Seconds of the whole movement, leads included.
    joint_names : tuple of str, length n
    rmse : float
        Root mean square error of the imitation, rad.
    goal_pose : array, shape (7,)
        Demonstrated end pose in the robot's world frame.
    start_pose : array, shape (7,)
        Demonstrated start pose in the robot's world frame; NaN where it is not known.
    target : array, shape (3,)
        As in `JointTrajectory`.
    name, label
        As in `HandTrajectory`.
    kind : "joint_dmp" or "joint_dmp_velocity"
        At rest at start and goal, or moving there (`besman.motion.velocity_dmp`).
    start_velocity, goal_velocity : array, shape (n,)
        rad/s at start and goal; zero by default, and of a ``joint_dmp``.
    lead_in_s, lead_out_s : float
        Seconds before the start and after the goal, in which the arm speeds up from rest to the
        start's velocity and slows down from the goal's; zero of a ``joint_dmp``.
    path_rmse, path_error : float, optional
        Root mean square and greatest distance (metres) of the imitation's tool centre point from
        where it was at the same time in what was imitated; None where that is not known.

    Raises
    ------
    PlanError
        If the movement would start or end with a jump of its velocity, or has no duration.
    """

    weights: FloatArray
    start: FloatArray
    goal: FloatArray
    duration: float
    joint_names: tuple[str, ...]
    rmse: float
    goal_pose: FloatArray
    target: FloatArray
    name: str
    label: str
    kind: Literal["joint_dmp", "joint_dmp_velocity"] = "joint_dmp"
    start_velocity: FloatArray = field(default_factory=lambda: np.empty(0))
    goal_velocity: FloatArray = field(default_factory=lambda: np.empty(0))
    lead_in_s: float = 0.0
    lead_out_s: float = 0.0
    start_pose: FloatArray = field(default_factory=lambda: np.full(7, np.nan))
    path_rmse: float | None = None
    path_error: float | None = None

    def __post_init__(self) -> None:
        for name in ("start_velocity", "goal_velocity"):
            if np.size(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.zeros(np.shape(self.start)))
        freeze(
            self,
            {
                "weights": ("n", "K"),
                "start": ("n",),
                "goal": ("n",),
                "goal_pose": (7,),
                "start_pose": (7,),
                "target": (3,),
                "start_velocity": ("n",),
                "goal_velocity": ("n",),
            },
        )
        self._check_leads()

    def _check_leads(self) -> None:
        """Refuse a movement that would jump from rest, or to it."""
        if self.kind == "joint_dmp" and (self.lead_in_s or self.lead_out_s):
            raise PlanError(f"{self.name}: a joint_dmp rests at its ends; got a lead there")
        moving = (self.start_velocity, "lead_in_s"), (self.goal_velocity, "lead_out_s")
        for velocity, lead in moving:
            if not np.any(velocity):
                continue
            if self.kind == "joint_dmp":
                raise PlanError(f"{self.name}: a joint_dmp rests at its ends; got a velocity there")
            if not getattr(self, lead) > 0:
                raise PlanError(
                    f"{self.name}: {lead}: got {getattr(self, lead):g} s, expected more than 0 "
                    "where the primitive moves at its end"
                )
        if not 0 <= self.lead_in_s + self.lead_out_s < self.duration:
            raise PlanError(
                f"{self.name}: duration: got {self.duration:g} s, expected more than the leads' "
                f"{self.lead_in_s + self.lead_out_s:g} s"
            )


@dataclass(frozen=True, eq=False)
class CartesianPlan(
    Record,
    stored_as="besman.records:CartesianPlan",
    finite=("weights", "start", "goal", "duration", "joints", "orientation_weight_m_rad"),
    distinct=("joint_names",),
    later=("path_rmse", "path_error"),
):
    """A dynamical movement primitive of the tool's pose, followed by inverse kinematics.

    It starts and ends at rest. See `besman.motion.cartesian_dmp` and `.joint_path`.

    Attributes
    ----------
    weights : array, shape (6, K)
        Weights of the forcing terms of x, y, z and of the rotation vector to the goal.
    start, goal : array, shape (7,)
        Poses of the tool centre point in the robot's world frame: position (m), unit quaternion
        wxyz. The quaternions' signs say which way round the tool turns: the short way where their
        scalar product is positive.
    duration : float
        Seconds.
    joints : array, shape (n,)
        Joint angles at the start, rad: the branch that inverse kinematics follows.
    joint_names : tuple of str, length n
    orientation_weight_m_rad : float
        One radian of orientation error weighs as much as this many metres, where the arm cannot
        have both.
    free_spin : bool
        The rotation about the tool's z axis does not matter.
    rmse : float
        Root mean square error of the imitation, rad, in joint space.
    goal_pose, start_pose, target, name, label, path_rmse, path_error
        As in `MotionPlan`.

    Raises
    ------
    PlanError
        If a quaternion has not the length 1, or the duration is not above zero.
    """

    weights: FloatArray
    start: FloatArray
    goal: FloatArray
    duration: float
    joints: FloatArray
    joint_names: tuple[str, ...]
    orientation_weight_m_rad: float
    free_spin: bool
    rmse: float
    goal_pose: FloatArray
    target: FloatArray
    name: str
    label: str
    kind: Literal["cartesian_dmp"] = "cartesian_dmp"
    start_pose: FloatArray = field(default_factory=lambda: np.full(7, np.nan))
    path_rmse: float | None = None
    path_error: float | None = None

    def __post_init__(self) -> None:
        freeze(
            self,
            {
                "weights": (6, "K"),
                "start": (7,),
                "goal": (7,),
                "joints": ("n",),
                "goal_pose": (7,),
                "start_pose": (7,),
                "target": (3,),
            },
        )
        if not self.duration > 0:
            raise PlanError(f"{self.name}: duration: got {self.duration:g} s, expected more than 0")
        for name in ("start", "goal"):
            length = float(np.linalg.norm(getattr(self, name)[3:]))
            if not abs(length - 1.0) <= 1e-6:
                raise PlanError(
                    f"{self.name}: {name}: got a quaternion of length {length:g}, expected 1"
                )


AnyPlan = MotionPlan | CartesianPlan
"""A motion plan of any kind."""
