import numpy as np
import pytest

from besman.motion.rest_at_ends import rest_at_both_ends


def test_leads_go_on_with_the_velocity_and_end_at_rest():
    time = np.linspace(0, 0.5, 51)
    positions = np.column_stack([2 * time, -(time**2)])
    velocities = np.column_stack([np.full(51, 2.0), -2 * time])
    got_time, got = rest_at_both_ends(time, positions, velocities, 0.1, 0.2)
    assert got_time[0] == pytest.approx(0)
    assert got_time[-1] == pytest.approx(0.8)
    assert (np.diff(got_time) > 0).all()
    inside = slice(10, 61)
    np.testing.assert_allclose(got_time[inside], 0.1 + time)
    np.testing.assert_allclose(got[inside], positions)
    slopes = np.diff(got, axis=0) / np.diff(got_time)[:, None]
    np.testing.assert_allclose(slopes[[0, -1]], 0, atol=0.03)
    np.testing.assert_allclose(slopes[10], [2, 0], atol=0.02)
    np.testing.assert_allclose(slopes[60], [2, -1], atol=0.02)
    np.testing.assert_allclose(positions[0] - got[0], velocities[0] * 0.05)
    np.testing.assert_allclose(got[-1] - positions[-1], velocities[-1] * 0.1)


def test_no_leads_change_nothing():
    time, positions = np.array([0.0, 1.0]), np.array([[0.0], [1.0]])
    got_time, got = rest_at_both_ends(time, positions, np.ones((2, 1)), 0.0, 0.0)
    np.testing.assert_array_equal(got_time, time)
    np.testing.assert_array_equal(got, positions)
