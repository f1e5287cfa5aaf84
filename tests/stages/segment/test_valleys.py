import numpy as np
import plain_valleys
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.ndimage import gaussian_filter1d

from besman.stages.segment.valleys import (
    GRID_HZ,
    ValleyShape,
    _low_pass,
    find_valleys,
    smooth_speed,
    typical_speed,
)


def bells(durations_s, gaps_s, heights=None):
    """Minimum-jerk speeds with rests between them, on the grid; also where the rests lie."""
    pieces, rests, at = [], [], 0
    for index, (duration, gap) in enumerate(zip(durations_s, [*gaps_s, 0.0], strict=True)):
        n = round(duration * GRID_HZ)
        s = (np.arange(n) + 0.5) / n
        pieces.append((heights[index] if heights else 1.0) * 16 * s**2 * (1 - s) ** 2)
        at += n
        pieces.append(np.zeros(round(gap * GRID_HZ)))
        rests.append((at, at + round(gap * GRID_HZ)))
        at += round(gap * GRID_HZ)
    return np.concatenate(pieces), rests[:-1]


def test_a_turning_point_is_one_place_and_a_rest_two():
    speed, rests = bells([1.0, 1.0, 1.5], [0.0, 1.0])
    turn, rest = find_valleys(speed)
    assert turn.first == turn.last == pytest.approx(rests[0][0], abs=1)
    # A rest begins where 8 % of the peak is passed, a few hundredths of a second inside the bell.
    assert 0 <= rests[1][0] - rest.first <= 10
    assert 0 <= rest.last - rests[1][1] <= 15


def test_slow_ends_of_long_movements_are_no_rest():
    speed, _ = bells([6.0, 6.0], [0.0])
    (valley,) = find_valleys(speed)
    assert valley.first == valley.last


def test_low_hills_and_shallow_valleys_are_left_out():
    speed, _ = bells([1.0, 0.3, 1.0], [0.3, 0.3], heights=[1.0, 0.1, 1.0])
    (rest,) = find_valleys(speed)
    assert rest.first < 120 < rest.last
    s = np.arange(200) / 199
    humps = np.sin(np.pi * s) * (1 - 0.35 * np.exp(-(((s - 0.5) / 0.1) ** 2)))
    assert find_valleys(humps) == []
    assert len(find_valleys(humps, ValleyShape(depth=0.95))) == 1


@given(arrays(float, st.integers(2, 200), elements=st.floats(0, 1)), st.floats(1e-3, 1e3))
def test_valleys_are_in_order_and_know_no_unit(speed, unit):
    # Values that differ by more than rounding, whatever the unit.
    speed = np.round(speed, 3)
    valleys = find_valleys(speed)
    places = np.array(valleys).reshape(-1)
    assert np.all(np.diff(places) >= 0)
    assert np.all((places >= 0) & (places <= len(speed)))
    power = 2.0 ** np.round(np.log2(unit))
    assert find_valleys(power * speed) == valleys


@given(
    arrays(float, st.integers(2, 60), elements=st.floats(0, 1)),
    st.sampled_from([0, 1, 3]),
    st.sampled_from([0.0, 0.2, 0.6]),
    st.sampled_from([0.2, 0.5, 0.9]),
)
def test_valleys_go_in_the_order_of_a_plain_search(speed, digits, hill, depth):
    # Rounded, so that hills and minima are alike.
    speed = np.round(speed, digits)
    shape = ValleyShape(hill=hill, depth=depth)
    with np.errstate(invalid="ignore", divide="ignore"):
        plain = plain_valleys.find_valleys(speed, shape)
    assert find_valleys(speed, shape) == plain


def test_rests_at_the_ends_are_found():
    speed, _ = bells([1.0, 1.0], [0.0])
    still = np.zeros(100)
    first, turn, last = find_valleys(np.concatenate([still, speed, still]))
    assert first.first == 0
    assert 100 <= first.last <= 110
    assert turn.first == turn.last
    assert 290 <= last.first <= 300
    assert last.last == 400


def test_a_speed_that_does_not_change_has_no_valleys():
    assert find_valleys(np.zeros(50)) == []
    assert find_valleys(np.ones(50)) == []
    assert find_valleys(np.array([0.0, 1.0])) == []


def test_typical_speed_does_not_know_rests():
    speed, _ = bells([1.0, 1.0], [0.0])
    with_rest, _ = bells([1.0, 1.0], [5.0])
    assert typical_speed(speed) == typical_speed(with_rest)


@pytest.mark.parametrize("rate_hz", [20.0, 60.0, 100.0, 250.0, 500.0])
def test_speed_is_the_same_at_every_rate(rate_hz):
    time = np.arange(round(4 * rate_hz)) / rate_hz
    paths = np.stack([np.sin(3 * time), np.cos(2 * time), time], axis=1)[:, np.newaxis]
    speed = smooth_speed(time, paths, 0.05)
    at = np.arange(len(speed)) / GRID_HZ
    true = np.sqrt((3 * np.cos(3 * at)) ** 2 + (2 * np.sin(2 * at)) ** 2 + 1)
    inner = slice(30, -30)
    np.testing.assert_allclose(speed[inner], true[inner], rtol=0.02)


@pytest.mark.parametrize(("n", "deviation"), [(1, 5.0), (30, 5.0), (500, 5.0), (500, 2.3)])
def test_low_pass_beside_scipy(n, deviation):
    path = np.random.default_rng(n).normal(size=(n, 3)).cumsum(axis=0)
    expected = gaussian_filter1d(path, deviation, axis=0, mode="nearest", truncate=4.0)
    np.testing.assert_allclose(_low_pass(path, deviation), expected, rtol=0, atol=1e-13)
