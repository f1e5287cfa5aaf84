"""Another start, goal or duration for a motion plan, within the limits of its arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.geometry.frames import rotation_to_quaternion
from besman.motion.cartesian_dmp import move_ends, same_turn
from besman.motion.dmp_fit import goal_response
from besman.motion.forcing import count_nodes
from besman.motion.joint_path import ik_weights, joint_steps, plan_poses
from besman.motion.rollout import least_duration, roll_out_plans, sample_plan, stretch_plan
from besman.records import AnyPlan, CartesianPlan, MotionPlan
from besman.robot.dynamics import inverse_dynamics
from besman.robot.inverse_kinematics import solve_path
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

# Slower than this is no movement any more but a path that the arm cannot follow.
_GREATEST_DURATION_S = 120.0
_GREATEST_MISS_M = 0.01
_ROUNDING_RAD = 1e-9
# Between two looks at a movement its limits may be exceeded a little.
_RESERVE = 1e-3


def retarget_plan(
    plan: AnyPlan,
    robot: Robot,
    *,
    goal: npt.ArrayLike | None = None,
    start: npt.ArrayLike | None = None,
    duration: float | None = None,
    goal_velocity: npt.ArrayLike | None = None,
) -> AnyPlan:
    """Give a plan another start, goal or duration, such that the arm can run it.

    Sampled at 1 kHz, the movement violates no limit of position, velocity, acceleration or torque
    and the arm touches neither itself nor the floor; else there is an error. For this

    - it lasts longer than asked for, where velocity, acceleration or torque require it, and is
      then slower evenly, also where it passes its goal with a velocity;
    - of a joint whose movement between its ends would leave its range, the demonstrated shape
      (what differs from the smoothest movement between the same ends) is scaled down, just enough;
    - a Cartesian plan takes another branch of the inverse kinematics, where its own one does not
      lead to the goal.

    Start and goal themselves are never moved.

    Parameters
    ----------
    plan : MotionPlan or CartesianPlan
    robot : Robot
        The plan's arm with its tool.
    goal, start : array, shape (n,) or (7,), optional
        rad; of a Cartesian plan position (m) and unit quaternion wxyz in the robot's world frame,
        reached the way round that is nearest to the plan's. As they are by default.
    duration : float, optional
        Seconds wished for; the plan's own by default.
    goal_velocity : array, shape (n,), optional
        rad/s, of a ``joint_dmp_velocity``. By default the plan's, at its duration.

    Returns
    -------
    MotionPlan or CartesianPlan
        Of the same kind; its `goal_pose` is the new goal's, if one was given.

    Raises
    ------
    PlanError
        If start or goal have the wrong shape, are beyond a joint's range or out of reach, if the
        arm would have to jump, cannot bear its load, or touches itself or the floor.
    """
    if plan.joint_names != robot.joint_names:
        raise PlanError(
            f"{plan.name}: plan for joints {', '.join(plan.joint_names)}; robot {robot.name} has "
            f"{', '.join(robot.joint_names)}"
        )
    if duration is not None:
        if not 0 < duration < np.inf:
            raise PlanError(f"{plan.name}: duration: got {duration:g} s, expected more than 0")
        plan = stretch_plan(plan, duration)
    if isinstance(plan, MotionPlan):
        return _fit(_move_joints(plan, robot, start, goal, goal_velocity), robot)
    if goal_velocity is not None:
        raise _no_velocity(plan)
    return _fit(_move_poses(plan, robot, start, goal), robot)


def _move_joints(
    plan: MotionPlan,
    robot: Robot,
    start: npt.ArrayLike | None,
    goal: npt.ArrayLike | None,
    goal_velocity: npt.ArrayLike | None,
) -> MotionPlan:
    """Move the ends of a joint plan; nothing is checked but they themselves."""
    first = _joints(plan, robot, "start", plan.start if start is None else start)
    last = _joints(plan, robot, "goal", plan.goal if goal is None else goal)
    if goal is not None:
        pose = forward_kinematics(robot.chain, last)
        turned = rotation_to_quaternion(pose[:3, :3])
        plan = replace(plan, goal_pose=np.concatenate([pose[:3, 3], turned]))
    if plan.kind == "joint_dmp":
        if goal_velocity is not None:
            raise _no_velocity(plan)
        way = (last - first) - (plan.goal - plan.start)
        weights = plan.weights + np.outer(way, goal_response(plan.weights.shape[1]))
        return replace(plan, weights=weights, start=first, goal=last)
    velocity = plan.goal_velocity if goal_velocity is None else np.array(goal_velocity, dtype=float)
    if velocity.shape != (robot.n,) or not np.isfinite(velocity).all():
        raise PlanError(
            f"{plan.name}: goal_velocity must be finite, shape ({robot.n},), got "
            f"{np.array(velocity).tolist()}"
        )
    return replace(plan, start=first, goal=last, goal_velocity=velocity)


def _joints(plan: MotionPlan, robot: Robot, what: str, values: npt.ArrayLike) -> FloatArray:
    """Check joint angles against their ranges."""
    angles = np.array(values, dtype=np.float64)
    if angles.shape != (robot.n,) or not np.isfinite(angles).all():
        raise PlanError(
            f"{plan.name}: {what} must be finite, shape ({robot.n},), got {angles.tolist()}"
        )
    low, high = robot.limits.position_min, robot.limits.position_max
    for name, angle, least, most in zip(robot.joint_names, angles, low, high, strict=True):
        if not least - _ROUNDING_RAD <= angle <= most + _ROUNDING_RAD:
            raise PlanError(
                f"{plan.name}: {what}: joint {name}: got {angle:.4f} rad, expected it within "
                f"[{least:.4f}, {most:.4f}]"
            )
    return np.asarray(np.clip(angles, low, high))


def _fit_shape(plan: MotionPlan, robot: Robot, reserve: float) -> MotionPlan:
    """Scale down the shape of every joint that would leave its range.

    The movement is the one without the shape plus the shape, so the greatest share that fits
    follows in closed form; `reserve` is the share of it that is not used.
    """
    if plan.kind == "joint_dmp":
        plain = np.outer(plan.goal - plan.start, goal_response(plan.weights.shape[1]))
    else:
        plain = np.zeros_like(plan.weights)
    n_places = 2 * count_nodes(plan.weights.shape[1]) - 1
    time = np.linspace(0.0, plan.duration, n_places)
    positions, _, _ = roll_out_plans([plan, replace(plan, weights=plain)], time)
    rest, shape = positions[1], positions[0] - positions[1]
    bound = np.where(shape > 0, robot.limits.position_max, robot.limits.position_min)
    room = np.maximum((bound - rest) * np.sign(shape), 0.0)
    # What has no shape fits many times, not infinitely often: no share of that is a number.
    fits = np.full_like(room, 1.0 / _ROUNDING_RAD)
    np.divide(room, np.abs(shape), out=fits, where=np.abs(shape) > _ROUNDING_RAD)
    share = np.clip((1.0 - reserve) * fits.min(axis=0), 0.0, 1.0)
    # A joint that needs no scaling keeps its weights to the last bit.
    scaled = plain + share[:, None] * (plan.weights - plain)
    return replace(plan, weights=np.where(share[:, None] < 1.0, scaled, plan.weights))


def _move_poses(
    plan: CartesianPlan,
    robot: Robot,
    start: npt.ArrayLike | None,
    goal: npt.ArrayLike | None,
) -> CartesianPlan:
    """Move the ends of a Cartesian plan and find joint angles at its start."""
    ends = plan.start, plan.goal
    first = plan.start if start is None else _pose(plan, "start", start)
    last = plan.goal if goal is None else _pose(plan, "goal", goal)
    goal_pose = plan.goal_pose if goal is None else last
    weights = move_ends(plan.weights, ends, (first, last))
    plan = replace(plan, weights=weights, start=first, goal=last, goal_pose=goal_pose)
    found, errors = joint_steps(plan, robot)
    if max(errors[0, 0], errors[-1, 0]) > _GREATEST_MISS_M:
        path = solve_path(
            robot, plan_poses(plan), weights=ik_weights(plan), free_spin=plan.free_spin
        )
        found, errors = joint_steps(replace(plan, joints=path.positions[0]), robot)
    for what, miss in (("start", errors[0, 0]), ("goal", errors[-1, 0])):
        if miss > _GREATEST_MISS_M:
            raise PlanError(
                f"{plan.name}: {what}: out of reach of {robot.name} by {1e3 * miss:.0f} mm, "
                f"expected at most {1e3 * _GREATEST_MISS_M:.0f} mm"
            )
    return replace(plan, joints=found[0])


def _pose(plan: CartesianPlan, what: str, values: npt.ArrayLike) -> FloatArray:
    """Check a pose; choose the way round that is nearest to the plan's."""
    pose = np.array(values, dtype=np.float64)
    if pose.shape != (7,) or not np.isfinite(pose).all():
        raise PlanError(
            f"{plan.name}: {what} of a Cartesian plan must be finite, shape (7,): position (m) and "
            f"quaternion wxyz; got {pose.tolist()}"
        )
    return same_turn(pose, getattr(plan, what))


def _no_velocity(plan: AnyPlan) -> PlanError:
    """Say that a plan ends at rest."""
    return PlanError(
        f"{plan.name}: goal_velocity: a {plan.kind} ends at rest; expected a joint_dmp_velocity"
    )


def _fit(plan: AnyPlan, robot: Robot) -> AnyPlan:
    """Lengthen a plan, and scale down its shape, until it keeps all limits at 1 kHz."""
    reserve, slack = 0.0, 1.0
    while True:
        fitted = plan if isinstance(plan, CartesianPlan) else _fit_shape(plan, robot, reserve)
        duration = max(fitted.duration, slack * _least_duration(fitted, robot))
        fitted = stretch_plan(fitted, duration) if duration > fitted.duration else fitted
        time, positions, velocities, accelerations = sample_plan(fitted, robot)
        report = check_limits(robot, positions, velocities, accelerations)
        torques = np.abs(inverse_dynamics(robot, positions, velocities, accelerations))
        # Between the places that were looked at a movement can be beyond its limits by a hair.
        if report.position and isinstance(plan, MotionPlan) and reserve < 1.0:
            reserve = min(2.0 * reserve + _RESERVE, 1.0)
        elif report.position:
            raise _leaves_range(fitted, robot, time, positions)
        elif (
            report.velocity
            or report.acceleration
            or report.jerk
            or np.any(torques > robot.limits.torque)
        ):
            slack *= 1.0 + _RESERVE
        elif report.self_collisions:
            raise PlanError(
                f"{plan.name}: the arm would touch itself, its pedestal or the floor in "
                f"{report.self_collisions} of {report.samples} samples"
            )
        else:
            return fitted


def _least_duration(plan: AnyPlan, robot: Robot) -> float:
    """Compute how long a plan must last to keep velocity, acceleration and torque.

    Of a torque, the part that moves the arm falls with the square of the duration; the part that
    holds it does not.
    """
    _, positions, velocities, accelerations = sample_plan(plan, robot)
    still = np.zeros_like(positions)
    holding = inverse_dynamics(robot, positions, still, still)
    moving = inverse_dynamics(robot, positions, velocities, accelerations) - holding
    room = robot.limits.torque - np.sign(moving) * holding
    if not np.all(np.abs(holding) < robot.limits.torque):
        joint = int(np.argmax(np.max(np.abs(holding) / robot.limits.torque, axis=0)))
        raise PlanError(
            f"{plan.name}: joint {robot.joint_names[joint]} would need "
            f"{np.abs(holding[:, joint]).max():.1f} Nm to hold the arm, allowed: "
            f"{robot.limits.torque[joint]:.1f} Nm"
        )
    for_torque = plan.duration * float(np.sqrt(np.max(np.abs(moving) / room)))
    least = max(least_duration(plan, robot.limits, robot), for_torque)
    if not least <= _GREATEST_DURATION_S:
        raise PlanError(
            f"{plan.name}: the arm would have to jump: within its limits the movement takes "
            f"{least:.0f} s, allowed: {_GREATEST_DURATION_S:.0f} s"
        )
    return least


def _leaves_range(
    plan: AnyPlan, robot: Robot, time: FloatArray, positions: FloatArray
) -> PlanError:
    """Say which joint leaves its range, where, and how far."""
    limits = robot.limits
    excess = np.maximum(limits.position_min - positions, positions - limits.position_max)
    row, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    return PlanError(
        f"{plan.name}: joint {robot.joint_names[joint]} would leave its range "
        f"[{limits.position_min[joint]:.4f}, {limits.position_max[joint]:.4f}] rad by "
        f"{excess[row, joint]:.4f} rad, {time[row]:.3f} s after the start"
    )
