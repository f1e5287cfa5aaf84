"""Slopes by evidence against true ones, and against the normal distribution they stand for."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from besman.search import linear_model
from besman.search.linear_model import learn_slopes, most_likely_slopes
from besman.search.residual_points import Tried

RNG = np.random.default_rng(3)
SLOPES = RNG.normal(size=(2, 4))


def tried(point, rough=0.0):
    found = SLOPES @ point + 0.7 + rough * RNG.normal(size=2)
    return Tried(point, found[None])


def test_a_smooth_outcome_tells_its_jacobian():
    at, others = tried(np.ones(4)), [tried(np.ones(4) + 0.5 * RNG.normal(size=4)) for _ in range(9)]
    wrong = np.stack([SLOPES + 2.0, SLOPES + 3.0])
    found = learn_slopes(wrong, at, others)
    np.testing.assert_allclose(found[0], SLOPES, atol=0.2)
    # What is known of how far the worlds are apart stays.
    np.testing.assert_allclose(found[1] - found[0], 1.0, atol=1e-12)


def test_a_rough_outcome_leaves_what_was_known():
    at = tried(np.zeros(4), 1.5)
    others = [tried(0.3 * RNG.normal(size=4), 1.5) for _ in range(6)]
    found = learn_slopes(SLOPES[None], at, others)
    off = np.array([one.residuals[0] - at.residuals[0] for one in others])
    secant = np.linalg.lstsq(np.array([one.point for one in others]), off, rcond=None)[0].T
    assert np.abs(found[0] - SLOPES).max() < 0.3
    assert np.abs(secant - SLOPES).max() > 2.0


def test_points_without_an_outcome_tell_nothing():
    lost = Tried(np.ones(4), np.full((1, 2), np.nan))
    at = tried(np.zeros(4))
    np.testing.assert_allclose(learn_slopes(SLOPES[None], at, [lost]), SLOPES[None])
    assert learn_slopes(SLOPES[None], lost, [at])[0] is not None
    np.testing.assert_array_equal(learn_slopes(SLOPES[None], lost, [at]), SLOPES[None])


def test_the_evidence_is_that_of_a_normal_distribution():
    """Differences from the first value have no level: their density is the evidence, but for one
    constant that all pairs share."""
    ways, off = RNG.normal(size=(5, 3)), RNG.normal(size=(5, 1))
    contrast = np.column_stack([-np.ones(4), np.eye(4)])
    gaps = []
    for slope, rough in ((0.2, 0.1), (0.8, 0.4), (3.2, 1.6)):
        noise = rough**2 + (linear_model._BENT * np.square(ways).sum(axis=1)) ** 2
        covariance = slope**2 * ways @ ways.T + np.diag(noise)
        density = multivariate_normal.logpdf(
            contrast @ off[:, 0], cov=contrast @ covariance @ contrast.T
        )
        guess = np.log(slope / linear_model._SLOPE) ** 2 + np.log(rough / linear_model._ROUGH) ** 2
        gaps.append(linear_model._explain(ways, off, slope, rough)[0] + 0.5 * guess - density)
    assert gaps == pytest.approx([gaps[0]] * 3)


def test_two_outcomes_correct_along_the_way_between_them_alone():
    ways = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    found = most_likely_slopes(np.zeros((1, 3)), ways, np.array([[0.0], [2.0]]))
    assert 0 < found[0, 0] < 2.0
    np.testing.assert_allclose(found[0, 1:], 0.0, atol=1e-12)
