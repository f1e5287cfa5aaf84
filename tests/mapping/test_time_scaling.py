import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.mapping.time_scaling import scale_path, smooth_path
from besman.robot.limits import resample
from besman.robot.model import load_robot

LIMITS = load_robot("ur5", "none").limits


@given(
    seed=st.integers(0, 10_000),
    n_samples=st.integers(3, 80),
    duration=st.floats(0.05, 3.0),
    size=st.floats(0.0, 3.0),
    roughness=st.floats(0.0, 0.3),
)
@settings(max_examples=80, deadline=None)
def test_limits_hold_at_1_khz_whatever_comes_in(seed, n_samples, duration, size, roughness):
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, n_samples)[:, None]
    path = size * np.sin(rng.uniform(0, 6, 6) * u + rng.uniform(0, 6, 6))
    path += rng.normal(0, roughness, path.shape)
    scaled = scale_path(np.linspace(0, duration, n_samples), path, LIMITS)
    time, _, velocities, accelerations = resample(
        scaled.time, scaled.positions, scaled.velocities, scaled.accelerations
    )
    assert np.all(np.abs(velocities) <= LIMITS.velocity)
    assert np.all(np.abs(accelerations) <= LIMITS.acceleration)
    assert scaled.stretch >= 1.0
    assert time[-1] == pytest.approx(duration * scaled.stretch)


def test_a_slow_movement_is_not_stretched():
    time = np.linspace(0, 2, 50)
    scaled = scale_path(time, np.outer(0.1 * np.sin(time), np.ones(6)), LIMITS)
    assert scaled.stretch == 1.0
    stretched = scale_path(
        time, np.outer(0.1 * np.sin(time), np.ones(6)), LIMITS, least_duration_s=3.0
    )
    assert stretched.stretch == pytest.approx(1.5)
    np.testing.assert_allclose(stretched.velocities * 1.5, scaled.velocities)


def test_derivatives_are_those_of_the_positions():
    time = np.linspace(0, 1, 101)
    path = np.outer(np.sin(3 * time), np.linspace(0.5, 1, 6))
    positions, velocities, accelerations = smooth_path(time, path, 0.05)
    np.testing.assert_allclose(positions, path, atol=1e-6)
    expected = np.outer(3 * np.cos(3 * time), np.linspace(0.5, 1, 6))
    np.testing.assert_allclose(velocities, expected, atol=1e-4)
    _, fine, fine_velocities, fine_accelerations = resample(
        time, positions, velocities, accelerations, 4000
    )
    step = 1 / 4000
    np.testing.assert_allclose(
        np.gradient(fine, step, axis=0)[1:-1], fine_velocities[1:-1], atol=1e-4
    )
    got = np.gradient(fine_velocities, step, axis=0)[1:-1]
    np.testing.assert_allclose(got, fine_accelerations[1:-1], atol=1e-2)
