import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.robot.limits import resample_trajectory
from besman.robot.model import load_robot
from besman.stages.map.joint_spline import fit_spline


@given(seed=st.integers(0, 10_000), n_samples=st.integers(3, 120), start=st.floats(-1.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_hull_and_derivatives(seed, n_samples, start):
    rng = np.random.default_rng(seed)
    time = start + np.linspace(0, n_samples / 100, n_samples)
    spline = fit_spline(time, rng.normal(size=(n_samples, 3)), 0.05)
    fine = spline.times(4000.0)
    assert fine[0] == time[0]
    assert fine[-1] == time[-1]
    hulls = spline.points, spline.velocity_points(), spline.acceleration_points()
    for hull, values, samples in zip(hulls, spline.at(fine), spline.samples(), strict=True):
        slack = 1e-9 * (np.abs(hull).max() + 1.0)
        assert np.all(values <= hull.max(axis=0) + slack)
        assert np.all(values >= hull.min(axis=0) - slack)
        np.testing.assert_allclose(samples[[0, -1]], values[[0, -1]], atol=slack)
    # The samples alone define the same movement.
    between, *dense = resample_trajectory(time, *spline.samples(), 4000.0)
    for values, wanted in zip(dense, spline.at(between), strict=True):
        np.testing.assert_allclose(values, wanted, atol=1e-6 * (np.abs(wanted).max() + 1.0))


def test_derivatives_are_those_of_the_positions():
    time = np.linspace(0, 1, 101)
    path = np.outer(np.sin(3 * time), np.linspace(0.5, 1, 6))
    positions, velocities, _ = fit_spline(time, path, 0.05).samples()
    np.testing.assert_allclose(positions, path, atol=1e-6)
    expected = np.outer(3 * np.cos(3 * time), np.linspace(0.5, 1, 6))
    np.testing.assert_allclose(velocities, expected, atol=1e-4)
    spline, step = fit_spline(time, path, 0.05), 1 / 4000
    fine, fine_velocities, fine_accelerations = spline.at(spline.times(4000.0))
    np.testing.assert_allclose(
        np.gradient(fine, step, axis=0)[1:-1], fine_velocities[1:-1], atol=1e-4
    )
    got = np.gradient(fine_velocities, step, axis=0)[1:-1]
    np.testing.assert_allclose(got, fine_accelerations[1:-1], atol=1e-2)


def test_a_polynomial_of_degree_five_is_met():
    time = np.linspace(0, 0.6, 61)
    polynomial = np.polynomial.Polynomial([0.1, 1, -2, 3, 1, -1])
    spline = fit_spline(time, polynomial(time)[:, None], 0.05)
    for order, values in enumerate(spline.samples()):
        wanted = polynomial.deriv(order)(time) if order else polynomial(time)
        np.testing.assert_allclose(values[:, 0], wanted, atol=1e-7)


@pytest.mark.parametrize("beyond", [0.0, 0.01])
def test_inside(beyond):
    limits = load_robot("ur5", "none").limits
    edge = np.tile(limits.position_max + beyond, (20, 1))
    spline = fit_spline(np.linspace(0, 1, 20), edge, 0.05)
    spline = spline.moved(np.round(spline.points, 9) - 1e-9)
    assert spline.inside(limits) == (beyond == 0.0)
