"""The transferability approach on throws without an arm."""

import numpy as np
import pytest
from ballistic_throws import DIMENSION, TARGET, BallSimulator, real, velocities

from besman.exceptions import TransferError
from besman.transfer.approach import RealTry, TransferConfig, suggest
from besman.transfer.archive import no_plans


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
