"""How far the tool of an imitation is from what it imitates, and how many weights that takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.motion.fit_within_limits import fit_within_limits
from besman.motion.rollout import least_duration, roll_out_plans
from besman.records import AnyPlan, BlockPlan, JointTrajectory, MotionPlan, TaskPlan
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

# A plan that its limits make longer by less than this share is not fitted anew; one that is may
# have so many times the weights.
_AS_LONG, _MORE_WEIGHTS = 1.001, 4
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


def within_limits(
    plan: MotionPlan,
    trajectory: JointTrajectory,
    movement: tuple[FloatArray, FloatArray],
    since_s: float,
    robot: Robot,
    wanted_m: float,
    most: int | None = None,
) -> MotionPlan:
    """Return a plan as close to what it imitates that need not be slowed down for a limit.

    Parameters
    ----------
    plan : MotionPlan
        By least squares alone.
    trajectory : JointTrajectory
        What it imitates.
    movement : two arrays, shapes (T,) and (T, n)
        The same from rest to rest, seconds and rad.
    since_s : float
        When the trajectory begins in it, seconds.
    robot : Robot
    wanted_m : float
        Greatest distance of the tool at the same time, metres, unless the plan's is larger.
    most : int, optional
        How many numbers of weights are tried, from the plan's own on.

    Returns
    -------
    MotionPlan
        The plan itself if it keeps the limits, or none does that is as close.
    """
    limits, own = robot.limits, least_duration(plan, robot.limits)
    if own <= _AS_LONG * plan.duration:
        return plan
    number = plan.weights.shape[1]
    numbers = [n for n in NUMBERS if number < n <= _MORE_WEIGHTS * number]
    for n in [number, *numbers][:most]:
        weights = fit_within_limits(*movement, n, limits.velocity, limits.acceleration)
        kept = measure_error(replace(plan, weights=weights), trajectory, since_s, robot)
        close = _error_m(kept) <= max(wanted_m, _error_m(plan))
        if close and least_duration(kept, limits) < own:
            return kept
    return plan


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
