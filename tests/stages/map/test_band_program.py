"""Quadratic programs with bands: against dense matrices and another solver."""

import numpy as np
import osqp
import pytest
import scipy.sparse as sp

from besman.stages.map.band_program import (
    factor_columns,
    solve_band_program,
    solve_columns,
)


def lower_columns(matrix, width):
    """The lower triangle by columns."""
    size = len(matrix)
    columns = np.zeros((size, width))
    for j in range(size):
        part = matrix[j : j + width, j]
        columns[j, : len(part)] = part
    return columns


def draw_matrix(rng, size, width):
    """A positive definite band."""
    half = np.triu(np.tril(rng.normal(size=(size, size)), 0), 1 - width)
    return half @ half.T + 0.1 * np.eye(size)


@pytest.mark.parametrize(("size", "width"), [(1, 1), (4, 6), (30, 7)])
def test_a_band_is_solved_as_a_full_matrix(size, width):
    rng = np.random.default_rng(size)
    matrix, right = draw_matrix(rng, size, width), rng.normal(size=size)
    band, answer = lower_columns(matrix, width), right.copy()
    factor_columns(band)
    solve_columns(band, answer)
    np.testing.assert_allclose(answer, np.linalg.solve(matrix, right), rtol=1e-8)


def full_rows(count, n, weights, rows):
    """What is limited, as a full matrix."""
    steps = np.diff(np.eye(count), axis=0)
    bends = np.diff(weights[:, None] * steps, axis=0)
    full = np.kron(np.vstack([np.eye(count), steps, bends]), np.eye(n))
    if not len(rows):
        return full
    half, further = rows.shape[1] // n // 2, np.zeros((count * n, (count + 2 * 5) * n))
    for i, row in enumerate(rows):
        first = (i // n - half + 5) * n
        further[i, first : first + len(row)] = row
    return np.vstack([full, further[:, 5 * n : (count + 5) * n]])


@pytest.mark.parametrize("further", [False, True])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_answer_of_another_solver(seed, further):
    rng = np.random.default_rng(seed)
    count, n = 9, 2
    width = 11 * n if further else 6 * n
    hessian = draw_matrix(rng, count * n, 6 * n)
    gradient = rng.normal(scale=3.0, size=count * n)
    weights = rng.uniform(0.5, 1.5, count - 1)
    rows = rng.normal(size=(count * n, 11 * n)) if further else np.empty((0, n))
    # Rows of points that are not there.
    for i in range(len(rows)):
        points = i // n - 5 + np.arange(11 * n) // n
        rows[i, (points < 0) | (points >= count)] = 0.0
    matrix = full_rows(count, n, weights, rows)
    room = rng.uniform(0.05, 0.6, (2, len(matrix)))
    band, found = lower_columns(hessian, width), np.empty(count * n)
    missed, _ = solve_band_program(band, gradient, n, weights, rows, room, found)
    assert missed < 1e-8
    solver = osqp.OSQP()
    solver.setup(
        sp.csc_matrix(hessian), gradient, sp.csc_matrix(matrix), -room[1], room[0],
        eps_abs=1e-10, eps_rel=1e-10, max_iter=100_000, verbose=False, polishing=True,
    )  # fmt: skip
    np.testing.assert_allclose(found, solver.solve(raise_error=True).x, atol=1e-6)
    values = matrix @ found
    assert np.sum((values > room[0] - 1e-6) | (values < 1e-6 - room[1])) > 3


def test_bounds_that_exclude_each_other_are_missed():
    band, found = np.ones((4, 2)) * [2.0, 0.1], np.empty(4)
    room = np.full((2, 9), 1.0)
    room[0] = -2.0
    missed, _ = solve_band_program(band, np.ones(4), 1, np.ones(3), np.empty((0, 1)), room, found)
    assert not missed < 1e-3
