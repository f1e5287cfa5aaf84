import numpy as np
from scipy.interpolate import PchipInterpolator

from besman.person.release import find_release, hand_energy

RATE = 100.0
TIME = np.arange(0, 3, 1 / RATE)


def speeds_of(heights, ahead=0.0):
    return np.hypot(np.gradient(heights, 1 / RATE), ahead)


def test_a_hand_that_pushes_down_faster_than_it_throws_throws_where_it_is_high():
    """It bounces a ball at 3 m/s at 1 m, throws at 2 m/s at 2 m, and sinks faster."""
    down = PchipInterpolator([2.0, 2.3, 2.7, 2.9], [2.0, 1.8, 0.8, 0.7])
    heights = np.interp(TIME, [0, 0.5, 0.7, 0.9, 1.2, 1.7, 2.0], [1, 1, 0.4, 1, 1, 2, 2])
    heights = np.where(TIME < 2.0, heights, down(np.minimum(TIME, 2.9)))
    speeds = speeds_of(heights)
    row = find_release(hand_energy(heights, speeds))
    assert speeds[(TIME < 1)].max() > speeds[(TIME > 1.2) & (TIME < 1.7)].max()
    assert speeds[TIME > 2].max() > 2.5
    assert 1.6 < TIME[row] < 1.72


def test_a_fast_flat_throw_is_told_by_its_speed():
    heights = np.where(TIME < 2, 1.0, 1.9)
    ahead = 6.0 * np.exp(-(((TIME - 1.0) / 0.1) ** 2))
    row = find_release(hand_energy(heights, np.abs(ahead)))
    # The first moment within 2 % of the greatest energy.
    greatest = 9.81 + 18.0
    expected = TIME[9.81 + ahead**2 / 2 >= 0.98 * greatest][0]
    assert TIME[row] == expected
    assert abs(expected - 1.0) < 0.05


def test_what_is_not_seen_does_not_count():
    energy = np.array([1.0, np.nan, 5.0, 4.95, np.nan])
    assert find_release(energy) == 2
    assert find_release(np.full(4, np.nan)) is None
