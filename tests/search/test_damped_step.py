"""The damped step against the pseudoinverse and a solver with bounds."""

import numpy as np
from scipy.optimize import lsq_linear

from besman.search.damped_step import damped_step

RNG = np.random.default_rng(4)
ROWS, RESIDUALS = RNG.normal(size=(2, 5)), np.array([1.0, -0.6])
NONE, ALL = np.full(5, -np.inf), np.ones(5)


def test_without_a_floor_it_is_of_least_norm():
    step = damped_step(ROWS, RESIDUALS, ALL, 1e-12, 9.0, NONE)
    np.testing.assert_allclose(step, -np.linalg.pinv(ROWS) @ RESIDUALS, atol=1e-9)
    short = damped_step(ROWS, RESIDUALS, ALL, 1e-12, 0.1, NONE)
    np.testing.assert_allclose(short, 0.1 * step / np.linalg.norm(step), atol=1e-9)


def test_the_others_make_up_for_what_stops_at_its_floor():
    free = damped_step(ROWS, RESIDUALS, ALL, 0.05, 9.0, NONE)
    floor = np.where(np.arange(5) == free.argmin(), 0.3 * free, -np.inf)
    step = damped_step(ROWS, RESIDUALS, ALL, 0.05, 9.0, floor)
    damped = np.concatenate([ROWS, np.sqrt(0.05) * np.eye(5)])
    wanted = -np.concatenate([RESIDUALS, np.zeros(5)])
    best = lsq_linear(damped, wanted, (floor, np.inf), tol=1e-12).x
    np.testing.assert_allclose(step, best, atol=1e-6)
    assert np.any(step == floor)


def test_where_nothing_may_move_nothing_does():
    np.testing.assert_array_equal(damped_step(ROWS, RESIDUALS, 0 * ALL, 0.1, 1.0, NONE), 0.0)
