"""Whole tasks in simulation: the gripper brought to their boxes, and what comes of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from besman.config.stage import Items, Truth, Work
from besman.exceptions import PlanError
from besman.records import RefinedTask, TaskPlan, TaskTrial
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.stages.refine.one_task import refine_task
from besman.stages.refine.stage import RefinementConfig


class _TaskStep:
    """A step that takes whole tasks one by one, whose config says what becomes of those that fail.

    Parameters
    ----------
    config : RefinementConfig
        Nothing else of it matters here.
    """

    def __init__(self, config: RefinementConfig) -> None:
        self.config = config

    def items(self, first: tuple[Any, ...], *records: Any) -> Items:
        """Count the tasks."""
        return Items(len(first), "tasks")


class AimTasks(_TaskStep):
    """Brings the goals of whole tasks to where the task's gripper takes and puts its boxes."""

    def run(
        self,
        plans: tuple[TaskPlan, ...],
        robot: Robot,
        task: RearrangeConfig,
        work: Work = Work(),
    ) -> tuple[TaskPlan, ...]:
        """Return the plans for the gripper, the first way that touches nothing.

        See `besman.motion.grasp_goals.lead_grasps` for what a way is. Where all of them touch
        something, it is the one that does so least.

        Raises
        ------
        RefinementError
            If the plans and the robot do not belong to the task.
        PlanError
            If no task is within the arm's reach and limits then.
        """
        task.check(plans, robot)
        frame = task.box_frame(plans, robot)

        def aim(plan: TaskPlan) -> TaskPlan:
            faults: list[PlanError] = []
            for _, aimed in task.aim(plan, robot, frame, lambda _, error: faults.append(error)):
                return aimed
            raise faults[0]

        here = replace(work, jobs=1, workers=None)
        return tuple(here.map(aim, plans, name=lambda plan: plan.name))

    def figures(self, aimed: tuple[TaskPlan, ...], truth: Truth, *records: Any) -> dict[str, Any]:
        """Return how many are within reach, and how long each takes."""
        return {
            "n_tasks": len(aimed),
            "duration_s": {plan.name: plan.duration for plan in aimed},
        }


class SimulateTasks(_TaskStep):
    """Tries whole tasks in simulation, as they were imitated."""

    def run(
        self,
        aimed: tuple[TaskPlan, ...],
        plans: tuple[TaskPlan, ...],
        robot: Robot,
        task: RearrangeConfig,
        work: Work = Work(),
    ) -> tuple[TaskTrial, ...]:
        """Return what comes of each task.

        Parameters
        ----------
        aimed : tuple of TaskPlan
            What `AimTasks` gave.
        plans : tuple of TaskPlan
            What it was given: they tell where the boxes are in the frames of their markers.
        robot : Robot
        task : RearrangeConfig
        work : Work
        """
        return tuple(task.try_tasks(aimed, robot, task.box_frame(plans, robot), work.jobs))

    def figures(
        self,
        trials: tuple[TaskTrial, ...],
        truth: Truth,
        aimed: tuple[TaskPlan, ...],
        plans: tuple[TaskPlan, ...],
        robot: Robot,
        task: RearrangeConfig,
    ) -> dict[str, Any]:
        """Return how many succeed, and how far off each is; see `simulation_results`."""
        return simulation_results(trials, len(plans), task)


class RefineTasks(_TaskStep):
    """Tries other ways of whole tasks, and searches them block by block, until each succeeds.

    See `besman.stages.refine.one_task.refine_task`.
    """

    def run(
        self,
        aimed: tuple[TaskPlan, ...],
        trials: tuple[TaskTrial, ...],
        plans: tuple[TaskPlan, ...],
        robot: Robot,
        task: RearrangeConfig,
        work: Work = Work(),
    ) -> tuple[RefinedTask, ...]:
        """Return the tasks with the way that succeeds, or misses least.

        Parameters
        ----------
        aimed, trials : tuple
            Of `AimTasks` and `SimulateTasks`: what succeeded stays.
        plans : tuple of TaskPlan
            As they were imitated.
        robot : Robot
        task : RearrangeConfig
        work : Work

        Raises
        ------
        PlanError
            If no way of any task is within the arm's reach and limits.
        """
        frame = task.box_frame(plans, robot)
        pairs = zip(aimed, trials, strict=True)
        first = {plan.name: RefinedTask(plan, trial, 1) for plan, trial in pairs}

        def refine(plan: TaskPlan) -> RefinedTask:
            return refine_task(plan, first.get(plan.name), robot, task, frame, work.checkpoints)

        here = replace(work, workers=None)
        return tuple(here.map(refine, plans, name=lambda plan: plan.name))

    def items(self, aimed: Any, trials: Any, *records: Any) -> Items:
        """Count the tasks."""
        return super().items(*records)

    def figures(
        self,
        refined: tuple[RefinedTask, ...],
        truth: Truth,
        aimed: tuple[TaskPlan, ...],
        trials: tuple[TaskTrial, ...],
        plans: tuple[TaskPlan, ...],
        robot: Robot,
        task: RearrangeConfig,
    ) -> dict[str, Any]:
        """Return what `simulation_results` does, and how many simulations each has taken."""
        told = simulation_results(tuple(one.trial for one in refined), len(plans), task)
        return told | {"tries": {one.plan.name: one.tries for one in refined}}


def simulation_results(
    trials: tuple[TaskTrial, ...], n_tasks: int, task: RearrangeConfig
) -> dict[str, Any]:
    """Give the figures of simulated tasks for ``results.json``.

    Parameters
    ----------
    trials : tuple of TaskTrial
    n_tasks : int
        How many were imitated: those that could not be tried have not succeeded.
    task : RearrangeConfig

    Returns
    -------
    dict
        n_tasks, n_tried, n_success, success_radius_m, success_angle_deg, miss_m {median, max} and
        angle_deg {median, max} of those that nothing failed in, null where there is none; trials by
        name: success, failure, miss_m, angle_deg, duration_s.
    """
    done = [trial for trial in trials if not trial.failure]

    def spread(values: list[float]) -> dict[str, float | None]:
        if not values:
            return {"median": None, "max": None}
        return {"median": float(np.median(values)), "max": float(np.max(values))}

    return {
        "n_tasks": n_tasks,
        "n_tried": len(trials),
        "n_success": sum(trial.success for trial in trials),
        "success_radius_m": task.success.success_radius_m,
        "success_angle_deg": task.success.success_angle_deg,
        "miss_m": spread([trial.miss for trial in done]),
        "angle_deg": spread([float(np.degrees(trial.angle)) for trial in done]),
        "trials": {
            trial.name: {
                "success": trial.success,
                "failure": trial.failure,
                "miss_m": trial.miss if np.isfinite(trial.miss) else None,
                "angle_deg": float(np.degrees(trial.angle)) if np.isfinite(trial.angle) else None,
                "duration_s": trial.duration,
            }
            for trial in trials
        },
    }
