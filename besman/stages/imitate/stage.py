"""The stage that turns joint trajectories into motion plans."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from besman.config.stage import Items, Stage, Truth, Work
from besman.exceptions import PlanError
from besman.geometry.frames import rotation_to_quaternion
from besman.motion.cartesian_dmp import fit_poses
from besman.motion.dmp import fit_weights, roll_out
from besman.motion.rest_at_ends import rest_at_both_ends
from besman.motion.velocity_dmp import fit_velocity_weights
from besman.records import AnyPlan, CartesianPlan, FloatArray, JointTrajectory, MotionPlan
from besman.robot.model import Robot

# A trajectory takes two milliseconds, a process two seconds to start.
_PROCESSES_FROM = 4000


class _DmpConfig(Stage):
    """What all kinds of motion plans share."""

    n_weights: Annotated[int, Field(ge=6, le=100)] = 20
    lead_in_s: Annotated[float, Field(ge=0, le=2)] = 0.1
    lead_out_s: Annotated[float, Field(ge=0, le=2)] = 0.2

    leaves_out: ClassVar[bool] = True

    def run(
        self,
        trajectories: tuple[JointTrajectory, ...],
        robot: Robot | None = None,
        work: Work = Work(),
    ) -> tuple[AnyPlan, ...]:
        """Fit one motion plan per trajectory; a plan's movement starts and ends at rest.

        Parameters
        ----------
        trajectories : tuple of JointTrajectory
            What to imitate.
        robot : Robot, optional
            The arm with its tool; needed for Cartesian plans only.
        work : Work
            Threads, processes and progress.

        Returns
        -------
        tuple of MotionPlan or CartesianPlan
            In the order of the trajectories.

        Raises
        ------
        PlanError
            If the robot is missing or another than the trajectories'.
        """
        imitate = partial(self._imitate, robot=robot)
        return tuple(work.map(imitate, trajectories, processes=_PROCESSES_FROM, local=True))

    def items(self, trajectories: tuple[JointTrajectory, ...], *others: Any) -> Items:
        """Count the trajectories: each becomes a motion."""
        return Items(len(trajectories), "motions")

    def figures(self, plans: tuple[AnyPlan, ...], truth: Truth, *records: Any) -> dict[str, Any]:
        """Return how far the plans are from what they imitate; see `imitate_results`."""
        return imitate_results(plans)

    @abstractmethod
    def _imitate(self, trajectory: JointTrajectory, robot: Robot | None) -> AnyPlan:
        """Fit one motion plan."""

    def _at_rest_at_ends(self, trajectory: JointTrajectory) -> tuple[FloatArray, FloatArray]:
        """Lengthen a trajectory so that it starts and ends at rest."""
        return rest_at_both_ends(
            trajectory.time,
            trajectory.positions,
            trajectory.velocities,
            self.lead_in_s,
            self.lead_out_s,
        )


class ImitateConfig(_DmpConfig):
    """Imitate every joint trajectory by a DMP in joint space, at rest at its ends.

    Attributes
    ----------
    method : "joint_dmp"
        One DMP for all joints of the arm.
    n_weights : int
        Weights per joint.
    lead_in_s, lead_out_s : float
        A motion plan starts and ends at rest, a demonstration need not: the plan speeds up and
        slows down in this time before and after it. With 0 it does so within the demonstration,
        and is then at the demonstration's own start and end.
    """

    method: Literal["joint_dmp"] = "joint_dmp"

    def _imitate(self, trajectory: JointTrajectory, robot: Robot | None) -> MotionPlan:
        time, positions = self._at_rest_at_ends(trajectory)
        weights = fit_weights(time, positions, self.n_weights)
        imitated, _, _ = roll_out(
            weights, positions[0], positions[-1], time[-1], trajectory.time + self.lead_in_s
        )
        return MotionPlan(
            weights=weights,
            start=positions[0],
            goal=positions[-1],
            duration=float(time[-1]),
            joint_names=trajectory.joint_names,
            rmse=_rmse(imitated, trajectory),
            goal_pose=trajectory.poses[-1],
            start_pose=trajectory.poses[0],
            target=trajectory.target,
            name=trajectory.name,
            label=trajectory.label,
        )


class VelocityDmpConfig(_DmpConfig):
    """Imitate every joint trajectory by a DMP that passes its goal with the demonstrated velocity.

    Attributes
    ----------
    method : "joint_dmp_velocity"
        The primitive is the demonstration alone; goal and goal velocity are where and how it ends.
    n_weights : int
        Weights per joint.
    lead_in_s, lead_out_s : float
        In this time before and after the primitive the arm speeds up from rest and slows down to
        it. With 0 the primitive itself starts or ends at rest.
    """

    method: Literal["joint_dmp_velocity"]

    def _imitate(self, trajectory: JointTrajectory, robot: Robot | None) -> MotionPlan:
        from besman.motion.rollout import roll_out_plans

        first = trajectory.velocities[0] * (self.lead_in_s > 0)
        last = trajectory.velocities[-1] * (self.lead_out_s > 0)
        weights = fit_velocity_weights(
            trajectory.time, trajectory.positions, first, last, self.n_weights
        )
        plan = MotionPlan(
            weights=weights,
            start=trajectory.positions[0],
            goal=trajectory.positions[-1],
            duration=float(self.lead_in_s + trajectory.time[-1] + self.lead_out_s),
            joint_names=trajectory.joint_names,
            rmse=0.0,
            goal_pose=trajectory.poses[-1],
            start_pose=trajectory.poses[0],
            target=trajectory.target,
            name=trajectory.name,
            label=trajectory.label,
            kind="joint_dmp_velocity",
            start_velocity=first,
            goal_velocity=last,
            lead_in_s=self.lead_in_s,
            lead_out_s=self.lead_out_s,
        )
        imitated, _, _ = roll_out_plans([plan], self.lead_in_s + trajectory.time)
        return replace(plan, rmse=_rmse(imitated[0], trajectory))


class CartesianDmpConfig(_DmpConfig):
    """Imitate the tool's movement by a DMP of its pose, followed by inverse kinematics.

    Imitated are the poses that the mapped joint trajectory reaches. Refinement searches over goal
    pose, duration and weights of the Cartesian plan itself; at every step of the search, in
    simulation and in what is exported, the movement is the plan's own rollout after inverse
    kinematics.

    Attributes
    ----------
    method : "cartesian_dmp"
        One DMP for position and orientation of the tool centre point.
    n_weights : int
        Weights per coordinate.
    lead_in_s, lead_out_s : float
        As in `ImitateConfig`.
    orientation_weight_m_rad : float
        One radian of orientation error weighs as much as this many metres, where the arm cannot
        have both.
    free_axis_spin : bool
        The rotation about the tool's axis does not matter, e.g. for a stick.
    """

    method: Literal["cartesian_dmp"]
    orientation_weight_m_rad: Annotated[float, Field(gt=0)] = 0.1
    free_axis_spin: bool = False

    def _imitate(self, trajectory: JointTrajectory, robot: Robot | None) -> CartesianPlan:
        from besman.motion.rollout import roll_out_plans
        from besman.robot.kinematics import forward_kinematics

        if robot is None or robot.joint_names != trajectory.joint_names:
            got = "none" if robot is None else f"{robot.name}: {', '.join(robot.joint_names)}"
            raise PlanError(
                f"{trajectory.name}: method cartesian_dmp needs the arm with the joints "
                f"{', '.join(trajectory.joint_names)}; got {got}"
            )
        time, positions = self._at_rest_at_ends(trajectory)
        reached = forward_kinematics(robot.chain, positions)
        poses = np.column_stack([reached[:, :3, 3], rotation_to_quaternion(reached[:, :3, :3])])
        weights, start, goal = fit_poses(time, poses, self.n_weights)
        plan = CartesianPlan(
            weights=weights,
            start=start,
            goal=goal,
            duration=float(time[-1]),
            joints=positions[0],
            joint_names=trajectory.joint_names,
            orientation_weight_m_rad=self.orientation_weight_m_rad,
            free_spin=self.free_axis_spin,
            rmse=0.0,
            goal_pose=trajectory.poses[-1],
            start_pose=trajectory.poses[0],
            target=trajectory.target,
            name=trajectory.name,
            label=trajectory.label,
        )
        imitated, _, _ = roll_out_plans([plan], self.lead_in_s + trajectory.time, robot)
        return replace(plan, rmse=_rmse(imitated[0], trajectory))


def _rmse(imitated: FloatArray, trajectory: JointTrajectory) -> float:
    """Return the root mean square error over samples and joints, rad."""
    return float(np.sqrt(np.mean((imitated - trajectory.positions) ** 2)))


def imitate_results(plans: tuple[AnyPlan, ...]) -> dict[str, Any]:
    """Give the stage's figures for ``results.json``: rmse_rad {mean, max}."""
    errors = [plan.rmse for plan in plans]
    return {"rmse_rad": {"mean": float(np.mean(errors)), "max": float(np.max(errors))}}
