"""Which motions are refined where not all are: those whose imitation comes nearest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.task import Task
from besman.simulation.trial import try_plans


def nearest_plans(
    plans: Sequence[AnyPlan], robot: Robot, task: Task, count: int, jobs: int = 1
) -> tuple[AnyPlan, ...]:
    """Return the plans that come nearest to their targets as they are.

    Parameters
    ----------
    plans : sequence of MotionPlan or CartesianPlan
        With the task's target.
    robot : Robot
    task : Task
    count : int
        How many are wanted.
    jobs : int
        Threads.

    Returns
    -------
    tuple of MotionPlan or CartesianPlan
        In their order. What fails comes after all that do not.
    """
    if len(plans) <= count:
        return tuple(plans)
    trials = try_plans(robot, task, plans, jobs)
    misses = [np.inf if trial.failure else trial.miss for trial in trials]
    order = np.argsort(np.nan_to_num(misses, nan=np.inf), kind="stable")[:count]
    return tuple(plans[index] for index in sorted(order))
