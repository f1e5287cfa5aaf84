import numpy as np
import pytest
from scipy.interpolate import BPoly

from besman.robot.dynamics import inverse_dynamics
from besman.robot.limits import check_limits, resample_trajectory, time_stretch
from besman.robot.model import load_robot

ROBOT = load_robot("ur5", "none")


def movement(n_samples=21, duration=0.5):
    """A polynomial of degree five per joint and its derivatives."""
    time = np.linspace(0, duration, n_samples)
    powers = np.random.default_rng(0).normal(0, 0.5, (6, 6))
    polynomials = [np.polynomial.Polynomial(p) for p in powers]
    return time, *(
        np.stack([p.deriv(order)(time) if order else p(time) for p in polynomials], axis=1)
        for order in range(3)
    )


def test_resampling_is_exact_for_quintic_movements():
    time, *coarse = movement()
    fine_time, *fine = resample_trajectory(time, *coarse, rate_hz=1000)
    assert fine_time[-1] == time[-1]
    assert len(fine_time) == 501
    _, *expected = movement(501)
    for got, wanted in zip(fine, expected, strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-9)


@pytest.mark.parametrize("n_samples", [2, 3, 40])
def test_resampling_agrees_with_scipy(n_samples):
    rng = np.random.default_rng(n_samples)
    time = np.cumsum(rng.uniform(0.003, 0.1, n_samples))
    coarse = [rng.normal(size=(n_samples, 6)) for _ in range(3)]
    pieces = BPoly.from_derivatives(time, np.stack(coarse, axis=1))
    fine_time, *fine = resample_trajectory(time, *coarse)
    for order, got in enumerate(fine):
        wanted = pieces.derivative(order)(fine_time) if order else pieces(fine_time)
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def test_resampling_reaches_the_end_of_an_odd_duration():
    time, *coarse = movement(duration=0.50037)
    fine_time, *_ = resample_trajectory(time, *coarse)
    assert fine_time[-1] == time[-1]
    assert np.all(np.diff(fine_time) > 0)


def test_counts_of_violations():
    positions = np.tile(ROBOT.home, (10, 1))
    still = np.zeros((10, 6))
    report = check_limits(ROBOT, positions, still, still)
    assert report.violations == 0
    assert report.self_collisions == 0
    fast, pulled, away = still.copy(), still.copy(), positions.copy()
    fast[2:5, 1] = -4.0
    pulled[1, 0] = 26.0
    away[7, 2] = np.pi + 0.1
    report = check_limits(ROBOT, away, fast, pulled)
    assert (report.position, report.velocity, report.acceleration) == (1, 3, 1)
    assert report.violations == 5
    assert report.position_excess == pytest.approx(0.1)
    assert report.velocity_ratio == pytest.approx(4 / np.pi)
    assert report.acceleration_ratio == pytest.approx(26 / 25)
    assert report.self_collisions == 1  # a folded elbow


def test_at_the_limit_is_within_it():
    speed = np.tile(ROBOT.limits.velocity, (3, 1))
    report = check_limits(ROBOT, np.tile(ROBOT.home, (3, 1)), speed, np.zeros((3, 6)))
    assert report.velocity == 0


def test_nan_is_a_violation():
    broken = np.full((2, 6), np.nan)
    report = check_limits(ROBOT, broken, broken, broken)
    assert (report.position, report.velocity, report.acceleration) == (2, 2, 2)
    assert report.torque == 2
    assert report.self_collisions == 2


def test_time_stretch_brings_a_movement_to_its_limit():
    _, _, velocities, accelerations = movement()
    velocities, accelerations = 5 * velocities, 5 * accelerations
    stretch = time_stretch(ROBOT.limits, velocities, accelerations)
    slow = velocities / stretch, accelerations / stretch**2
    assert time_stretch(ROBOT.limits, *slow) == pytest.approx(1.0)


def test_torques_beyond_the_limit_are_counted():
    positions = np.tile(ROBOT.home, (4, 1))
    still, pulled = np.zeros((4, 6)), np.zeros((4, 6))
    at_rest = check_limits(ROBOT, positions, still, still)
    assert 0 < at_rest.torque_ratio < 1
    assert at_rest.torque == 0
    pulled[2, 1] = 500.0
    report = check_limits(ROBOT, positions, still, pulled)
    torques = inverse_dynamics(ROBOT, positions, still, pulled)
    assert report.torque_ratio == pytest.approx(np.max(np.abs(torques) / ROBOT.limits.torque))
    assert report.torque == 1
    assert report.violations == report.torque + report.acceleration == 2
