"""How far the tool of an imitation is from what it imitates, and how many weights that takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np

from besman.exceptions import PlanError
from besman.motion.rollout import roll_out_plans
from besman.records import AnyPlan, BlockPlan, JointTrajectory, TaskPlan
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot

# Each number is half as much again as the one before, or a third: least squares over all of them
# costs little more than over the last.
NUMBERS = (20, 30, 40, 60, 80, 120, 160, 240, 320, 480, 640, 960)


def measure_error(
    plan: AnyPlan, trajectory: JointTrajectory, since_s: float, robot: Robot | None
) -> AnyPlan:
    """Write into a plan how far its movement is from what it imitates, at the same time.

    Parameters
    ----------
    plan : MotionPlan or CartesianPlan
    trajectory : JointTrajectory
        What it imitates.
    since_s : float
        When the trajectory begins in the plan's movement, seconds.
    robot : Robot, optional
        The arm with its tool; without one the distance of the tool is not known.

    Returns
    -------
    MotionPlan or CartesianPlan
        With `rmse` (rad), `path_rmse` and `path_error` (metres).
    """
    imitated, _, _ = roll_out_plans([plan], since_s + trajectory.time, robot)
    rmse = float(np.sqrt(np.mean((imitated[0] - trajectory.positions) ** 2)))
    if robot is None:
        return replace(plan, rmse=rmse)
    there, here = (
        forward_kinematics(robot.chain, angles)[:, :3, 3]
        for angles in (imitated[0], trajectory.positions)
    )
    square = np.sum((there - here) ** 2, axis=1)
    return replace(
        plan,
        rmse=rmse,
        path_rmse=float(np.sqrt(square.mean())),
        path_error=float(np.sqrt(square.max())),
    )


class Imitation(Protocol):
    """What knows how far its tool is from what it imitates."""

    @property
    def path_error(self) -> float | None:
        """Greatest distance at the same time, metres."""


ImitationT = TypeVar("ImitationT", bound=Imitation)


def least_weights(
    imitate: Callable[[int], ImitationT], n_samples: int, wanted_m: float
) -> ImitationT:
    """Imitate with the least number of weights whose error is as small as wanted.

    Parameters
    ----------
    imitate : callable
        Gives the measured plan, or block of one, of so many weights.
    n_samples : int
        Of what is imitated; there are no more weights than that, but for the first number.
    wanted_m : float
        Greatest distance of the tool at the same time, metres.

    Returns
    -------
    MotionPlan, CartesianPlan or BlockPlan
        The one with the smallest error, if none is as good as wanted.
    """
    best: ImitationT | None = None
    for number in NUMBERS:
        if best is not None and number > n_samples:
            break
        plan = imitate(number)
        if best is None or _error_m(plan) < _error_m(best):
            best = plan
        if _error_m(best) <= wanted_m:
            break
    assert best is not None
    return best


def _error_m(plan: Imitation) -> float:
    """Return the greatest distance, metres."""
    assert plan.path_error is not None
    return plan.path_error


def refuse_if_lost(plan: AnyPlan, greatest_m: float | None) -> None:
    """Refuse a plan that is farther from what it imitates than is permitted.

    Raises
    ------
    PlanError
        With the error, the number of weights and what would help.
    """
    _refuse_if_beyond(plan, plan.name, greatest_m)


def refuse_if_task_lost(plan: TaskPlan, greatest_m: float | None) -> None:
    """Refuse a task of which a block is farther from what it imitates than is permitted.

    Raises
    ------
    PlanError
        As of `refuse_if_lost`; it names the block.
    """
    for block in plan.blocks:
        _refuse_if_beyond(block, f"{plan.name}: {block.label}", greatest_m)


def _refuse_if_beyond(plan: AnyPlan | BlockPlan, name: str, greatest_m: float | None) -> None:
    """Raise a PlanError if an imitation is farther off than permitted."""
    if greatest_m is None or plan.path_error is None or plan.path_error <= greatest_m:
        return
    raise PlanError(
        f"{name}: not imitated: {plan.weights.shape[1]} weights for {plan.duration:.1f} s "
        f"leave the tool up to {1e3 * plan.path_error:.1f} mm beside the mapped path, allowed: "
        f"{1e3 * greatest_m:g} mm (imitate.greatest_error_mm); more weights follow closer "
        "(imitate.n_weights: null takes as many as imitate.error_mm asks for)"
    )
