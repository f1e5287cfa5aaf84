"""Try motion plans where the model is wrong, and at a finer time step."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.episodes import repeat_movement
from besman.simulation.perturbation import Perturbation
from besman.simulation.task import Task
from besman.simulation.trial import Trial, try_movements, try_plans

# As many movements in a batch as a search has; see `besman.simulation.trial`.
_BLOCK = 8
_FINER = 4


def try_perturbed(
    robot: Robot, task: Task, plan: AnyPlan, perturbations: Sequence[Perturbation], jobs: int = 1
) -> list[Trial]:
    """Try one motion plan in perturbed worlds.

    An arm that is late or beside its movement has not failed for that: what comes of it counts.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : Task
        What is to be done.
    plan : MotionPlan or CartesianPlan
    perturbations : sequence of Perturbation
    jobs : int
        Threads; results do not depend on it.

    Returns
    -------
    list of Trial
        In the order of the perturbations.
    """
    task = lenient_task(task)
    movement = task.move([plan], robot)
    size = min(_BLOCK, -(-len(perturbations) // jobs))

    def try_block(first: int) -> list[Trial]:
        block = tuple(perturbations[first : first + size])
        movements = replace(repeat_movement(movement, len(block)), perturbations=block)
        return try_movements(robot, task, [plan] * len(block), movements)

    blocks = range(0, len(perturbations), max(size, 1))
    if jobs == 1:
        return [trial for first in blocks for trial in try_block(first)]
    with ThreadPoolExecutor(jobs) as threads:
        return [trial for block in threads.map(try_block, blocks) for trial in block]


def quarter_step_shift(robot: Robot, task: Task, plan: AnyPlan) -> float:
    """Return how far the outcome moves at a quarter of the time step.

    Contacts are as much stiffer, so that both errors of the coarse simulation show.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : Task
        What is to be done.
    plan : MotionPlan or CartesianPlan

    Returns
    -------
    float
        Metres; NaN if one of the two has no outcome.
    """
    outcomes = [
        try_movements(robot, one, [plan], one.move([plan], robot))[0].outcome
        for one in (task, finer_task(task))
    ]
    return float(np.linalg.norm(outcomes[1] - outcomes[0]))


def try_finely(robot: Robot, task: Task, plans: Sequence[AnyPlan]) -> list[Trial]:
    """Try plans at a quarter of the time step; what comes of them counts, however they go.

    Contacts are as much stiffer: how far they push an arm aside is no measure of the plan.
    """
    return try_plans(robot, lenient_task(finer_task(task)), plans) if plans else []


def finer_task(task: Task) -> Task:
    """Return a task with a quarter of its time step and of its contacts' time constant."""
    times = {
        name: getattr(task.simulation, name) / _FINER
        for name in ("time_step_s", "contact_time_s")
        if hasattr(task.simulation, name)
    }
    return task.model_copy(update={"simulation": task.simulation.model_copy(update=times)})


def lenient_task(task: Task) -> Task:
    """Return a task in which an arm that is late or beside its movement has not failed for that."""
    lenient = task.failure.model_copy(update={"greatest_tracking_error_rad": float(np.pi)})
    return task.model_copy(update={"failure": lenient})
