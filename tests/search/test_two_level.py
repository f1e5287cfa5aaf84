"""A two-level design against what it is to tell."""

import numpy as np
import pytest

from besman.search.two_level import fit_slopes, two_level_design

RNG = np.random.default_rng(5)


@pytest.mark.parametrize("n", [1, 3, 7, 8, 31])
def test_every_coordinate_changes_as_often_up_as_down_and_by_itself(n):
    signs = two_level_design(n)
    assert len(signs) == max(4, 1 << n.bit_length())
    np.testing.assert_array_equal(signs.sum(axis=0), 0.0)
    np.testing.assert_array_equal(signs.T @ signs, len(signs) * np.eye(n))


def test_slopes_of_a_line_are_told_also_where_a_try_failed():
    slopes, ways = RNG.normal(size=(2, 5)), 0.5 * two_level_design(5)
    values = ways @ slopes.T + 3.0
    np.testing.assert_allclose(fit_slopes(ways, values, 1e-12), slopes, atol=1e-9)
    values[2] = np.nan
    np.testing.assert_allclose(fit_slopes(ways, values, 1e-12), slopes, atol=1e-9)
    np.testing.assert_array_equal(fit_slopes(ways, np.full((8, 1), np.nan)), 0.0)


def test_roughness_blurs_slopes_less_than_single_differences_would():
    ways = 0.8 * two_level_design(7)
    found = [fit_slopes(ways, RNG.normal(size=(8, 1))) for _ in range(400)]
    # Of eight tries at once; a difference of two tries 0.8 apart has 1.77.
    assert np.std(found) == pytest.approx(1.0 / (0.8 * np.sqrt(8)), rel=0.05)
