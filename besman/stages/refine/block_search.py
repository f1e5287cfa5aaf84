"""Refinement of a whole task block by block, and all of it as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.motion.grasp_way import GraspWay
from besman.records import TaskPlan
from besman.search.cma_es import CmaEs
from besman.simulation.tasks.rearrange.block_trials import (
    IMPOSSIBLE,
    BlockOutcome,
    BlockState,
    BlockTrials,
)
from besman.stages.refine.block_parts import Part, n_parameters, shape_part

FloatArray = npt.NDArray[np.float64]

# Where nothing at all can be done, a search ends at once, and begins anew with more points.
_MOST_RESTARTS = 6


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
    rewards : array, shape (E,)
        Of each of them: the sum over all parts, the worst for those that it did not come to.
    """

    plan: TaskPlan | None
    success: bool
    episodes: dict[str, int]
    simulated_s: float
    rewards: FloatArray


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
    rewards: list[float] = []
    seconds, success, before = 0.0, True, 0.0
    for number, part in enumerate(parts):

        def attempt(
            x: FloatArray, part: Part = part, state: BlockState = state
        ) -> tuple[TaskPlan | None, BlockOutcome]:
            try:
                plan = shape_part(part, way, trials.robot, x, done[-1] if done else None)
            except PlanError:
                return None, IMPOSSIBLE
            return plan, trials.attempt(plan, state, part.goal)

        told = _search(attempt, n_parameters(part.goal), budget, (seed, number), sigma, number > 0)
        plan, outcome = told.best
        episodes[part.goal], seconds = told.n, seconds + told.simulated_s
        to_come = (len(parts) - 1 - number) * IMPOSSIBLE.reward
        gained = [before + reward + to_come for reward in told.rewards]
        if number > 0:
            # The episode that has come from the part before goes on.
            rewards[-1] = gained.pop(0)
        rewards += gained
        before += outcome.reward
        success &= outcome.success
        if plan is None or outcome.end is None:
            break
        done.append(plan)
        state = outcome.end
        if not outcome.success:
            break
    whole = _join(done) if len(done) == len(parts) else None
    return Found(whole, success, episodes, seconds, np.array(rewards))


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
                    plan = shape_part(part, way, trials.robot, own, done[-1] if done else None)
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

    told = _search(attempt, int(ends[-1]), budget, (seed,), sigma)
    plan, outcome = told.best
    rewards = np.array(told.rewards)
    return Found(plan, outcome.success, {"whole": told.n}, told.simulated_s, rewards)


Tried = tuple[TaskPlan | None, BlockOutcome]


class _Told(NamedTuple):
    """What one search was told: the best, episodes begun, seconds simulated, all rewards."""

    best: Tried
    n: int
    simulated_s: float
    rewards: list[float]


def _search(
    attempt: Callable[[FloatArray], Tried],
    dimension: int,
    budget: int,
    seed: tuple[int, ...],
    sigma: float,
    begun: bool = False,
) -> _Told:
    """Try what was shown, then search until something succeeds.

    Where an episode has begun already what was shown is how it goes on.
    """
    best = attempt(np.zeros(dimension))
    n, seconds, told = int(not begun), best[1].seconds, [best[1].reward]
    search = CmaEs(
        np.zeros(dimension), sigma, None, seed, restarts="ipop", n_restarts=_MOST_RESTARTS
    )
    while not best[1].success and n < budget and not search.exhausted:
        points = search.ask()
        rewards = np.empty(len(points))
        for k, point in enumerate(points):
            found = attempt(point)
            n, seconds, rewards[k] = n + 1, seconds + found[1].seconds, found[1].reward
            told.append(found[1].reward)
            if (found[1].success, found[1].reward) > (best[1].success, best[1].reward):
                best = found
            if best[1].success:
                return _Told(best, n, seconds, told)
        search.tell(points, rewards)
    return _Told(best, n, seconds, told)


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
