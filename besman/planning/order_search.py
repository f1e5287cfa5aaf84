"""The shortest order of blocks that fulfils goals, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import PlanError
from besman.planning.block_effects import HandState, LearntBlock

HELD = -1
"""The spot of an object that is held."""

# A search that has come so far takes half a minute and half a gigabyte; another object takes 30
# times as much.
_MOST_STATES = 1_000_000


class OrderStep(NamedTuple):
    """One block of an order.

    Attributes
    ----------
    block : int
        Index of the learnt block.
    thing : int
        Index of the object that it takes, puts, holds, or has let go of; -1 for none.
    spot : int
        Index of the spot at which that stands or is put; -1 for none.
    """

    block: int
    thing: int = -1
    spot: int = -1


Condition = tuple[int, frozenset[int]]
"""An object, by its index, and the spots at one of which it is to stand."""


@dataclass(frozen=True, eq=False)
class OrderProblem:
    """What is to be solved.

    Attributes
    ----------
    blocks : tuple of LearntBlock
    kinds : tuple of str, length O
        Of each object.
    start : tuple of int, length O
        The spot of each.
    spots : tuple of int, length S
        The place of each spot.
    free : bool array, shape (S, S)
        Whether two objects may stand at two spots at once.
    goals : tuple of tuple of Condition
        To be fulfilled one after the other; all conditions of one at once.
    ends : frozenset of HandState
        In which the hand may be in the end.
    shown : frozenset of pair of str
        Which block was seen to follow which; of orders as short those that keep to it are better.
    """

    blocks: tuple[LearntBlock, ...]
    kinds: tuple[str, ...]
    start: tuple[int, ...]
    spots: tuple[int, ...]
    free: npt.NDArray[np.bool_]
    goals: tuple[tuple[Condition, ...], ...]
    ends: frozenset[HandState] = frozenset(("away",))
    shown: frozenset[tuple[str, str]] = frozenset()


class State(NamedTuple):
    """Where all is: spots of objects, the hand and what it is at, goals fulfilled, last block."""

    spots: tuple[int, ...]
    hand: HandState
    thing: int
    n_done: int
    last: str


class Order(NamedTuple):
    """What a search found.

    Attributes
    ----------
    steps : tuple of OrderStep, or None
        The order; None if there is none.
    n_done : int
        How many goals can be fulfilled, the first ones.
    """

    steps: tuple[OrderStep, ...] | None
    n_done: int


def find_order(problem: OrderProblem) -> Order:
    """Search breadth first over where objects stand and what the hand does.

    Of the shortest orders the one in which the fewest
    blocks follow one that they were not shown to follow; of these the first, by the blocks' order.

    Parameters
    ----------
    problem : OrderProblem

    Raises
    ------
    PlanError
        If it does not end: each object more takes many times as long.
    """
    first = _count_goals(problem, State(problem.start, "away", -1, 0, ""))
    reached: dict[State, tuple[int, tuple[OrderStep, ...]]] = {first: (0, ())}
    seen: set[State] = set()
    most = first.n_done
    while reached:
        done = [
            found
            for state, found in reached.items()
            if state.n_done == len(problem.goals) and state.hand in problem.ends
        ]
        if done:
            return Order(min(done)[1], len(problem.goals))
        seen |= reached.keys()
        if len(seen) > _MOST_STATES:
            raise PlanError(
                f"{len(problem.kinds)} objects at {len(problem.spots)} spots can stand in too many "
                f"ways: no order of blocks among the first {_MOST_STATES}; expected fewer objects, "
                "or a plan for each part of the goals"
            )
        following: dict[State, tuple[int, tuple[OrderStep, ...]]] = {}
        for state, (unseen, steps) in reached.items():
            for step, after in successors(problem, state):
                if after in seen:
                    continue
                most = max(most, after.n_done)
                new = bool(state.last) and (state.last, after.last) not in problem.shown
                found = unseen + new, (*steps, step)
                if after not in following or found < following[after]:
                    following[after] = found
        reached = following
    return Order(None, most)


def successors(problem: OrderProblem, state: State) -> Iterator[tuple[OrderStep, State]]:
    """Return what can be done next, and what is then.

    Parameters
    ----------
    problem : OrderProblem
    state : State
    """
    for number, block in enumerate(problem.blocks):
        if state.hand not in block.before:
            continue
        for thing, spot in _choices(problem, state, block):
            spots = list(state.spots)
            if block.frame != "world":
                spots[thing] = HELD if block.frame == "object" else spot
            hand = block.after(state.hand)
            at = -1 if hand == "away" else thing
            after = State(tuple(spots), hand, at, state.n_done, block.label)
            yield OrderStep(number, thing, spot), _count_goals(problem, after)


def _choices(problem: OrderProblem, state: State, block: LearntBlock) -> Iterator[tuple[int, int]]:
    """Return which objects a block may be about, and at which spot."""
    if block.frame == "world":
        yield state.thing, -1
    elif block.frame == "object":
        for thing, spot in enumerate(state.spots):
            fits = spot != HELD and problem.spots[spot] == block.place
            if fits and problem.kinds[thing] == block.thing:
                yield thing, spot
    elif problem.kinds[state.thing] == block.thing:
        others = [spot for spot in state.spots if spot != HELD]
        for spot, place in enumerate(problem.spots):
            if place == block.place and all(problem.free[spot, other] for other in others):
                yield state.thing, spot


def _count_goals(problem: OrderProblem, state: State) -> State:
    """Return a state with as many goals fulfilled as follow from it."""
    n_done = state.n_done
    while n_done < len(problem.goals) and fulfils(problem.goals[n_done], state.spots):
        n_done += 1
    return state._replace(n_done=n_done)


def fulfils(goal: Sequence[Condition], spots: Sequence[int]) -> bool:
    """Tell whether objects stand as a goal says."""
    return all(spots[thing] in wanted for thing, wanted in goal)
