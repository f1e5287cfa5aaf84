"""Refinement of a whole task block by block, and all of it as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
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
from besman.stages.refine.block_detours import lead_part_around
from besman.stages.refine.block_parts import Part, n_parameters, shape_part

FloatArray = npt.NDArray[np.float64]

# Where nothing at all can be done, a search ends at once, and begins anew with more points.
_MOST_RESTARTS = 6


Tried = tuple[TaskPlan | None, BlockOutcome]


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
    fails there are others begun, in the state in which that part began. That state tells how the
    box hangs in the hand: putting it is searched around where it then comes to stand at its place,
    not around where the hand was shown to be. In the end all is simulated at once: where that fails
    the search goes on with the first part that does, in the state in which it has begun there.

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
    search = _BlockSearch(parts, way, trials, budget, seed, sigma)
    state = trials.first(parts[0].plan.blocks[0].start)
    first, failed, whole = 0, None, None
    for attempt in count():
        if not search.go_on(first, state, failed, attempt):
            break
        whole = join_parts([plan for plan, _ in search.done])
        outcomes = search.confirm(whole)
        if all(outcome.success for outcome in outcomes):
            return search.found(whole, True)
        first = next(k for k, outcome in enumerate(outcomes) if not outcome.success)
        before = outcomes[first - 1].end if first else state
        if before is None or search.episodes[parts[first].goal] >= budget:
            break
        state, failed = before, outcomes[first]
    return search.found(whole, False)


class _BlockSearch:
    """What a search of blocks has come to so far: of each part its numbers, plan and outcome."""

    def __init__(
        self,
        parts: Sequence[Part],
        way: GraspWay,
        trials: BlockTrials,
        budget: int,
        seed: int,
        sigma: float,
    ) -> None:
        self.parts, self.way, self.trials = parts, way, trials
        self.budget, self.seed, self.sigma = budget, seed, sigma
        self.at = [np.zeros(n_parameters(part.goal)) for part in parts]
        self.done: list[tuple[TaskPlan, BlockOutcome]] = []
        self.episodes: dict[str, int] = {}
        self.rewards: list[float] = []
        self.seconds = 0.0

    def found(self, whole: TaskPlan | None, success: bool) -> Found:
        """Return it as the result."""
        return Found(whole, success, self.episodes, self.seconds, np.array(self.rewards))

    def go_on(
        self, first: int, state: BlockState, failed: BlockOutcome | None, attempt: int
    ) -> bool:
        """Search from a part on, which begins in a state; tell whether all succeed."""
        known = None if failed is None else (self.done[first][0], failed)
        del self.done[first:]
        for number in range(first, len(self.parts)):
            goal = self.parts[number].goal
            before = sum(outcome.reward for _, outcome in self.done)
            part = self._begin(number, state)
            told = _search(
                partial(self._attempt, part, state), self.at[number],
                self.budget - self.episodes.get(goal, 0), (self.seed, number, attempt), self.sigma,
                begun=number > first, known=known,
            )  # fmt: skip
            known = None
            self.episodes[goal] = self.episodes.get(goal, 0) + told.n
            self.seconds += told.simulated_s
            to_come = (len(self.parts) - 1 - number) * IMPOSSIBLE.reward
            gained = [before + reward + to_come for reward in told.rewards]
            if number > first:
                # The episode that has come from the part before goes on.
                self.rewards[-1] = gained.pop(0)
            self.rewards += gained
            plan, outcome = told.best
            self.at[number] = told.at
            if plan is None or outcome.end is None:
                return False
            self.done.append((plan, outcome))
            state = outcome.end
            if not outcome.success:
                return False
        return True

    def confirm(self, whole: TaskPlan) -> tuple[BlockOutcome, ...]:
        """Simulate all at once: an episode of its own."""
        plans, goals = [plan for plan, _ in self.done], [part.goal for part in self.parts]
        outcomes = self.trials.attempt_whole(whole, plans, goals)
        self.episodes["whole"] = self.episodes.get("whole", 0) + 1
        self.seconds += sum(outcome.seconds for outcome in outcomes)
        self.rewards.append(sum(outcome.reward for outcome in outcomes))
        return outcomes

    def _begin(self, number: int, state: BlockState) -> Part:
        """Return a part as it begins in a state: to where the box stands, around what is there."""
        part = self.parts[number]
        if part.goal == "put":
            part = part._replace(tool=self.trials.tool_at_place(state))
        try:
            return lead_part_around(part, self.way, self.trials, [plan for plan, _ in self.done])
        except PlanError:
            return part

    def _attempt(self, part: Part, state: BlockState, x: FloatArray) -> Tried:
        last = self.done[-1][0] if self.done else None
        try:
            plan = shape_part(part, self.way, self.trials.robot, x, last)
        except PlanError:
            return None, IMPOSSIBLE
        return plan, self.trials.attempt(plan, state, part.goal)


def search_whole(
    parts: Sequence[Part], way: GraspWay, trials: BlockTrials, budget: int, seed: int, sigma: float
) -> Found:
    """Refine all parts at once; every episode is the whole task, simulated at once.

    Its reward is the sum of those of all parts; what is not come to has the worst.

    Parameters
    ----------
    parts, way, trials, budget, seed, sigma
        As of `search_blocks`.
    """
    goals = [part.goal for part in parts]
    ends = np.cumsum([n_parameters(goal) for goal in goals])

    def attempt(x: FloatArray) -> Tried:
        done: list[TaskPlan] = []
        for part, own in zip(parts, np.split(x, ends[:-1]), strict=True):
            try:
                done.append(shape_part(part, way, trials.robot, own, done[-1] if done else None))
            except PlanError:
                break
        outcomes = trials.attempt_whole(join_parts(done), done, goals[: len(done)]) if done else ()
        outcomes += (IMPOSSIBLE,) * (len(parts) - len(done))
        reward = sum(outcome.reward for outcome in outcomes)
        seconds = sum(outcome.seconds for outcome in outcomes)
        success = all(outcome.success for outcome in outcomes)
        joined = join_parts(done) if len(done) == len(parts) else None
        return joined, BlockOutcome(reward, success, outcomes[-1].end, seconds)

    told = _search(attempt, np.zeros(int(ends[-1])), budget, (seed,), sigma)
    plan, outcome = told.best
    rewards = np.array(told.rewards)
    return Found(plan, outcome.success, {"whole": told.n}, told.simulated_s, rewards)


class _Told(NamedTuple):
    """What one search was told: the best and its numbers, episodes begun, seconds, all rewards."""

    best: Tried
    at: FloatArray
    n: int
    simulated_s: float
    rewards: list[float]


def _search(
    attempt: Callable[[FloatArray], Tried],
    start: FloatArray,
    budget: int,
    seed: tuple[int, ...],
    sigma: float,
    begun: bool = False,
    known: Tried | None = None,
) -> _Told:
    """Try numbers, zeros for what was shown, then search around them until something succeeds.

    Where an episode has begun already these are how it goes on; where it is known what comes of
    them they are not tried.
    """
    n, seconds, told, at = 0, 0.0, list[float](), start
    if known is None:
        known = attempt(start)
        n, seconds, told = int(not begun), known[1].seconds, [known[1].reward]
    best = known
    search = CmaEs(start, sigma, None, seed, restarts="ipop", n_restarts=_MOST_RESTARTS)
    while not best[1].success and n < budget and not search.exhausted:
        points = search.ask()
        rewards = np.empty(len(points))
        for k, point in enumerate(points):
            found = attempt(point)
            n, seconds, rewards[k] = n + 1, seconds + found[1].seconds, found[1].reward
            told.append(found[1].reward)
            if (found[1].success, found[1].reward) > (best[1].success, best[1].reward):
                best, at = found, point
            if best[1].success:
                return _Told(best, at, n, seconds, told)
        search.tell(points, rewards)
    return _Told(best, at, n, seconds, told)


def join_parts(parts: Sequence[TaskPlan]) -> TaskPlan:
    """Return parts, in their order, as one task."""
    starts = np.cumsum([0.0, *(part.duration for part in parts[:-1])])
    return replace(
        parts[0],
        blocks=tuple(block for part in parts for block in part.blocks),
        events_s=np.concatenate(
            [part.events_s + at for part, at in zip(parts, starts, strict=True)]
        ),
        events=tuple(event for part in parts for event in part.events),
    )
