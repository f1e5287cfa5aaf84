import numpy as np
import pytest

from besman.robot.band_system import solve_band


@pytest.mark.parametrize(("size", "width"), [(1, 0), (5, 2), (12, 4), (3, 6)])
def test_a_band_is_solved_as_the_full_matrix_is(size, width):
    random = np.random.default_rng(size)
    root = np.tril(random.normal(size=(size, size)))
    root[np.subtract.outer(np.arange(size), np.arange(size)) > width] = 0.0
    matrix, right = root @ root.T + np.eye(size), random.normal(size=size)
    band = np.zeros((size, width + 1))
    for i in range(size):
        for k in range(min(i, width) + 1):
            band[i, k] = matrix[i, i - k]
    solution = right.copy()
    solve_band(band, solution, width)
    np.testing.assert_allclose(solution, np.linalg.solve(matrix, right), rtol=1e-9)
