from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.stages.segment.straightness import _POWER, speed_ahead
from besman.stages.segment.valley_vmci import find_movements
from besman.stages.segment.valleys import ValleyShape, find_valleys, path_speed, smooth_path

HALF = 20  # samples of half a window at 100 Hz


def share(path):
    return speed_ahead(path, np.ones(len(path)), 100.0)


def test_a_straight_path_gets_on_with_its_speed():
    place = np.cumsum(np.random.default_rng(0).uniform(0.1, 1.0, 80))
    path = place[:, None] * np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(share(path), 1.0, atol=1e-12)
    np.testing.assert_array_equal(share(np.zeros((30, 3))), 1.0)


@pytest.mark.parametrize("turn_deg", [40.0, 90.0, 150.0])
def test_a_corner_and_a_circle(turn_deg):
    a = np.radians(turn_deg)
    before = -np.arange(60, 0, -1)[:, None] * np.array([1.0, 0.0, 0.0])
    after = np.arange(61)[:, None] * np.array([np.cos(a), np.sin(a), 0.0])
    corner = share(np.concatenate([before, after]))
    assert corner.argmin() == 60
    assert corner[60] == pytest.approx(np.cos(a / 2) ** _POWER)
    angle = a * np.arange(200) / (2 * HALF)
    circle = share(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))[HALF:-HALF]
    chord = 2 * np.sin(a / 2) / (2 * HALF * 2 * np.sin(a / 4 / HALF))
    np.testing.assert_allclose(circle, chord**_POWER, atol=1e-12)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.integers(2, 70))
def test_of_any_path_window_by_window(seed, n):
    path = np.cumsum(np.random.default_rng(seed).normal(size=(n, 6)), axis=0)
    expected = []
    for at in range(n):
        piece = path[max(at - min(HALF, n - 1), 0) : at + min(HALF, n - 1) + 1]
        gone = sum(np.linalg.norm(b - a) for a, b in pairwise(piece))
        expected.append((np.linalg.norm(piece[-1] - piece[0]) / gone) ** _POWER)
    np.testing.assert_allclose(share(path), expected, atol=1e-9)


def blend(turn_deg, overlap_s=0.35):
    """Two minimum-jerk reaches of one second; the second begins before the first has ended."""
    time = np.arange(0.0, 2.0 - overlap_s + 1e-9, 0.01)
    path = np.zeros((len(time), 3))
    for start, angle in ((0.0, 0.0), (1.0 - overlap_s, np.radians(turn_deg))):
        s = np.clip(time - start, 0.0, 1.0)[:, None]
        path += (
            0.4 * np.array([np.cos(angle), np.sin(angle), 0.0]) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        )
    return time, path[:, None], 1.0 - overlap_s / 2


def test_movements_that_blend_have_a_border_where_they_turn():
    time, paths, border = blend(80.0)
    path = smooth_path(time, paths, 0.05)
    speed = path_speed(path)
    assert find_valleys(speed) == []
    (valley,) = find_valleys(speed, ahead=speed_ahead(path, speed, 100.0))
    assert valley.first == valley.last == pytest.approx(100 * border, abs=8)
    found = find_movements(time, paths, shape=ValleyShape(least=0.02)).borders_s
    assert found[1:-1] == pytest.approx([border], abs=0.08)
    # What goes on the same way is one movement.
    assert len(find_movements(*blend(5.0)[:2]).borders_s) == 2
