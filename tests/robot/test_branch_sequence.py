import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.robot.branch_sequence import choose_sequences

TURN = 2 * np.pi


def cheapest(states, costs, reach, circular):
    """Every sequence tried, with the cost of a step as documented."""
    best = np.inf
    for sequence in itertools.product(range(states.shape[1]), repeat=len(states)):
        path = states[np.arange(len(states)), sequence]
        steps = np.diff(path, axis=0)
        steps = np.where(circular, steps - TURN * np.rint(steps / TURN), steps)
        steps = np.abs(steps) / reach
        cost = costs[np.arange(len(states)), sequence].sum() + 1e-6 * np.sum(steps**2)
        best = min(best, cost + 0.01 * np.maximum(steps.max(axis=1) - 3, 0).sum())
    return best


def price(path, states, costs, reach):
    """Cost of a sequence that is given by its angles."""
    which = [
        np.abs((states[t] - path[t] + np.pi) % TURN - np.pi).max(axis=1).argmin()
        for t in range(len(path))
    ]
    steps = np.abs(np.diff(path, axis=0)) / reach
    cost = costs[np.arange(len(path)), which].sum() + 1e-6 * np.sum(steps**2)
    return cost + 0.01 * np.maximum(steps.max(axis=1) - 3, 0).sum()


@given(st.integers(0, 10_000), st.booleans())
@settings(max_examples=60, deadline=None)
def test_the_sequence_is_the_best_of_all(seed, wide):
    rng = np.random.default_rng(seed)
    box = np.full(2, 3 * TURN if wide else 3.0)
    states = rng.uniform(-3, 3, (5, 3, 2))
    costs = rng.exponential(0.05, (5, 3))
    costs[rng.random((5, 3)) < 0.1] = np.inf
    reach = np.array([0.1, 0.2])
    found = choose_sequences(states, costs, reach, -box, box, np.zeros(2), 2)
    best = cheapest(states, costs, reach, wide)
    if not np.isfinite(best):
        assert found.shape == (0, 5, 2)
        return
    assert price(found[0], states, costs, reach) == pytest.approx(best)
    assert np.all(np.abs(found) <= box)


def test_a_turning_joint_is_unwound_next_to_home():
    angles = np.linspace(0, 1.9 * TURN, 80)
    states = ((angles + np.pi) % TURN - np.pi)[:, None, None]
    limits = np.array([TURN])
    path = choose_sequences(
        states, np.zeros((80, 1)), np.array([0.2]), -limits, limits, np.zeros(1), 1
    )[0, :, 0]
    np.testing.assert_allclose(path, angles - TURN, atol=1e-9)


def test_a_joint_that_turns_further_than_its_limits_jumps_once_by_a_full_turn():
    angles = np.linspace(0, 2.5 * TURN, 80)
    states = ((angles + np.pi) % TURN - np.pi)[:, None, None]
    limits = np.array([TURN])
    path = choose_sequences(
        states, np.zeros((80, 1)), np.array([0.2]), -limits, limits, np.zeros(1), 1
    )[0, :, 0]
    assert np.all(np.abs(path) <= TURN)
    np.testing.assert_allclose((path - angles + 1) % TURN, 1, atol=1e-9)
    assert np.sum(np.abs(np.diff(path)) > 3) == 1
