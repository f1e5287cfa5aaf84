"""Best groupings against enumeration of all of them."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from besman.exceptions import RecognitionError
from besman.stages.compose.vhms import GroupingSearch, best_grouping


def enumerate_best(uncertainty, longest=None):
    """Go through every grouping; of equal ones fewest groups, then shortest from the back."""
    n = len(uncertainty)
    best = None
    for cuts in itertools.product((False, True), repeat=n - 1):
        borders = (0, *(k + 1 for k, cut in enumerate(cuts) if cut), n)
        groups = list(itertools.pairwise(borders))
        if longest is not None and any(end - start > longest for start, end in groups):
            continue
        total = sum(Fraction(float(uncertainty[start, end - 1])) for start, end in groups)
        back = tuple(end - start for start, end in reversed(groups))
        key = (total / len(groups), len(groups), back)
        if best is None or key < best[0]:
            best = (key, borders)
    return best[1], -float(best[0][0])


@pytest.mark.parametrize("n", range(1, 13))
def test_equals_enumeration_up_to_twelve_blocks(n):
    rng = np.random.default_rng(n)
    for _ in range(3):
        uncertainty = rng.random((n, n))
        borders, fitness = enumerate_best(uncertainty)
        found = best_grouping(uncertainty)
        assert found.borders == borders
        assert found.fitness == pytest.approx(fitness, abs=1e-12)


@settings(max_examples=150, deadline=None)
@given(st.integers(1, 9).flatmap(lambda n: arrays(int, (n, n), elements=st.integers(0, 4))))
def test_ties_go_to_fewest_groups_then_shortest_last(uncertainty):
    borders, fitness = enumerate_best(uncertainty)
    found = best_grouping(uncertainty)
    assert found.borders == borders
    assert found.fitness == pytest.approx(fitness, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 9).flatmap(lambda n: arrays(int, (n, n), elements=st.integers(0, 9))),
    st.integers(1, 4),
)
def test_longest_bounds_the_groups(uncertainty, longest):
    assert best_grouping(uncertainty, longest).borders == enumerate_best(uncertainty, longest)[0]


@pytest.mark.parametrize("n", [20, 40])
def test_many_blocks_grow_the_table(n):
    uncertainty = np.full((n, n), 1.0)
    for first in range(0, n, 4):
        uncertainty[first, first + 3] = 0.0
    assert best_grouping(uncertainty).borders == tuple(range(0, n + 1, 4))


def feed(search, uncertainty):
    """Add the blocks of a whole table one by one."""
    for end in range(len(uncertainty)):
        search.add(uncertainty[end - search.reach + 1 : end + 1, end][::-1])
        yield search.best()


def test_each_prefix_is_the_best_of_its_blocks():
    uncertainty = np.random.default_rng(0).random((9, 9))
    for n, found in enumerate(feed(GroupingSearch(), uncertainty), start=1):
        assert found.borders == enumerate_best(uncertainty[:n, :n])[0]


def test_a_horizon_beyond_the_end_changes_nothing():
    uncertainty = np.random.default_rng(1).random((30, 30))
    *_, found = feed(GroupingSearch(longest=5, horizon=30), uncertainty)
    assert found == best_grouping(uncertainty, 5)


def test_settled_groups_stay_and_memory_is_bounded():
    uncertainty = np.random.default_rng(2).random((300, 300))
    search = GroupingSearch(longest=5, horizon=10)
    settled = (0,)
    for found in feed(search, uncertainty):
        assert found.borders[: len(settled)] == settled
        settled = found.borders[: search.n_settled + 1]
        assert search.n_blocks - search.first_open <= 10 + 5
    assert found.fitness <= best_grouping(uncertainty, 5).fitness + 1e-12
    groups = list(itertools.pairwise(found.borders))
    assert found.fitness == pytest.approx(-np.mean([uncertainty[a, b - 1] for a, b in groups]))


def test_no_border_is_certain_under_a_mean():
    """Blocks that fit nothing make it worthwhile to cut all that went before."""
    n = 12
    uncertainty = np.full((n, n), 0.5)
    uncertainty[0, 3] = 0.0
    before = best_grouping(uncertainty[:4, :4])
    uncertainty[:, 4:] = 50.0
    after = best_grouping(uncertainty)
    assert before.borders == (0, 4)
    assert after.borders[:5] == (0, 1, 2, 3, 4)


def test_a_copy_goes_on_alone():
    uncertainty = np.random.default_rng(3).random((8, 8))
    search = GroupingSearch()
    list(feed(search, uncertainty[:5, :5]))
    twin, best = search.copy(), search.best()
    twin.add(uncertainty[:6, 5][::-1])
    assert search.best() == best
    assert twin.best().borders == enumerate_best(uncertainty[:6, :6])[0]


def test_one_block_is_one_group():
    found = best_grouping([[0.25]])
    assert (found.borders, found.fitness) == ((0, 1), -0.25)


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (lambda: best_grouping(np.empty((0, 0))), "got no blocks"),
        (lambda: best_grouping(np.zeros(3)), r"shape \(3,\), expected \(n, n\)"),
        (lambda: best_grouping([[0.1, np.nan], [0, 0.1]]), "block 1.*group of 2 blocks is nan"),
        (lambda: best_grouping([[-np.inf]]), "is -inf; expected a number"),
        (lambda: best_grouping([[np.inf]]), "no grouping of 1 blocks is allowed"),
        (lambda: best_grouping([[0.1]], longest=0), "longest is 0; expected at least 1"),
        (lambda: GroupingSearch(horizon=0), "horizon is 0; expected at least 1"),
        (lambda: GroupingSearch().add([0.1, 0.2]), r"shape \(2,\), expected \(1,\)"),
    ],
)
def test_bad_input(run, message):
    with pytest.raises(RecognitionError, match=message):
        run()
