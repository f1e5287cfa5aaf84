"""The stage that turns joint trajectories into motion plans."""

from __future__ import annotations

from abc import abstractmethod
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from besman.config.stage import Items, Positive, Stage, Truth, Work
from besman.exceptions import PlanError
from besman.geometry.frames import rotation_to_quaternion
from besman.motion.cartesian_dmp import fit_poses
from besman.motion.dmp_fit import fit_weights
from besman.motion.rest_at_ends import rest_at_both_ends
from besman.motion.velocity_dmp import fit_velocity_weights
from besman.records import AnyPlan, CartesianPlan, FloatArray, JointTrajectory, MotionPlan
from besman.robot.model import Robot

# A trajectory takes two milliseconds, a process two seconds to start.
_PROCESSES_FROM = 4000


class _DmpConfig(Stage):
    """What all kinds of motion plans share."""

    method: str
    n_weights: Annotated[int, Field(ge=6, le=1000)] | None = None
    error_mm: Positive = 1.0
    greatest_error_mm: Positive | None = 50.0
    lead_in_s: Annotated[float, Field(ge=0, le=2)] = 0.1
    lead_out_s: Annotated[float, Field(ge=0, le=2)] = 0.2

    leaves_out: ClassVar[bool] = True
    by_arm: ClassVar[bool] = False

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
            The arm with its tool; needed for Cartesian plans, and where the error of the tool
            tells the number of weights.
        work : Work
            Threads, processes and progress.

        Returns
        -------
        tuple of MotionPlan or CartesianPlan
            In the order of the trajectories.

        Raises
        ------
        PlanError
            If the robot is missing or another than the trajectories', or an imitation is farther
            from its trajectory than permitted.
        """
        imitate = partial(self._imitate, robot=robot)
        return tuple(work.map(imitate, trajectories, processes=_PROCESSES_FROM, local=True))

    def items(self, trajectories: tuple[JointTrajectory, ...], *others: Any) -> Items:
        """Count the trajectories: each becomes a motion."""
        return Items(len(trajectories), "motions")

    def figures(self, plans: tuple[AnyPlan, ...], truth: Truth, *records: Any) -> dict[str, Any]:
        """Return how far the plans are from what they imitate; see `imitate_results`."""
        return imitate_results(plans, self.error_mm)

    def _imitate(self, trajectory: JointTrajectory, robot: Robot | None) -> AnyPlan:
        """Fit one motion plan, with as many weights as its error asks for."""
        if robot is not None and robot.joint_names != trajectory.joint_names:
            raise self._needs_arm(trajectory, robot)
        if robot is None and self.by_arm:
            raise self._needs_arm(trajectory, robot)
        if robot is None and self.n_weights is None:
            raise self._needs_arm(trajectory, robot, " without n_weights")
        from besman.stages.imitate.accuracy import least_weights, measure_error, refuse_if_lost

        def imitate(n_weights: int) -> AnyPlan:
            plan = self._fit(trajectory, robot, n_weights)
            return measure_error(plan, trajectory, self.lead_in_s, robot)

        if self.n_weights is not None:
            plan = imitate(self.n_weights)
        else:
            plan = least_weights(imitate, len(trajectory.time), 1e-3 * self.error_mm)
        greatest = self.greatest_error_mm
        refuse_if_lost(plan, None if greatest is None else 1e-3 * greatest)
        return plan

    @abstractmethod
    def _fit(self, trajectory: JointTrajectory, robot: Robot | None, n_weights: int) -> AnyPlan:
        """Fit one motion plan of so many weights."""

    def _needs_arm(
        self, trajectory: JointTrajectory, robot: Robot | None, where: str = ""
    ) -> PlanError:
        """Say that the arm is missing, or another one."""
        got = "none" if robot is None else f"{robot.name}: {', '.join(robot.joint_names)}"
        return PlanError(
            f"{trajectory.name}: method {self.method}{where} needs the arm with the joints "
            f"{', '.join(trajectory.joint_names)}; got {got}"
        )

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
    n_weights : int, optional
        Weights per joint; null for as many as `error_mm` asks for.
    error_mm : float
        The imitation's tool is nowhere farther from where the mapped trajectory has it at the same
        time; the least of 20, 30, 40, 60, 80, ... 960 weights that reach this are taken. What
        misses it, as a fixed number may, is said in the run's table and report.
    greatest_error_mm : float, optional
        What is farther is not imitated but left out, and says so; null for any.
    lead_in_s, lead_out_s : float
        A motion plan starts and ends at rest, a demonstration need not: the plan speeds up and
        slows down in this time before and after it. With 0 it does so within the demonstration,
        and is then at the demonstration's own start and end.
    """

    method: Literal["joint_dmp"] = "joint_dmp"

    def _fit(self, trajectory: JointTrajectory, robot: Robot | None, n_weights: int) -> MotionPlan:
        time, positions = self._at_rest_at_ends(trajectory)
        weights = fit_weights(time, positions, n_weights)
        return MotionPlan(
            weights=weights,
            start=positions[0],
            goal=positions[-1],
            duration=float(time[-1]),
            joint_names=trajectory.joint_names,
            rmse=0.0,
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
    n_weights : int, optional
        Weights per joint; null for as many as `error_mm` asks for.
    error_mm : float
        The imitation's tool is nowhere farther from where the mapped trajectory has it at the same
        time; the least of 20, 30, 40, 60, 80, ... 960 weights that reach this are taken. What
        misses it, as a fixed number may, is said in the run's table and report.
    greatest_error_mm : float, optional
        What is farther is not imitated but left out, and says so; null for any.
    lead_in_s, lead_out_s : float
        In this time before and after the primitive the arm speeds up from rest and slows down to
        it. With 0 the primitive itself starts or ends at rest.
    """

    method: Literal["joint_dmp_velocity"]

    def _fit(self, trajectory: JointTrajectory, robot: Robot | None, n_weights: int) -> MotionPlan:
        first = trajectory.velocities[0] * (self.lead_in_s > 0)
        last = trajectory.velocities[-1] * (self.lead_out_s > 0)
        weights = fit_velocity_weights(
            trajectory.time, trajectory.positions, first, last, n_weights
        )
        return MotionPlan(
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
    n_weights : int, optional
        Weights per coordinate; null for as many as `error_mm` asks for.
    error_mm, greatest_error_mm, lead_in_s, lead_out_s : float
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

    by_arm: ClassVar[bool] = True

    def _fit(
        self, trajectory: JointTrajectory, robot: Robot | None, n_weights: int
    ) -> CartesianPlan:
        from besman.robot.kinematics import forward_kinematics

        assert robot is not None
        time, positions = self._at_rest_at_ends(trajectory)
        reached = forward_kinematics(robot.chain, positions)
        poses = np.column_stack([reached[:, :3, 3], rotation_to_quaternion(reached[:, :3, :3])])
        weights, start, goal = fit_poses(time, poses, n_weights)
        return CartesianPlan(
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


def imitate_results(plans: tuple[AnyPlan, ...], error_mm: float) -> dict[str, Any]:
    """Give the stage's figures for ``results.json``.

    Parameters
    ----------
    plans : tuple of MotionPlan or CartesianPlan
    error_mm : float
        The error that was asked for.

    Returns
    -------
    dict
        rmse_rad {mean, max}; position_error_m {rms, max} over the motions, at the same time, null
        where it is not known; n_weights {min, max}; wanted_error_m; beyond, the names of those
        whose greatest error is above it.
    """
    errors = [plan.rmse for plan in plans]
    known = [plan for plan in plans if plan.path_error is not None and plan.path_rmse is not None]
    rms = np.array([plan.path_rmse for plan in known], dtype=np.float64)
    most = np.array([plan.path_error for plan in known], dtype=np.float64)
    numbers = [plan.weights.shape[1] for plan in plans]
    return {
        "rmse_rad": {"mean": float(np.mean(errors)), "max": float(np.max(errors))},
        "position_error_m": {
            "rms": float(np.sqrt(np.mean(rms**2))) if known else None,
            "max": float(most.max()) if known else None,
        },
        "n_weights": {"min": min(numbers), "max": max(numbers)},
        "wanted_error_m": 1e-3 * error_mm,
        "beyond": [
            plan.name for plan, error in zip(known, most, strict=True) if error > 1e-3 * error_mm
        ],
    }
