import numpy as np
import pytest

from besman.exceptions import ConfigError
from besman.synthetic.sequenced_dmps import (
    GOAL_M,
    SUBGOALS_M,
    follow_moving_goal,
    generate_sequenced_dmps,
)

START = (np.array([0.1, -0.2]), np.array([0.3, 0.0]))
END = (np.array([0.8, 0.5]), np.array([0.4, -0.6]))


def test_without_forcing_the_movement_is_the_moving_goal():
    """The attractor stays on the polynomial: start and end are met with their velocities."""
    path, (position, velocity) = follow_moving_goal(START, END, np.zeros((2, 4)), 100, 100.0)
    np.testing.assert_allclose(path[0], START[0])
    np.testing.assert_allclose(position, END[0], atol=1e-4)
    np.testing.assert_allclose(velocity, END[1], atol=1e-2)


def test_the_forcing_fades():
    weights = np.random.default_rng(0).normal(size=(2, 8))
    bent, (position, velocity) = follow_moving_goal(START, END, weights, 100, 100.0)
    straight, _ = follow_moving_goal(START, END, 0 * weights, 100, 100.0)
    assert np.abs(bent - straight).max() > 1e-4
    np.testing.assert_allclose(position, END[0], atol=2e-3)
    np.testing.assert_allclose(velocity, END[1], atol=2e-2)


def test_nine_movements_pass_their_subgoals_at_speed():
    movements = generate_sequenced_dmps()
    assert len(movements) == 9
    for movement in movements:
        path = movement.positions
        np.testing.assert_allclose(path[0], 0, atol=1e-12)
        np.testing.assert_allclose(path[-1], GOAL_M, atol=0.02)
        np.testing.assert_allclose(path[movement.border], SUBGOALS_M[movement.subgoal], atol=0.02)
        speed = np.linalg.norm(np.gradient(path, axis=0), axis=1) * movement.rate_hz
        assert speed[movement.border] > 0.05
        lowest = 50 + np.argmin(speed[50:-50])
        assert abs(lowest - movement.border) <= 0.1 * movement.rate_hz
        assert movement.truth().bounds[0, 1] == movement.border
        assert movement.recording().source == movement.truth().source


def test_noise_and_seed():
    clean, noisy, other = (
        generate_sequenced_dmps()[4],
        generate_sequenced_dmps(0.01)[4],
        generate_sequenced_dmps(seed=1)[4],
    )
    rest = noisy.positions - clean.positions
    assert rest.std() == pytest.approx(0.01, rel=0.15)
    assert other.positions.shape != clean.positions.shape or not np.allclose(
        other.positions, clean.positions
    )
    np.testing.assert_array_equal(clean.positions, generate_sequenced_dmps()[4].positions)


def test_numbers_out_of_range_are_refused():
    with pytest.raises(ConfigError, match=r"noise_m: got -1\.0, expected 0\.0 to 1\.0"):
        generate_sequenced_dmps(-1.0)
    with pytest.raises(ConfigError, match="rate_hz: got 5, expected 20"):
        generate_sequenced_dmps(rate_hz=5)
