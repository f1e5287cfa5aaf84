"""Corrections of a Jacobian against the outcome's true slopes."""

import numpy as np
import pytest

from besman.search.residual_points import Tried, correct_by_all, important_directions, rms

RNG = np.random.default_rng(3)
SLOPES = RNG.normal(size=(2, 4))


def tried(point, shift=0.0):
    return Tried(point, (SLOPES @ point + shift)[None])


def test_enough_points_tell_the_jacobian_of_a_linear_outcome():
    at, others = tried(np.ones(4)), [tried(np.ones(4) + RNG.normal(size=4)) for _ in range(8)]
    wrong = np.stack([SLOPES + 1.0, SLOPES + 3.0])
    found = correct_by_all(wrong, at, [*others, at], 9.0, 1e-9)
    np.testing.assert_allclose(found[0], SLOPES, atol=1e-6)
    # What is known of how far the worlds are apart stays.
    np.testing.assert_allclose(found[1] - found[0], 2.0, atol=1e-9)


def test_a_correction_is_along_the_ways_to_the_points_alone():
    at, one = tried(np.zeros(4)), tried(np.array([0.5, 0.0, 0.0, 0.0]))
    found = correct_by_all(np.zeros((1, 2, 4)), at, [one], 9.0, 1e-9)
    np.testing.assert_allclose(found[0, :, 0], SLOPES[:, 0], atol=1e-6)
    np.testing.assert_array_equal(found[0, :, 1:], 0.0)
    half = correct_by_all(np.zeros((1, 2, 4)), at, [one], 9.0, 1.0)
    np.testing.assert_allclose(half, 0.5 * found, atol=1e-6)


def test_what_is_far_off_or_gave_nothing_tells_nothing():
    jacobian, at = np.zeros((1, 2, 4)), tried(np.zeros(4))
    far, lost = tried(np.full(4, 5.0)), Tried(np.ones(4), np.full((1, 2), np.nan))
    assert correct_by_all(jacobian, at, [far, lost, at], 4.0, 0.3) is jacobian


def test_important_directions_begin_with_the_rows_and_go_on_with_coordinates():
    rows = np.array([[3.0, 0.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0]])
    found = important_directions(rows, 6)
    assert found.shape == (3, 4)
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.abs(found[0]), [1.0, 0.0, 0.0, 0.0], atol=1e-12)
    # Nothing moves along the last coordinate.
    np.testing.assert_allclose(found[:, 3], 0.0, atol=1e-12)
    assert len(important_directions(rows, 1)) == 1


@pytest.mark.parametrize(
    ("residuals", "apart", "within"),
    [
        ([[0.5, 0.0], [-0.5, 0.0]], True, True),
        ([[0.8, 0.0], [0.9, 0.1]], False, True),
        ([[1.2, 0.0], [1.1, 0.1]], False, False),
        ([[0.1, 0.0], [np.nan, np.nan]], True, False),
    ],
)
def test_worlds_are_apart_or_off_alike(residuals, apart, within):
    one = Tried(np.zeros(1), np.array(residuals))
    assert (one.apart, one.within) == (apart, within)
    assert one.first == pytest.approx(np.linalg.norm(residuals[0]))
    assert one.cost == rms(np.array(residuals))
