"""What a search begins with: an imitation with its task's target and beginning."""

from __future__ import annotations

import numpy as np

from besman.exceptions import RefinementError
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.task import Task


def place_plan(plan: AnyPlan, robot: Robot, task: Task) -> AnyPlan:
    """Give a plan the task's target.

    Raises
    ------
    RefinementError
        If it belongs to another robot or task.
    """
    if plan.joint_names != robot.joint_names:
        raise RefinementError(
            f"{plan.name}: plan for joints {', '.join(plan.joint_names)}; robot "
            f"{robot.name} has {', '.join(robot.joint_names)}"
        )
    plan = task.place(plan, robot)
    if not np.isfinite(task.wanted(plan)).all():
        raise RefinementError(f"{plan.name}: task {task.kind} needs a {task.needs}, got none")
    return plan


def begin_plan(plan: AnyPlan, robot: Robot, task: Task) -> AnyPlan:
    """Give a plan the task's target, and let it begin as the task has it; see `place_plan`.

    Of what it returns it returns the same.
    """
    return task.search_start(place_plan(plan, robot, task), robot)
