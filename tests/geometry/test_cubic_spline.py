"""The own cubic spline beside SciPy's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from besman.geometry import cubic_spline
from besman.geometry.cubic_spline import interpolate_cubic


@settings(deadline=None, max_examples=200)
@given(st.integers(2, 60), st.integers(0, 10_000), st.sampled_from([1.0, 30.0, 1e3]))
def test_values_are_those_of_scipy(n, seed, widest):
    rng = np.random.default_rng(seed)
    # Wide steps beside narrow ones need rows exchanged.
    x = np.cumsum(np.where(rng.random(n) < 0.3, widest, 1.0) * rng.uniform(0.5, 1.5, n))
    y = rng.normal(size=(n, 3)).cumsum(axis=0) + 5.0
    at = np.concatenate([x, rng.uniform(x[0] - 1.0, x[-1] + 1.0, 50)])
    expected = CubicSpline(x, y)(at)
    found = interpolate_cubic(x, y, at)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("rate_hz", [60.0, 100.0])
def test_places_of_a_recording_are_those_of_scipy_to_the_last_bit_or_two(rate_hz):
    path = np.random.default_rng(1).normal(size=(900, 3), scale=1e-3).cumsum(axis=0)
    time, at = np.arange(900) / rate_hz, np.arange(899 * 5) / (5 * rate_hz)
    expected = CubicSpline(time, path)(at)
    np.testing.assert_allclose(interpolate_cubic(time, path, at), expected, rtol=0, atol=1e-16)


def test_of_many_points_scipy_is_taken(monkeypatch):
    x = np.arange(40.0)
    y = np.random.default_rng(2).normal(size=(40, 2))
    own = interpolate_cubic(x, y, x + 0.3)
    monkeypatch.setattr(cubic_spline, "_MANY", 39)
    taken = interpolate_cubic(x, y, x + 0.3)
    np.testing.assert_array_equal(taken, CubicSpline(x, y)(x + 0.3))
    np.testing.assert_allclose(own, taken, rtol=0, atol=1e-12)
