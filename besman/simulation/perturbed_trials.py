"""Try motion plans where the model is wrong, and at a finer time step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.episodes import Movements
from besman.simulation.perturbation import Perturbation
from besman.simulation.task import Task
from besman.simulation.trial import Trial, try_movements

# As many movements in a batch as a search has; see `besman.simulation.trial`.
_BLOCK = 8
_FINER = 4


def try_perturbed(
    robot: Robot, task: Task, plan: AnyPlan, perturbations: Sequence[Perturbation]
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

    Returns
    -------
    list of Trial
        In the order of the perturbations.
    """
    task = lenient_task(task)
    movement = task.move([plan], robot)
    trials: list[Trial] = []
    for first in range(0, len(perturbations), _BLOCK):
        block = tuple(perturbations[first : first + _BLOCK])
        movements = replace(repeat(movement, len(block)), perturbations=block)
        trials += try_movements(robot, task, [plan] * len(block), movements)
    return trials


def repeat(movement: Movements, n: int) -> Movements:
    """Return a batch of n times the same movement."""
    return Movements(
        positions=np.repeat(movement.positions, n, axis=0),
        velocities=np.repeat(movement.velocities, n, axis=0),
        accelerations=np.repeat(movement.accelerations, n, axis=0),
        durations=np.repeat(movement.durations, n),
        ends=None if movement.ends is None else np.repeat(movement.ends, n),
    )


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
