"""Arms are moved away from what they would touch, as little as serves."""

import numpy as np
import pytest

from besman.robot.clearance import move_clear
from besman.robot.collision import distances

CLEARANCE_M = 0.02


@pytest.fixture(scope="module")
def drawn(robot):
    rng = np.random.default_rng(4)
    return robot.home + rng.uniform(-1.5, 1.5, (400, robot.n))


def test_what_is_clear_stays_as_it_is(robot, drawn):
    clear = drawn[distances(robot.chain, drawn).min(axis=1) >= CLEARANCE_M]
    for positions in clear[:20]:
        np.testing.assert_array_equal(move_clear(robot, positions, CLEARANCE_M), positions)


def test_what_comes_too_near_is_moved_little(robot, drawn):
    near = distances(robot.chain, drawn).min(axis=1)
    touching = drawn[(near > 0.0) & (near < CLEARANCE_M)][:6]
    assert len(touching) == 6
    ways = np.random.default_rng(5).normal(size=(3000, robot.n))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    for positions in touching:
        moved = move_clear(robot, positions, CLEARANCE_M)
        assert distances(robot.chain, moved).min() >= CLEARANCE_M - 1e-6
        # Brute force: no way that is half as long serves, whichever direction it takes.
        half = 0.5 * np.linalg.norm(moved - positions)
        assert distances(robot.chain, positions + half * ways).min(axis=1).max() < CLEARANCE_M


def test_joints_stay_in_their_ranges(robot):
    beyond = robot.limits.position_max + 1.0
    moved = move_clear(robot, beyond, CLEARANCE_M)
    assert np.all(moved <= robot.limits.position_max)
