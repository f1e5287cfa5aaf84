"""Try motion plans at a task: movement, simulation, reward."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.imitation.movement import roll_out_plans
from besman.records import AnyPlan
from besman.robot.collision import distances
from besman.robot.model import Robot
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.reach import simulate_reaching
from besman.simulation.tasks import StickThrowConfig, TaskConfig
from besman.simulation.throw import simulate_throws

FloatArray = npt.NDArray[np.float64]

# Small enough to share the work between threads, large enough to leave Python's lock alone.
_BLOCK = 8
# Positions are compared with limits and obstacles at this interval during the search.
_CHECK_S = 0.004
# Closer than this counts as touching, because the arm moves between two checks.
_CLEARANCE_M = 0.002


@dataclass(frozen=True)
class Trial:
    """What came of one motion plan.

    Attributes
    ----------
    reward : float
        Minus the sum of the task's terms.
    miss : float
        Distance to the target, metres; NaN if nothing came of it.
    orientation_error : float
        Radians to the demonstrated end orientation; NaN where the task does not ask for it.
    outcome : array, shape (3,)
        Touchdown or end position, metres; NaN if there is none.
    failure : str
        "" if nothing failed.
    success : bool
        The task's criterion is met and nothing failed.
    object_path : array, shape (F, 3)
        Path of what is thrown, metres; empty unless asked for.
    """

    reward: float
    miss: float
    orientation_error: float
    outcome: FloatArray
    failure: str
    success: bool
    object_path: FloatArray


def try_plans(
    robot: Robot,
    task: TaskConfig,
    plans: Sequence[AnyPlan],
    jobs: int = 1,
    paths: bool = False,
) -> list[Trial]:
    """Try motion plans, each by itself.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : TaskConfig
        Scene, reward, criteria.
    plans : sequence of MotionPlan or CartesianPlan
        Those of one kind with the same number of weights.
    jobs : int
        Threads; results do not depend on it.
    paths : bool
        Whether to give the paths of what is thrown.

    Returns
    -------
    list of Trial
        In the order of the plans.
    """
    blocks = [plans[first : first + _BLOCK] for first in range(0, len(plans), _BLOCK)]

    def try_block(block: Sequence[AnyPlan]) -> list[Trial]:
        movements = move(block, task, robot)
        episodes = simulate(robot, task, movements, paths)
        return _score(robot, task, block, movements, episodes)

    if jobs > 1 and len(blocks) > 1:
        with ThreadPoolExecutor(jobs) as pool:
            results = list(pool.map(try_block, blocks))
    else:
        results = [try_block(block) for block in blocks]
    return [trial for block in results for trial in block]


def move(plans: Sequence[AnyPlan], task: TaskConfig, robot: Robot | None = None) -> Movements:
    """Roll out motion plans at the task's time step, with the time that it needs after them.

    Cartesian plans need the robot, for their inverse kinematics.
    """
    durations = np.array([plan.duration for plan in plans])
    step = task.simulation.time_step_s
    time = step * np.arange(int(np.ceil((durations.max() + task.rest_s) / step)) + 1)
    return Movements(*roll_out_plans(plans, time, robot), durations)


def simulate(robot: Robot, task: TaskConfig, movements: Movements, paths: bool) -> Episodes:
    """Simulate movements in the scene of their task."""
    if isinstance(task, StickThrowConfig):
        return simulate_throws(robot, task, movements, paths)
    return simulate_reaching(robot, task, movements)


def _score(
    robot: Robot,
    task: TaskConfig,
    plans: Sequence[AnyPlan],
    movements: Movements,
    episodes: Episodes,
) -> list[Trial]:
    """Turn episodes into rewards."""
    stride = max(round(_CHECK_S / task.simulation.time_step_s), 1)
    positions = movements.positions[:, ::stride]
    limits = robot.limits
    excess = np.maximum(limits.position_min - positions, positions - limits.position_max)
    excess = np.maximum(excess, 0.0).max(axis=1).sum(axis=1)
    depth = np.maximum(_CLEARANCE_M - distances(robot.chain, positions).min(axis=(1, 2)), 0.0)
    return [
        _score_one(task, plan, episodes, index, float(excess[index]), float(depth[index]))
        for index, plan in enumerate(plans)
    ]


def _score_one(
    task: TaskConfig,
    plan: AnyPlan,
    episodes: Episodes,
    index: int,
    excess: float,
    depth: float,
) -> Trial:
    """Score one episode."""
    outcome, failure = episodes.outcomes[index], episodes.failures[index]
    shortfall = float(episodes.shortfalls[index])
    if not failure and (excess > 0 or depth > 0):
        failure = "position limit" if excess > 0 else "collision with itself or the floor"
    target = plan.target if isinstance(task, StickThrowConfig) else plan.goal_pose[:3]
    miss = float(np.linalg.norm(outcome - target))
    angle = float("nan")
    cost = task.reward.limit_excess_per_rad * excess + task.reward.collision_per_m * depth
    if np.isfinite(miss):
        cost += task.reward.miss_per_m * miss
    if failure:
        cost += task.reward.failure * (1.0 + shortfall)
    success = not failure and miss <= task.success.success_radius_m
    if not isinstance(task, StickThrowConfig):
        angle = rotation_between(episodes.end_poses[index, 3:], plan.goal_pose[3:])
        cost += task.reward.misorientation_per_rad * (angle if np.isfinite(angle) else np.pi)
        success = success and angle <= np.radians(task.success.success_angle_deg)
    return Trial(
        reward=-cost,
        miss=miss,
        orientation_error=angle,
        outcome=outcome,
        failure=failure,
        success=bool(success),
        object_path=episodes.object_paths[index] if episodes.object_paths else np.empty((0, 3)),
    )


def rotation_between(first: FloatArray, second: FloatArray) -> float:
    """Return the angle between two orientations given as unit quaternions (4,), rad."""
    first, second = np.asarray(first), np.asarray(second)
    # By the chord rather than the cosine, which is blind to small angles.
    chord = min(float(np.linalg.norm(first - second)), float(np.linalg.norm(first + second)))
    return float(4.0 * np.arcsin(min(chord / 2.0, 1.0))) if np.isfinite(chord) else float("nan")
