"""Apply a template: a motion plan within all limits for a context that was never tried."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.motion.adapt_plan import retarget_plan
from besman.motion.rollout import sample_plan
from besman.records import AnyPlan
from besman.robot.limits import LimitReport, check_limits
from besman.robot.model import Robot
from besman.simulation.task import Task
from besman.templates.contexts import context_kind
from besman.templates.template import Forecast, Template, forecast, outside, with_name

FloatArray = npt.NDArray[np.float64]

# A duration that is this share longer than learnt is another movement.
_SLOWER = 0.01


@dataclass(frozen=True, eq=False)
class Application:
    """What a template gives for a context.

    Attributes
    ----------
    plan : MotionPlan or CartesianPlan
    time : array, shape (T,)
        Seconds, at 1 kHz.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.
    limits : LimitReport
        Without a violation or collision.
    forecast : Forecast
    warnings : tuple of str
        Why the forecast may not hold.
    wall_s : float
        How long it took.
    """

    plan: AnyPlan
    time: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    limits: LimitReport
    forecast: Forecast
    warnings: tuple[str, ...]
    wall_s: float


def apply_template(
    template: Template, robot: Robot, task: Task, context: npt.ArrayLike
) -> Application:
    """Return the motion plan for a context, slowed down where a limit requires it.

    Parameters
    ----------
    template : Template
    robot : Robot
        The template's, with its tool.
    task : Task
        The template's.
    context : array, shape (S,)

    Returns
    -------
    Application

    Raises
    ------
    RefinementError
        If the context has another number of coordinates or is not finite.
    PlanError
        If no duration brings the movement within the limits.
    """
    started = time.perf_counter()
    context = np.asarray(context, dtype=np.float64)
    family = template.family
    point = template.policy.means(context[None])
    task = task.aimed_by_plan()
    (learnt,) = family.plans(robot, context_kind(task), point, context[None])
    learnt = with_name(task.place(learnt, robot), family.names, context)
    try:
        plan = retarget_plan(learnt, robot)
    except PlanError as error:
        beyond = outside(template, context)
        where = f"; outside the region that was learnt: {beyond}" if beyond else ""
        raise PlanError(f"{error}{where}") from None
    moment, q, v, a = sample_plan(plan, robot)
    report = check_limits(robot, q, v, a)
    if report.violations or report.self_collisions:
        raise PlanError(
            f"{plan.name}: {report.violations} of {report.samples} samples beyond a limit, "
            f"{report.self_collisions} in collision; expected none"
        )
    expected = forecast(template, context)
    return Application(
        plan,
        moment,
        q,
        v,
        a,
        report,
        expected,
        tuple(_warnings(template, context, learnt, plan, expected)),
        time.perf_counter() - started,
    )


def _warnings(
    template: Template, context: FloatArray, learnt: AnyPlan, plan: AnyPlan, expected: Forecast
) -> list[str]:
    """Say why the forecast may not hold."""
    found = []
    beyond = outside(template, context)
    if beyond:
        found.append(f"outside the region that was learnt: {beyond}")
    stretch = plan.duration / learnt.duration
    if stretch > 1.0 + _SLOWER:
        found.append(f"slowed down by {100 * (stretch - 1):.0f} % to keep the limits of the arm")
    if not np.array_equal(plan.weights, learnt.weights):
        found.append("shape changed to keep the ranges of the joints")
    if expected.success < 0.5:
        found.append(f"{100 * expected.success:.0f} % of the tries nearby succeeded")
    return found
