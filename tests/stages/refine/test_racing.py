"""Races: nothing is tried that cannot change who is best, and who is best is found."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from besman.stages.refine.racing import race

TABLES = st.integers(1, 5).flatmap(
    lambda n: st.lists(st.lists(st.booleans(), min_size=n, max_size=n), min_size=1, max_size=6)
)


def run(table, most=1000, fewest=None):
    tried = []

    def attempt(motion, model):
        tried.append((motion, model))
        return SimpleNamespace(success=table[motion][model])

    n = len(table[0])
    rewards = -np.arange(len(table), dtype=float)
    found = race(rewards.tolist(), n, most, n if fewest is None else fewest, attempt)
    return found, tried


@given(TABLES)
def test_the_best_of_all_is_found_by_trying_no_more_than_is_open(table):
    """Brute force: failures of every motion in all models."""
    found, tried = run(table)
    n, failures = len(table[0]), [row.count(False) for row in table]
    complete = {at: sum(not one.success for one in row) for at, row in enumerate(found)}
    done = [at for at, row in enumerate(found) if len(row) == n]
    if min(failures) < n:
        best = min(done, key=complete.get)
        assert complete[best] == min(failures)
        assert best == failures.index(min(failures))
    else:
        # All fail everywhere: that one is as good as the other is clear with the last attempt.
        assert all(complete[at] == n for at in range(len(table)))
    assert len(tried) == len(set(tried)) == sum(map(len, found))


@given(TABLES, st.integers(0, 4))
def test_who_cannot_be_better_than_before_is_left(table, fewest):
    found, _ = run(table, fewest=fewest)
    for row in found:
        assert sum(not one.success for one in row[:-1]) < max(fewest, 1)


def test_the_better_starts_and_the_budget_ends_it():
    found, tried = run([[True] * 4, [True] * 4])
    assert tried == [(0, 0), (0, 1), (0, 2), (0, 3)]  # the other can do no better
    assert not found[1]
    found, tried = run([[True] * 4], most=3)
    assert len(tried) == 3
