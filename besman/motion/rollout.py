"""The joint movements of motion plans of every kind: rollout, stretching, least duration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar, cast

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.motion.dmp import interpolate, respond, roll_out
from besman.motion.forcing import count_nodes
from besman.motion.velocity_dmp import roll_out_velocity
from besman.records import AnyPlan, CartesianPlan, MotionPlan
from besman.robot.limits import time_stretch
from besman.robot.model import Robot
from besman.robot.parts import JointLimits

FloatArray = npt.NDArray[np.float64]

Plan = TypeVar("Plan", bound=AnyPlan)

RATE_HZ = 1000.0
# The acceleration of more weights than these has peaks between nodes, which those do not show.
_SMOOTH_AT_NODES, _PLACES_A_WEIGHT = 20, 60
_PLACES_A_NODE = 2
# A movement is looked at in 501 or more places; between them it can be this much faster.
_MARGIN = 1.0 + 5e-4
_MARGIN_OF_PATHS = 1.0 + 1e-3


def roll_out_plans(
    plans: Sequence[AnyPlan], time: npt.ArrayLike, robot: Robot | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute the joint movements of motion plans.

    Those of a Cartesian plan come from inverse kinematics after its rollout, see
    `besman.motion.joint_path`.

    Parameters
    ----------
    plans : sequence of MotionPlan or CartesianPlan
        Of one arm.
    time : array, shape (T,)
        Seconds from the start; after its duration a movement stands still.
    robot : Robot, optional
        The arm with its tool; needed for Cartesian plans.

    Returns
    -------
    positions, velocities, accelerations : array, shape (P, T, n)
        rad, rad/s, rad/s^2; each is what it would be if its plan came alone.

    Raises
    ------
    PlanError
        If a Cartesian plan comes without a robot, or with one that has other joints.
    """
    kinds = {plan.kind for plan in plans}
    if len({(plan.kind, plan.weights.shape[1]) for plan in plans}) > 1:
        alone = [roll_out_plans([plan], time, robot) for plan in plans]
        positions, velocities, accelerations = (
            np.concatenate(part) for part in zip(*alone, strict=True)
        )
        return positions, velocities, accelerations
    durations = np.array([plan.duration for plan in plans])
    if kinds == {"cartesian_dmp"}:
        return _roll_out_cartesian(cast(Sequence[CartesianPlan], plans), durations, time, robot)
    joint_plans = cast(Sequence[MotionPlan], plans)
    weights, start, goal = (
        np.stack([getattr(plan, name) for plan in joint_plans])
        for name in ("weights", "start", "goal")
    )
    if kinds == {"joint_dmp"}:
        return roll_out(weights, start, goal, durations, time)
    return roll_out_velocity(
        weights,
        start,
        goal,
        np.stack([plan.start_velocity for plan in joint_plans]),
        np.stack([plan.goal_velocity for plan in joint_plans]),
        durations,
        np.array([[plan.lead_in_s, plan.lead_out_s] for plan in joint_plans]),
        time,
    )


def _roll_out_cartesian(
    plans: Sequence[CartesianPlan],
    durations: FloatArray,
    time: npt.ArrayLike,
    robot: Robot | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Solve every plan's path and sample it."""
    from besman.motion.joint_path import joint_nodes

    nodes = [joint_nodes(plan, _own_arm(plan, robot)) for plan in plans]
    scale = durations[:, None]
    x = np.asarray(time, dtype=np.float64) / scale
    q, v, a = (np.stack(part) for part in zip(*nodes, strict=True))
    q, v, a = interpolate(q, v, a, np.clip(x, 0.0, 1.0))
    moving = (x <= 1.0)[..., None] / scale[..., None]
    return q, v * moving, a * moving / scale[..., None]


def sample_plan(
    plan: AnyPlan, robot: Robot | None = None, rate_hz: float = RATE_HZ
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Roll out one plan at equal steps from its start to just past its end.

    Parameters
    ----------
    plan : MotionPlan or CartesianPlan
    robot : Robot, optional
        As in `roll_out_plans`.
    rate_hz : float
        Samples per second.

    Returns
    -------
    time : array, shape (T,)
        Seconds.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.

    Raises
    ------
    PlanError
        As `roll_out_plans`.
    """
    time = np.arange(int(np.ceil(plan.duration * rate_hz)) + 1) / rate_hz
    q, v, a = roll_out_plans([plan], time, robot)
    return time, q[0], v[0], a[0]


def stretch_plan(plan: Plan, duration: float) -> Plan:
    """Make a plan's movement faster or slower, evenly: the same path in another duration.

    Parameters
    ----------
    plan : MotionPlan or CartesianPlan
    duration : float
        Seconds.

    Returns
    -------
    MotionPlan or CartesianPlan
        The velocities at start and goal change with the duration.
    """
    if isinstance(plan, CartesianPlan) or plan.kind == "joint_dmp":
        return replace(plan, duration=duration)
    stretch = duration / plan.duration
    return replace(
        plan,
        duration=duration,
        start_velocity=plan.start_velocity / stretch,
        goal_velocity=plan.goal_velocity / stretch,
        lead_in_s=plan.lead_in_s * stretch,
        lead_out_s=plan.lead_out_s * stretch,
    )


def least_duration(plan: AnyPlan, limits: JointLimits, robot: Robot | None = None) -> float:
    """Compute how long a plan must last to keep the limits of velocity, acceleration and jerk.

    Parameters
    ----------
    plan : MotionPlan or CartesianPlan
    limits : JointLimits
        Of the arm.
    robot : Robot, optional
        As in `roll_out_plans`.

    Returns
    -------
    float
        Seconds; shorter than the plan's own duration if there is room.
    """
    if isinstance(plan, MotionPlan) and plan.kind == "joint_dmp":
        parameters = np.column_stack([plan.start, plan.goal, plan.weights]).T
        # As if it lasted one second.
        _, velocity, acceleration = at_nodes = respond(parameters)
        if plan.weights.shape[1] > _SMOOTH_AT_NODES:
            places = np.linspace(0.0, 1.0, _count_places(plan.weights.shape[1]))
            _, velocity, acceleration = interpolate(*at_nodes, places)
        stretch = time_stretch(limits, velocity, acceleration, 1.0 / (len(acceleration) - 1))
        return _MARGIN * stretch
    if isinstance(plan, CartesianPlan):
        from besman.motion.joint_path import greatest_rates, joint_nodes

        nodes = joint_nodes(plan, _own_arm(plan, robot))
        stretch = time_stretch(limits, *nodes[1:], 1.0 / (len(nodes[0]) - 1))
        return _MARGIN_OF_PATHS * max(stretch, time_stretch(limits, *greatest_rates(*nodes)))
    time = np.linspace(0.0, plan.duration, _count_places(plan.weights.shape[1]))
    _, velocities, accelerations = roll_out_plans([plan], time)
    stretch = time_stretch(limits, velocities[0], accelerations[0], float(time[1]))
    # Where a lead meets the primitive the acceleration may jump: just within the primitive.
    inside = 1e-9 * plan.duration
    ends = np.array([plan.lead_in_s + inside, plan.duration - plan.lead_out_s - inside])
    _, velocities, accelerations = roll_out_plans([plan], ends)
    at_ends = time_stretch(limits, velocities[0], accelerations[0])
    return _MARGIN * max(stretch, at_ends) * plan.duration


def _count_places(n_weights: int) -> int:
    """Return in how many places a movement of so many weights is looked at."""
    n_steps = count_nodes(n_weights) - 1
    crowded = -(-_PLACES_A_WEIGHT * n_weights // n_steps) if n_weights > _SMOOTH_AT_NODES else 1
    return max(_PLACES_A_NODE, crowded) * n_steps + 1


def _own_arm(plan: CartesianPlan, robot: Robot | None) -> Robot:
    """Refuse a plan without its arm."""
    if robot is None or plan.joint_names != robot.joint_names:
        got = "none" if robot is None else ", ".join(robot.joint_names)
        raise PlanError(
            f"{plan.name}: a Cartesian plan needs its arm, with the joints "
            f"{', '.join(plan.joint_names)}; got {got}"
        )
    return robot
