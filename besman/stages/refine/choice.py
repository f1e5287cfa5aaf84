"""Which motions are refined where not all are, which episodes are kept where not all are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.task import Task
from besman.simulation.trial import try_plans

# How many episodes on the way are kept with their plans.
_MILESTONES = 5


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


def pick_milestones(ranks: Sequence[tuple[float, ...]]) -> list[int]:
    """Return some of the episodes that were the best so far, first and last among them.

    `ranks` say how good each was.
    """
    best = [at for at in range(len(ranks)) if not at or ranks[at] > max(ranks[:at])]
    rows = np.rint(np.linspace(0, len(best) - 1, min(len(best), _MILESTONES))).astype(int)
    return [best[row] for row in rows]
