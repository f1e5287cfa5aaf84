"""The order that a search finds is the best of all orders there are, by enumeration of them."""

from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from besman.exceptions import PlanError
from besman.planning import order_search
from besman.planning.block_effects import LearntBlock
from besman.planning.order_search import HELD, OrderProblem, find_order

LONGEST = 6


def block(label, frame="world", place=-1, before=("away",), thing="box"):
    return LearntBlock(
        label, frame, "" if frame == "world" else thing, place, frozenset(before), ()
    )


BLOCKS = (
    block("approach_shelf", "object", 0),
    block("approach_table", "object", 1),
    block("put_table", "target", 1, ("full",)),
    block("put_shelf", "target", 0, ("full",)),
    block("rest_right", before=("at",)),
    block("rest_down", before=("at",)),
)


def perform(problem, sequence):
    """Return the state after steps, written down anew: None where one of them cannot be done."""
    spots, hand, about, n_done = list(problem.start), "away", None, 0

    def reached():
        here = n_done
        while here < len(problem.goals) and all(
            spots[thing] in wanted for thing, wanted in problem.goals[here]
        ):
            here += 1
        return here

    n_done = reached()
    for number, thing, spot in sequence:
        own = problem.blocks[number]
        if hand not in own.before:
            return None
        if own.frame == "object":
            if spots[thing] != spot or problem.spots[spot] != own.place:
                return None
            spots[thing], hand, about = HELD, "full", thing
        elif own.frame == "target":
            others = [one for k, one in enumerate(spots) if k != thing and one != HELD]
            taken = any(not problem.free[spot, one] for one in others)
            if thing != about or problem.spots[spot] != own.place or taken:
                return None
            spots[thing], hand = spot, "at"
        else:
            if thing != (-1 if about is None else about):
                return None
            hand, about = ("full", about) if hand == "full" else ("away", None)
        n_done = reached()
    return hand, n_done


def enumerate_orders(problem, length):
    """Return the rating of every order of a length that does it."""
    steps = []
    for number, own in enumerate(problem.blocks):
        things = range(-1 if own.frame == "world" else 0, len(problem.start))
        spots = (-1,) if own.frame == "world" else range(len(problem.spots))
        steps += list(product([number], things, spots))

    def extend(sequence):
        if len(sequence) == length:
            hand, n_done = perform(problem, sequence)
            if hand in problem.ends and n_done == len(problem.goals):
                labels = [problem.blocks[step[0]].label for step in sequence]
                pairs = pairwise(labels)
                yield sum(pair not in problem.shown for pair in pairs), tuple(sequence)
            return
        for step in steps:
            if perform(problem, [*sequence, step]) is not None:
                yield from extend([*sequence, step])

    return list(extend([]))


@st.composite
def problems(draw):
    n_things = draw(st.integers(1, 2))
    spots = tuple(draw(st.lists(st.integers(0, 1), min_size=n_things, max_size=3)))
    start = tuple(draw(st.permutations(range(len(spots))))[:n_things])
    free = np.array(draw(st.lists(st.booleans(), min_size=9, max_size=9))).reshape(3, 3)
    free = (free | free.T)[: len(spots), : len(spots)]
    np.fill_diagonal(free, False)
    assume(all(free[a, b] for a in start for b in start if a != b))
    condition = st.tuples(
        st.integers(0, n_things - 1),
        st.frozensets(st.integers(0, len(spots) - 1), min_size=1, max_size=2),
    )
    goals = tuple(draw(st.lists(st.tuples(condition), min_size=1, max_size=2)))
    chosen = draw(st.lists(st.sampled_from(BLOCKS), min_size=2, max_size=6, unique=True))
    labels = [one.label for one in chosen]
    pairs = st.tuples(st.sampled_from(labels), st.sampled_from(labels))
    shown = draw(st.frozensets(pairs, max_size=6))
    return OrderProblem(
        tuple(chosen), ("box",) * n_things, start, spots, free, goals, shown=shown
    )  # fmt: skip


@settings(max_examples=80, deadline=None)
@given(problems())
def test_it_is_the_shortest_and_most_familiar_of_all_orders(problem):
    order = find_order(problem)
    longest = LONGEST if order.steps is None else len(order.steps)
    for length in range(longest + 1):
        found = enumerate_orders(problem, length)
        if order.steps is not None and length == len(order.steps):
            labels = [problem.blocks[step.block].label for step in order.steps]
            pairs = list(pairwise(labels))
            unseen = sum(pair not in problem.shown for pair in pairs)
            assert (unseen, order.steps) == min(found)
            assert order.n_done == len(problem.goals)
        else:
            assert found == []


def test_two_boxes_change_places_by_way_of_a_third_spot():
    goals = (((0, frozenset({1})), (1, frozenset({0}))),)
    apart = ~np.eye(3, dtype=bool)
    start = (0, 1)
    swap = OrderProblem(BLOCKS, ("box", "box"), start, (0, 1, 1), apart, goals)
    steps = find_order(swap).steps
    assert sum(swap.blocks[step.block].frame == "target" for step in steps) == 3
    assert perform(swap, steps) == ("away", 1)
    tight = OrderProblem(BLOCKS, ("box", "box"), start, (0, 1), apart[:2, :2], goals)
    assert find_order(tight) == (None, 0)


def test_what_is_of_another_kind_is_not_taken():
    goals = (((0, frozenset({1})),),)
    free = ~np.eye(2, dtype=bool)
    assert find_order(OrderProblem(BLOCKS, ("cup",), (0,), (0, 1), free, goals)).steps is None
    assert len(find_order(OrderProblem(BLOCKS, ("box",), (0,), (0, 1), free, goals)).steps) == 3


def test_the_hand_may_stay_where_tasks_ended_like_that():
    goals = (((0, frozenset({1})),),)
    free = ~np.eye(2, dtype=bool)
    put = OrderProblem(BLOCKS, ("box",), (0,), (0, 1), free, goals, frozenset({"away", "at"}))
    assert [put.blocks[s.block].label for s in find_order(put).steps] == [
        "approach_shelf", "put_table",
    ]  # fmt: skip


def test_more_objects_than_can_be_searched_are_an_error(monkeypatch):
    """Seven boxes that change places: the search would take all memory of the machine."""
    n = 7
    spots = tuple([0] * n + [1] * n)
    goals = (tuple((k, frozenset({n + k})) for k in range(n)),)
    problem = OrderProblem(
        BLOCKS, ("box",) * n, tuple(range(n)), spots, ~np.eye(2 * n, dtype=bool), goals
    )
    monkeypatch.setattr(order_search, "_MOST_STATES", 500)
    with pytest.raises(PlanError, match="7 objects at 14 spots can stand in too many ways: no"):
        find_order(problem)
