"""Where steps go on from, on made-up outcomes."""

import numpy as np

from besman.search.residual_points import Tried
from besman.search.rough_steps import RoughSteps

SLOPES = np.array([[1.0, 0.5, 0.0, 0.0], [0.0, 1.0, 2.0, 0.0]])


def tried(cost):
    return Tried(np.array([0.3, 0.0, -0.2, 0.0]), np.array([[cost, 0.0]]))


def test_a_step_in_vain_is_followed_by_one_from_beside_and_then_from_afar():
    steps, best, worse = RoughSteps((0,)), tried(1.0), tried(2.0)
    assert steps.begins_anew(best, SLOPES) is None
    assert steps.beside(best, SLOPES, np.asarray) is best
    assert steps.judge(best, worse) is best
    beside = steps.beside(best, SLOPES, np.asarray)
    way = beside.point - best.point
    assert np.linalg.norm(way) > 0.5
    # Nothing changes along it, and what moves no outcome stays.
    np.testing.assert_allclose(SLOPES @ way, 0.0, atol=1e-12)
    np.testing.assert_allclose(beside.residuals, best.residuals, atol=1e-12)
    assert way[3] == 0.0
    assert steps.judge(best, worse) is best
    afar = steps.begins_anew(best, SLOPES)
    np.testing.assert_allclose(SLOPES @ (afar - best.point), 0.0, atol=1e-12)
    # Whatever comes of that, steps go on from there; unless nothing does.
    assert steps.judge(best, worse) is worse
    assert steps.begins_anew(best, SLOPES) is None


def test_a_place_without_an_outcome_is_left():
    steps, best, nothing = RoughSteps((0,)), tried(1.0), tried(np.nan)
    steps.judge(best, nothing)
    steps.judge(best, nothing)
    assert steps.begins_anew(best, SLOPES) is not None
    assert steps.judge(best, nothing) is best


def test_a_gain_forgets_what_was_in_vain():
    steps, best = RoughSteps((0,)), tried(1.0)
    steps.judge(best, tried(2.0))
    better = tried(0.5)
    assert steps.judge(best, better) is better
    assert steps.beside(better, SLOPES, np.asarray) is better


def test_beside_is_within_bounds_and_says_what_that_changes():
    steps, best = RoughSteps((0,)), tried(1.0)
    steps.judge(best, tried(2.0))
    found = steps.beside(best, SLOPES, lambda point: np.clip(point, -0.25, 0.35))
    moved = best.residuals[0] + SLOPES @ (found.point - best.point)
    np.testing.assert_allclose(found.residuals[0], moved)
    assert not np.allclose(found.residuals, best.residuals)
