"""Refinement of a whole task block by block, and all of it as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from besman.exceptions import PlanError
from besman.motion.adapt_task import frame_matrix, keep_task_limits
from besman.motion.grasp_goals import lead_grasps
from besman.motion.grasp_way import GraspWay
from besman.motion.task_rollout import stretch_task
from besman.records import TaskPlan
from besman.search.cma_es import CmaEs
from besman.simulation.tasks.rearrange.block_trials import (
    IMPOSSIBLE,
    BlockGoal,
    BlockOutcome,
    BlockState,
    BlockTrials,
)

FloatArray = npt.NDArray[np.float64]

GOALS: tuple[BlockGoal, ...] = ("take", "put", "leave")
# What a unit of the search is: metres along the box's axes, radians of yaw and pitch; how much
# higher the middle of a way is, how far the gripper leaves, metres; how much slower it all is.
_POSE = (0.02, 0.02, 0.02, 0.15, 0.15)
_UNITS: dict[BlockGoal, FloatArray] = {
    "take": np.array([*_POSE, 0.04]),
    "put": np.array([*_POSE, 0.04, 0.03]),
    "leave": np.array([0.04, 0.1]),
}

# Where nothing at all can be done, a search ends at once, and begins anew with more points.
_MOST_RESTARTS = 6
# Level, ahead along x, closing along y.
_SQUARE = [[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]


class Part(NamedTuple):
    """Blocks of a task with one outcome.

    Attributes
    ----------
    goal : "take", "put" or "leave"
    plan : TaskPlan
        Of these blocks alone.
    tool : array, shape (4, 4)
        Where the tool was shown to be at the end, in the frame of the object or its place; where
        the part before has it, if it leads to neither.
    """

    goal: BlockGoal
    plan: TaskPlan
    tool: FloatArray


@dataclass(frozen=True)
class Found:
    """What a search has come to.

    Attributes
    ----------
    plan : TaskPlan or None
        The best; None if its end was never come to.
    success : bool
    episodes : dict of int
        Simulations begun at each part, by its goal; of the whole under ``whole``.
    simulated_s : float
        Seconds of the simulated world in all of them.
    """

    plan: TaskPlan | None
    success: bool
    episodes: dict[str, int]
    simulated_s: float


def n_parameters(goal: BlockGoal) -> int:
    """Return how many parameters a part has."""
    return len(_UNITS[goal])


def split_task(plan: TaskPlan, scratch: bool = False) -> tuple[Part, ...]:
    """Split a task at the borders after which its box is in the hand, and at its place.

    Parameters
    ----------
    plan : TaskPlan
        As imitated; one object is taken and put once.
    scratch : bool
        Without what was shown: blocks without a shape, and a tool that is square to the box, in
        its middle. Order and goals' frames stay, and where the arm rests.

    Raises
    ------
    PlanError
        If it does not take and put one thing.
    """
    frames = [block.frame for block in plan.blocks]
    order = [frame for frame, _ in groupby(frame for frame in frames if frame != "world")]
    if order != ["object", "target"]:
        raise PlanError(f"{plan.name}: expected one object that is taken and put, once")
    cuts = [len(frames) - frames[::-1].index(frame) for frame in order]
    ends = [0, *cuts, len(frames)]
    parts = []
    tool = np.eye(4)
    for goal, (first, stop) in zip(GOALS, pairwise(ends), strict=True):
        blocks = plan.blocks[first:stop]
        if not blocks:
            continue
        if scratch:
            blocks = tuple(replace(b, weights=np.zeros_like(b.weights)) for b in blocks)
        if goal != "leave":
            tool = frame_matrix(blocks[-1].goal_pose)
            if scratch:
                tool = np.array(_SQUARE)
        still = np.zeros(len(plan.joint_names))
        blocks = (replace(blocks[0], start_velocity=still, path_error=None), *blocks[1:])
        blocks = (*blocks[:-1], replace(blocks[-1], goal_velocity=still, path_error=None))
        part = replace(plan, blocks=blocks, events_s=np.empty(0), events=())
        parts.append(Part(goal, part, tool))
    return tuple(parts)


def shape_part(
    part: Part, way: GraspWay, trials: BlockTrials, x: FloatArray, last: TaskPlan | None
) -> TaskPlan:
    """Return a part as parameters say, from where the last one has ended.

    Parameters
    ----------
    part : Part
    way : GraspWay
        The straight ways.
    trials : BlockTrials
    x : array, shape (D,)
        In units of the search; 0 is what was shown.
    last : TaskPlan, optional

    Raises
    ------
    PlanError
        If it is out of the arm's reach or limits.
    """
    values = x * _UNITS[part.goal]
    plan = part.plan
    if last is not None:
        first = replace(
            plan.blocks[0],
            start=last.blocks[-1].goal,
            start_velocity=last.blocks[-1].goal_velocity,
            path_error=None,
        )
        plan = replace(plan, blocks=(first, *plan.blocks[1:]))
    if part.goal == "leave":
        still = replace(way, higher_m=abs(values[0]))
        led = lead_grasps(plan, trials.robot, still)
        return keep_task_limits(stretch_task(led, float(np.exp(abs(values[1])))), trials.robot)
    tool = np.array(part.tool)
    tool[:3, 3] += values[:3]
    turn = Rotation.from_euler("ZY", values[3:5]).as_matrix()
    tool[:3, :3] = turn @ tool[:3, :3]
    after_m = way.after_m + values[6] if part.goal == "put" else way.after_m
    moved = replace(
        way, grasp=tool, pitch_rad=0.0, higher_m=abs(values[5]), after_m=max(after_m, 0.02)
    )
    return keep_task_limits(lead_grasps(plan, trials.robot, moved), trials.robot)


def search_blocks(
    parts: Sequence[Part], way: GraspWay, trials: BlockTrials, budget: int, seed: int, sigma: float
) -> Found:
    """Refine one part after the other, each from the state in which the one before has ended.

    An episode that has fulfilled its part goes on into the next, as that was shown; only where it
    fails there are others begun, in the state in which that part began.

    Parameters
    ----------
    parts : sequence of Part
    way : GraspWay
    trials : BlockTrials
    budget : int
        Episodes of each part at most.
    seed : int
    sigma : float
        First standard deviation, in units of the search.
    """
    state = trials.first(parts[0].plan.blocks[0].start)
    done: list[TaskPlan] = []
    episodes: dict[str, int] = {}
    seconds, success = 0.0, True
    for number, part in enumerate(parts):

        def attempt(
            x: FloatArray, part: Part = part, state: BlockState = state
        ) -> tuple[TaskPlan | None, BlockOutcome]:
            try:
                plan = shape_part(part, way, trials, x, done[-1] if done else None)
            except PlanError:
                return None, IMPOSSIBLE
            return plan, trials.attempt(plan, state, part.goal)

        best, n, simulated_s = _search(
            attempt, n_parameters(part.goal), budget, (seed, number), sigma, begun=number > 0
        )
        plan, outcome = best
        episodes[part.goal], seconds = n, seconds + simulated_s
        success &= outcome.success
        if plan is None or outcome.end is None:
            break
        done.append(plan)
        state = outcome.end
        if not outcome.success:
            break
    whole = _join(done) if len(done) == len(parts) else None
    return Found(whole, success, episodes, seconds)


def search_whole(
    parts: Sequence[Part], way: GraspWay, trials: BlockTrials, budget: int, seed: int, sigma: float
) -> Found:
    """Refine all parts at once; every episode is the whole task.

    Its reward is the sum of those of all parts; what is not come to has the worst.

    Parameters
    ----------
    parts, way, trials, budget, seed, sigma
        As of `search_blocks`.
    """
    ends = np.cumsum([n_parameters(part.goal) for part in parts])

    def attempt(x: FloatArray) -> tuple[TaskPlan | None, BlockOutcome]:
        state: BlockState | None = trials.first(parts[0].plan.blocks[0].start)
        done: list[TaskPlan] = []
        reward, success, seconds = 0.0, True, 0.0
        for part, own in zip(parts, np.split(x, ends[:-1]), strict=True):
            outcome = IMPOSSIBLE
            if state is not None:
                try:
                    plan = shape_part(part, way, trials, own, done[-1] if done else None)
                except PlanError:
                    plan = None
                if plan is not None:
                    outcome = trials.attempt(plan, state, part.goal)
                    done.append(plan)
            reward, success = reward + outcome.reward, success and outcome.success
            seconds += outcome.seconds
            state = outcome.end
        joined = _join(done) if len(done) == len(parts) else None
        return joined, BlockOutcome(reward, success, state, seconds)

    (plan, outcome), n, seconds = _search(attempt, int(ends[-1]), budget, (seed,), sigma)
    return Found(plan, outcome.success, {"whole": n}, seconds)


Tried = tuple[TaskPlan | None, BlockOutcome]


def _search(
    attempt: Callable[[FloatArray], Tried],
    dimension: int,
    budget: int,
    seed: tuple[int, ...],
    sigma: float,
    begun: bool = False,
) -> tuple[Tried, int, float]:
    """Try what was shown, then search until something succeeds; count episodes and seconds.

    Where an episode has begun already what was shown is how it goes on.
    """
    best = attempt(np.zeros(dimension))
    n, seconds = int(not begun), best[1].seconds
    search = CmaEs(
        np.zeros(dimension), sigma, None, seed, restarts="ipop", n_restarts=_MOST_RESTARTS
    )
    while not best[1].success and n < budget and not search.exhausted:
        points = search.ask()
        rewards = np.empty(len(points))
        for k, point in enumerate(points):
            found = attempt(point)
            n, seconds, rewards[k] = n + 1, seconds + found[1].seconds, found[1].reward
            if (found[1].success, found[1].reward) > (best[1].success, best[1].reward):
                best = found
            if best[1].success:
                return best, n, seconds
        search.tell(points, rewards)
    return best, n, seconds


def _join(parts: Sequence[TaskPlan]) -> TaskPlan:
    """Return parts as one task."""
    starts = np.cumsum([0.0, *(part.duration for part in parts[:-1])])
    return replace(
        parts[0],
        blocks=tuple(block for part in parts for block in part.blocks),
        events_s=np.concatenate(
            [part.events_s + at for part, at in zip(parts, starts, strict=True)]
        ),
        events=tuple(event for part in parts for event in part.events),
    )
