from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import osqp
import pytest
import scipy.sparse as sp
from scipy.interpolate import BSpline

from besman.exceptions import MappingError
from besman.robot.model import load_robot
from besman.stages.map import limit_program
from besman.stages.map.joint_spline import DEGREE, fit_spline
from besman.stages.map.limit_program import ChangeMetric, solve_change

LIMITS = load_robot("compi", "none").limits
N = len(LIMITS.velocity)


def draw(seed, n_samples=46):
    """A path that breaks every kind of limit, and a metric of its change."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0, n_samples / 100, n_samples)
    waves = np.sin(rng.uniform(5, 12, N) * time[:, None] + rng.uniform(0, 6, N))
    centre = (LIMITS.position_min + LIMITS.position_max) / 2
    reach = (LIMITS.position_max - LIMITS.position_min) / 2
    spline = fit_spline(time, centre + 1.1 * reach * waves, 0.05)
    count = len(spline.points)
    jacobians = rng.normal(size=(n_samples, 6, N))
    errors = rng.normal(size=(n_samples, 6))
    squares = np.einsum("tin,tim->tnm", jacobians, jacobians) + np.eye(N)
    pulls = np.einsum("tin,ti->tn", jacobians, errors)
    bands = np.zeros((DEGREE + 1, count, N, N))
    hessian = np.einsum("tc,td,tnm->cndm", spline.basis, spline.basis, squares)
    for shift in range(DEGREE + 1):
        for row in range(count - shift):
            bands[shift, row] = hessian[row, :, row + shift]
    metric = ChangeMetric(bands, spline.basis.T @ pulls)
    return spline, metric, hessian.reshape(count * N, count * N)


def by_osqp(spline, metric, hessian, stretch):
    """The same program from the definitions, by another solver."""
    count = len(spline.points)
    rows, lows, highs = [], [], []
    every = np.eye(count)
    for order, bound in ((1, LIMITS.velocity * stretch), (2, LIMITS.acceleration * stretch**2)):
        points = BSpline(spline.knots, every, spline.degree).derivative(order).c
        points = points[: count - order]
        now = points @ spline.points
        rows.append(np.kron(points, np.eye(N)))
        lows.append((-bound - now).ravel())
        highs.append((bound - now).ravel())
    rows.append(np.eye(count * N))
    lows.append((LIMITS.position_min - spline.points).ravel())
    highs.append((LIMITS.position_max - spline.points).ravel())
    matrix, low, high = np.vstack(rows), np.concatenate(lows), np.concatenate(highs)
    scale = 1 / np.linalg.norm(matrix, axis=1)
    solver = osqp.OSQP()
    solver.setup(
        sp.csc_matrix(hessian), metric.gradient.ravel(), sp.csc_matrix(scale[:, None] * matrix),
        scale * low, scale * high, eps_abs=1e-9, eps_rel=1e-9, max_iter=200_000, verbose=False,
        polishing=True,
    )  # fmt: skip
    return solver.solve(raise_error=True).x.reshape(count, N)


@pytest.mark.parametrize("stretch", [1.0, 2.5])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_answer_of_another_solver(seed, stretch):
    spline, metric, hessian = draw(seed)
    change = solve_change(spline, metric, LIMITS, stretch)
    expected = by_osqp(spline, metric, hessian, stretch)

    def cost(x):
        x = x.ravel()
        return 0.5 * x @ hessian @ x + metric.gradient.ravel() @ x

    np.testing.assert_allclose(change, expected, atol=1e-4)
    assert cost(change) == pytest.approx(cost(expected), rel=1e-5)
    moved = spline.moved(spline.points + change)
    assert np.all(np.abs(moved.velocity_points()) <= LIMITS.velocity * stretch * (1 + 1e-6))
    pull = LIMITS.acceleration * stretch**2
    assert np.all(np.abs(moved.acceleration_points()) <= pull * (1 + 1e-6))


def test_threads_do_not_change_the_answer():
    spline, metric, _ = draw(3)
    expected = solve_change(spline, metric, LIMITS, 1.5)
    with ThreadPoolExecutor(max_workers=2) as threads:
        for _ in range(4):
            one = threads.submit(solve_change, spline, metric, LIMITS, 1.5)
            assert one.result().tobytes() == expected.tobytes()


def test_a_spline_that_is_too_long(monkeypatch):
    monkeypatch.setattr(limit_program, "GREATEST_POINTS", 8)
    spline, metric, _ = draw(0)
    message = f"got {len(spline.points)} control points, expected at most 8"
    with pytest.raises(MappingError, match=message):
        solve_change(spline, metric, LIMITS, 1.0)


def test_limits_that_exclude_each_other():
    spline, metric, _ = draw(0)
    limits = replace(LIMITS, position_min=LIMITS.position_max + 1.0)
    with pytest.raises(MappingError, match="none is found, a bound is missed by"):
        solve_change(spline, metric, limits, 1.0)
