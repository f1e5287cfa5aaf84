"""The stage that turns joint trajectories into motion plans."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from besman.imitation.dmp import fit_weights, roll_out
from besman.imitation.leads import add_leads
from besman.records import JointTrajectory, MotionPlan
from besman.stage import Stage, Work


class ImitateConfig(Stage):
    """Imitate every joint trajectory by a DMP in joint space.

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
    n_weights: Annotated[int, Field(ge=6, le=100)] = 20
    lead_in_s: Annotated[float, Field(ge=0, le=2)] = 0.1
    lead_out_s: Annotated[float, Field(ge=0, le=2)] = 0.2

    def run(
        self, trajectories: tuple[JointTrajectory, ...], work: Work = Work()
    ) -> tuple[MotionPlan, ...]:
        """Fit one motion plan per trajectory; a plan starts and ends at rest.

        Parameters
        ----------
        trajectories : tuple of JointTrajectory
            What to imitate.
        work : Work
            Progress.

        Returns
        -------
        tuple of MotionPlan
            In the order of the trajectories.
        """
        plans = []
        for index, trajectory in enumerate(trajectories):
            plans.append(self._imitate(trajectory))
            work.progress((index + 1) / len(trajectories))
        return tuple(plans)

    def _imitate(self, trajectory: JointTrajectory) -> MotionPlan:
        time, positions = add_leads(
            trajectory.time,
            trajectory.positions,
            trajectory.velocities,
            self.lead_in_s,
            self.lead_out_s,
        )
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
            rmse=float(np.sqrt(np.mean((imitated - trajectory.positions) ** 2))),
            goal_pose=trajectory.poses[-1],
            target=trajectory.target,
            name=trajectory.name,
            label=trajectory.label,
        )


def imitate_results(plans: tuple[MotionPlan, ...]) -> dict[str, Any]:
    """Give the stage's figures for ``results.json``: rmse_rad {mean, max}."""
    errors = [plan.rmse for plan in plans]
    return {"rmse_rad": {"mean": float(np.mean(errors)), "max": float(np.max(errors))}}
