"""The normal equations against finite differences of the cost that they are to lower."""

import numpy as np
import pytest

from besman.robot.path_smoothness import add_time, time_cost

N_POSES, N = 5, 2
SCALES = np.array([[2.0, 3.0], [5.0, 7.0]])


def equations(angles, rush):
    """Return the matrix and the right side that are added for a path, as full arrays."""
    size = N_POSES * N
    band, downhill = np.zeros((size, 2 * N + 1)), np.zeros(size)
    add_time(angles, SCALES, rush, band, downhill)
    matrix = np.zeros((size, size))
    for i in range(size):
        for k in range(min(i, 2 * N) + 1):
            matrix[i, i - k] = matrix[i - k, i] = band[i, k]
    return matrix, downhill


@pytest.mark.parametrize("rush", [(9.0, 90.0), (0.3, 0.5)])
def test_the_right_side_is_half_the_slope_downhill_and_the_matrix_its_change(rush):
    rush = np.array(rush)
    angles = np.random.default_rng(0).normal(size=(N_POSES, N))
    matrix, downhill = equations(angles, rush)
    step = 1e-5
    for i in range(angles.size):
        move = np.zeros(angles.size)
        move[i] = step
        move = move.reshape(angles.shape)
        up, down = (time_cost(angles + sign * move, SCALES, rush) for sign in (1, -1))
        assert downhill[i] == pytest.approx(-(up - down) / (4 * step), rel=1e-4, abs=1e-10)
        after, before = (equations(angles + sign * move, rush)[1] for sign in (1, -1))
        np.testing.assert_allclose(
            matrix[:, i], -(after - before) / (2 * step), rtol=1e-4, atol=1e-10
        )


def test_a_path_that_rests_costs_nothing_and_a_jump_most():
    rush, still = np.array([1.0, 1.0]), np.zeros((N_POSES, N))
    assert time_cost(still, SCALES, rush) == 0.0
    ramp = np.linspace(0, 1, N_POSES)[:, None] * np.ones(N)
    jump = np.where(np.arange(N_POSES) < 2, 0.0, 1.0)[:, None] * np.ones(N)
    assert time_cost(ramp, SCALES, rush) < 0.1 * time_cost(jump, SCALES, rush)
