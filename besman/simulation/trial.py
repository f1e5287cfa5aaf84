"""Try motion plans at a task: movement, simulation, reward."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import groupby

import numpy as np
import numpy.typing as npt

from besman.records import AnyPlan, Record, freeze
from besman.robot.collision import distances
from besman.robot.model import Robot
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.perturbation import Perturbation
from besman.simulation.task import Task

FloatArray = npt.NDArray[np.float64]

# Small enough to share the work between threads, large enough to leave Python's lock alone.
_BLOCK = 8
# Positions are compared with limits and obstacles at this interval during the search.
_CHECK_S = 0.004
# Closer than this counts as touching, because the arm moves between two checks.
_CLEARANCE_M = 0.002


@dataclass(frozen=True)
class Trial(Record, stored_as="besman.simulation.trial:Trial", later=("residual",)):
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
        Path of what is thrown or carried, metres; empty unless asked for.
    measures : dict of float
        What else it was judged by, see `besman.simulation.task.Task.measure`.
    costs : dict of float
        Terms of the reward by the names of their weights.
    release : array, shape (6,)
        Position (m) and velocity (m/s) with which what is thrown is clear; NaN without a throw.
    residual : array, shape (R,)
        How far off the outcome is, and whither; see `besman.simulation.task.Task.residual`.
    """

    reward: float
    miss: float
    orientation_error: float
    outcome: FloatArray
    failure: str
    success: bool
    object_path: FloatArray
    measures: dict[str, float] = field(default_factory=dict)
    costs: dict[str, float] = field(default_factory=dict)
    release: FloatArray = field(default_factory=lambda: np.full(6, np.nan))
    residual: FloatArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        """Copy the arrays, make them read-only and check their shapes."""
        freeze(
            self, {"outcome": (3,), "object_path": ("F", 3), "release": (6,), "residual": ("R",)}
        )


def try_plans(
    robot: Robot,
    task: Task,
    plans: Sequence[AnyPlan],
    jobs: int = 1,
    paths: bool = False,
    world: Perturbation | None = None,
) -> list[Trial]:
    """Try motion plans, each by itself.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : Task
        Scene, reward, criteria.
    plans : sequence of MotionPlan or CartesianPlan
        Those of one kind with the same number of weights.
    jobs : int
        Threads; results do not depend on it.
    paths : bool
        Whether to give the paths of what is thrown or carried.
    world : Perturbation, optional
        In which way the model is another one, the same for all.

    Returns
    -------
    list of Trial
        In the order of the plans.
    """
    blocks = list(_blocks(robot, task, plans))

    def try_block(block: Sequence[AnyPlan]) -> list[Trial]:
        movements = move(block, task, robot)
        if world is not None:
            movements = replace(movements, perturbations=(world,) * len(block))
        return try_movements(robot, task, block, movements, paths)

    if jobs > 1 and len(blocks) > 1:
        with ThreadPoolExecutor(jobs) as pool:
            results = list(pool.map(try_block, blocks))
    else:
        results = [try_block(block) for block in blocks]
    return [trial for block in results for trial in block]


def _blocks(robot: Robot, task: Task, plans: Sequence[AnyPlan]) -> Iterator[list[AnyPlan]]:
    """Cut plans into blocks of one scene each."""
    for _, group in groupby(plans, lambda plan: task.scene(plan, robot)):
        same = list(group)
        yield from (same[first : first + _BLOCK] for first in range(0, len(same), _BLOCK))


def move(plans: Sequence[AnyPlan], task: Task, robot: Robot | None = None) -> Movements:
    """Return what an arm does in a task; see `besman.simulation.task.Task.move`."""
    return task.move(plans, robot)


def try_movements(
    robot: Robot, task: Task, plans: Sequence[AnyPlan], movements: Movements, paths: bool = False
) -> list[Trial]:
    """Try the movements of motion plans, all of one scene; see `try_plans`."""
    episodes = task.simulate(robot, plans, movements, paths)
    return score_episodes(robot, task, plans, movements, episodes)


def score_episodes(
    robot: Robot,
    task: Task,
    plans: Sequence[AnyPlan],
    movements: Movements,
    episodes: Episodes,
) -> list[Trial]:
    """Turn episodes into rewards."""
    stride = max(round(_CHECK_S / task.simulation.time_step_s), 1)
    positions = movements.distinct.positions[:, ::stride]
    limits = robot.limits
    excess = np.maximum(limits.position_min - positions, positions - limits.position_max)
    excess = np.maximum(excess, 0.0).max(axis=1).sum(axis=1)
    least = distances(robot.chain, positions, beyond=_CLEARANCE_M).min(axis=(1, 2))
    depth = np.maximum(_CLEARANCE_M - least, 0.0)
    excess, depth = (np.broadcast_to(part, len(plans)) for part in (excess, depth))
    return [
        _score_one(task, plan, episodes, index, float(excess[index]), float(depth[index]))
        for index, plan in enumerate(plans)
    ]


def _score_one(
    task: Task,
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
    miss = task.miss(plan, outcome)
    measures = task.measure(plan, episodes, index)
    reward = task.reward
    costs = {
        "limit_excess_per_rad": reward.limit_excess_per_rad * excess,
        "collision_per_m": reward.collision_per_m * depth,
    }
    if np.isfinite(miss):
        costs["miss_per_m"] = reward.miss_per_m * miss
    if failure:
        costs["failure"] = reward.failure * (1.0 + shortfall)
    costs |= task.costs(measures)
    return Trial(
        reward=-sum(costs.values()),
        miss=miss,
        orientation_error=measures.get("misorientation_rad", float("nan")),
        outcome=outcome,
        failure=failure,
        success=bool(not failure and task.succeeds(miss, measures)),
        object_path=episodes.object_paths[index] if episodes.object_paths else np.empty((0, 3)),
        measures=measures,
        costs=costs,
        release=np.full(6, np.nan) if episodes.releases is None else episodes.releases[index],
        residual=task.residual(plan, episodes, index),
    )
