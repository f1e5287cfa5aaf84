"""Corrections of a Jacobian against the outcome's true slopes."""

import numpy as np
import pytest

from besman.search.residual_points import Tried, correct_by_step, foresee, important_directions, rms

RNG = np.random.default_rng(3)
SLOPES = RNG.normal(size=(2, 4))


def tried(point, shift=0.0):
    return Tried(point, (SLOPES @ point + shift)[None])


def test_a_correction_is_along_the_step_alone_and_makes_it_exact():
    before, after = tried(np.zeros(4)), tried(np.array([0.5, 0.0, 0.0, 0.0]))
    given = np.zeros((3, 2, 4))
    found = correct_by_step(given, before, after, 0.2)
    np.testing.assert_allclose(found[..., 0], np.tile(SLOPES[:, 0], (3, 1)), atol=1e-12)
    np.testing.assert_array_equal(found[..., 1:], 0.0)
    assert correct_by_step(given, after, after, 0.2) is given


def test_what_is_foreseen_of_linear_worlds_is_what_they_do():
    slopes, agreed, point = RNG.normal(size=(3, 2, 4)), RNG.normal(size=4), RNG.normal(size=4)
    found = slopes @ (point - agreed) + np.array([0.3, -0.4])
    seen = foresee(Tried(point, found[:1]), slopes, agreed)
    np.testing.assert_allclose(seen.residuals, found, atol=1e-12)
    alone = Tried(point, found[:1])
    np.testing.assert_array_equal(foresee(alone, slopes[:1], agreed).residuals, alone.residuals)


def test_of_how_the_worlds_move_apart_a_share_is_believed():
    before = Tried(np.zeros(4), np.zeros((2, 2)))
    after = Tried(np.array([1.0, 0, 0, 0]), np.array([[1.0, 0.0], [3.0, 0.0]]))
    found = correct_by_step(np.zeros((2, 2, 4)), before, after, 0.25)
    np.testing.assert_allclose(found[:, 0, 0], [2.0 - 0.25, 2.0 + 0.25])


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
