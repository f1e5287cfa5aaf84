"""The approach on throws without an arm: points are changes of release velocity."""

from types import SimpleNamespace

import numpy as np
import pytest

from besman.exceptions import TransferError
from besman.simulation.tasks.stick_throw.throw_and_flight import ballistic_touchdown
from besman.transfer.approach import RealTry, TransferConfig, suggest
from besman.transfer.archive import Archive, no_plans

RELEASE = np.array([0.3, 0.1, 1.2])
DIMENSION = 8
# Velocities that the coordinates change, with some that change nothing.
MIXING = np.random.default_rng(5).normal(0, 0.45, (3, DIMENSION))
MIXING[:, 5:] = 0.0
REWARD = SimpleNamespace(miss_per_m=1.0, failure=5.0)


def velocities(points):
    return np.array([1.5, 0.5, 1.0]) + np.asarray(points) @ MIXING.T


class BallSimulator:
    """Flights from one place; no throw where the ball goes down at once."""

    space = SimpleNamespace(dimension=DIMENSION)
    task = SimpleNamespace(reward=REWARD, success_radius_m=0.05)

    def __init__(self):
        self.n = 0

    def simulate(self, points, jobs=1):
        self.n += len(points)
        velocity = velocities(points)
        places = np.tile(RELEASE, (len(points), 1))
        landed = ballistic_touchdown(places, velocity)[:, :2]
        failed = velocity[:, 2] < 0.3
        landed[failed] = np.nan
        releases = np.concatenate([places, velocity], axis=1)
        releases[failed] = np.nan
        return Archive(np.array(points), landed, releases, np.where(failed, 10.0, 0.0))


def real(points, gain):
    return ballistic_touchdown(RELEASE, gain * velocities(points) + [0.1, -0.15, 0.0])[:2]


TARGET = ballistic_touchdown(RELEASE, velocities(np.zeros(DIMENSION)))[:2]


def tries_until(gain, config, most=12, fails=lambda number: False):
    archive, tries, misses = no_plans(DIMENSION), [], []
    simulator = BallSimulator()
    for number in range(most):
        choice = suggest(simulator, archive, tries, TARGET, config)
        archive = choice.archive
        outcome = real(archive.points[choice.row], gain)
        if fails(number):
            outcome = np.full(2, np.nan)
        tries.append(RealTry(choice.row, outcome))
        misses.append(np.linalg.norm(outcome - TARGET))
        if misses[-1] < 0.1:
            break
    return misses, tries, archive, simulator


@pytest.mark.parametrize("gain", [0.7, 0.8, 1.15])
def test_a_wrong_speed_is_made_up_for_in_few_tries(gain):
    misses, tries, archive, simulator = tries_until(gain, TransferConfig())
    assert misses[0] > 0.2
    assert misses[-1] < 0.1
    assert len(misses) <= 4
    # Every point is simulated once, no motion is tried twice.
    assert simulator.n == len(archive.points) == len(np.unique(archive.points, axis=0))
    assert len({one.row for one in tries}) == len(tries)


def test_a_first_try_is_what_the_simulation_holds_for_right():
    choice = suggest(BallSimulator(), no_plans(DIMENSION), (), TARGET, TransferConfig())
    assert np.linalg.norm(choice.archive.outcomes[choice.row] - TARGET) < 0.03
    np.testing.assert_array_equal(choice.landing, choice.archive.outcomes[choice.row])


def test_a_failed_try_is_gone_round():
    misses, tries, archive, _ = tries_until(
        0.75, TransferConfig(), fails=lambda number: number == 0
    )
    assert np.isnan(misses[0])
    behaviours = archive.behaviours[[one.row for one in tries]]
    assert np.linalg.norm(behaviours[1] - behaviours[0]) > 0.5
    assert misses[-1] < 0.1


def test_inverse_distance_leaves_what_transfers_badly():
    """Where only fast throws go wrong, a slow one that hits is found without any correction."""
    config = TransferConfig(surrogate="inverse_distance")
    archive, tries = no_plans(DIMENSION), []
    for _ in range(10):
        choice = suggest(BallSimulator(), archive, tries, TARGET, config)
        archive = choice.archive
        up = velocities(archive.points[choice.row])[2]
        outcome = archive.outcomes[choice.row] + [max(0.0, up - 0.9), 0.0]
        tries.append(RealTry(choice.row, outcome))
        if np.linalg.norm(outcome - TARGET) < 0.06:
            break
    assert np.linalg.norm(tries[0].outcome - TARGET) > 0.06
    assert np.linalg.norm(tries[-1].outcome - TARGET) < 0.06


def test_the_seed_decides_and_nothing_else():
    config = TransferConfig(generations=2)
    first, again = (tries_until(0.75, config)[2] for _ in range(2))
    np.testing.assert_array_equal(first.points, again.points)
    other = tries_until(0.75, TransferConfig(generations=2, seed=1))[2]
    assert not np.array_equal(first.points[:24], other.points[:24])


def test_what_may_not_be_tried_is_not_suggested():
    config = TransferConfig(generations=1)
    choice = suggest(
        BallSimulator(), no_plans(DIMENSION), (), TARGET, config, accept=lambda point: point[0] < 0
    )
    assert choice.archive.points[choice.row, 0] < 0
    with pytest.raises(TransferError, match="none of 72 simulated motions may be tried on the arm"):
        suggest(
            BallSimulator(), no_plans(DIMENSION), (), TARGET, config, accept=lambda point: False
        )
