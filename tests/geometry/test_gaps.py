import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from besman.geometry.gaps import fill_gaps, find_runs


@given(st.lists(st.booleans(), max_size=40))
def test_runs_against_counting(mask):
    expected, start = [], None
    for index, value in enumerate([*mask, False]):
        if value and start is None:
            start = index
        if not value and start is not None:
            expected.append([start, index])
            start = None
    assert find_runs(np.array(mask, dtype=bool)).tolist() == expected


def path_of_a_hand(n: int = 100) -> np.ndarray:
    time = np.arange(n) / 100
    return np.column_stack([np.sin(5 * time), np.cos(3 * time), time**2])


def test_short_gap_is_filled_smoothly():
    truth = path_of_a_hand()
    positions = truth.copy()
    positions[40:60, 1] = np.nan  # one coordinate missing: the sample counts as unseen
    result, filled = fill_gaps(positions, 20)
    np.testing.assert_array_equal(np.flatnonzero(filled), np.arange(40, 60))
    np.testing.assert_allclose(result, truth, atol=0.2**4 * 5**4 / 384)  # bound of a cubic
    np.testing.assert_array_equal(result[~filled], truth[~filled])


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
def test_the_spline_is_that_through_all_sightings(share):
    rng = np.random.default_rng(4)
    positions = rng.normal(size=(3000, 3), scale=1e-3).cumsum(axis=0)
    unseen = np.flatnonzero(rng.random(3000) < share)
    positions[unseen] = np.nan
    seen = np.flatnonzero(np.isfinite(positions[:, 0]))
    result, filled = fill_gaps(positions, 3000)
    np.testing.assert_array_equal(np.flatnonzero(filled), unseen)
    expected = CubicSpline(seen, positions[seen])(np.clip(unseen, seen[0], seen[-1]))
    np.testing.assert_allclose(result[unseen], expected, rtol=0, atol=1e-15)


def test_too_long_a_gap_stays():
    positions = path_of_a_hand()
    positions[40:61] = np.nan
    positions[70:72] = np.nan
    result, filled = fill_gaps(positions, 20)
    np.testing.assert_array_equal(np.isnan(result[:, 0]), np.isnan(positions[:, 0]) & ~filled)
    np.testing.assert_array_equal(np.flatnonzero(filled), [70, 71])


@pytest.mark.parametrize("longest", [4, 5])
def test_ends_hold_the_nearest_sighting(longest):
    positions = path_of_a_hand()
    first, last = positions[5].copy(), positions[94].copy()
    positions[:5] = np.nan
    positions[95:] = np.nan
    result, filled = fill_gaps(positions, longest)
    assert filled.sum() == (10 if longest == 5 else 0)
    if longest == 5:
        np.testing.assert_allclose(result[:5], np.tile(first, (5, 1)))
        np.testing.assert_allclose(result[95:], np.tile(last, (5, 1)))


@pytest.mark.parametrize("n_seen", [1, 2, 3])
def test_few_sightings(n_seen):
    positions = np.full((6, 3), np.nan)
    positions[1 : 1 + n_seen] = np.arange(n_seen)[:, np.newaxis]
    result, filled = fill_gaps(positions, 6)
    assert np.isfinite(result).all()
    assert filled.sum() == 6 - n_seen


def test_never_seen_and_always_seen():
    result, filled = fill_gaps(np.full((4, 3), np.nan), 10)
    assert np.isnan(result).all()
    assert not filled.any()
    positions = path_of_a_hand()
    result, filled = fill_gaps(positions, 10)
    np.testing.assert_array_equal(result, positions)
    assert not filled.any()


def test_no_gap_is_filled_at_limit_zero():
    positions = path_of_a_hand()
    positions[3] = np.nan
    assert not fill_gaps(positions, 0)[1].any()
