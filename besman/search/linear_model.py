"""Slopes of outcomes that contacts roughen, learnt from all that was tried.

A class of motions has one Jacobian, nearly; what single points say of it is blurred, because a
contact that comes a little sooner sends an object another way. So a step does not replace what was
known, as Broyden's update would: the Jacobian that was given is the mean of a prior, every outcome
an observation with noise, and both the slopes and the outcome at a point are their posterior means.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.search.residual_points import Tried

FloatArray = npt.NDArray[np.float64]

# In radii of success: how far slopes are from those of the class (a unit; of how far the worlds are
# apart, less), how rough outcomes are, and how much they bend by the squared distance.
_SLOPE, _SLOPE_APART, _ROUGH, _BENT = 0.4, 0.1, 0.3, 0.1

_SLOPES, _ROUGHS = (0.2, 0.4, 0.8, 1.6, 3.2), (0.1, 0.2, 0.4, 0.8, 1.6)


def learn(
    prior: FloatArray, at: Tried, others: Sequence[Tried]
) -> tuple[FloatArray, FloatArray]:
    """Return the Jacobian and the residuals to be expected at a point.

    Parameters
    ----------
    prior : array, shape (W, R, D)
        The Jacobian as it was given.
    at : Tried
        In all W worlds, or in the first alone: what that one does, all do.
    others : sequence of Tried
        What else was tried; points without an outcome in the worlds of `at` tell nothing.

    Returns
    -------
    jacobian : array, shape (W, R, D)
    residuals : array, shape (1 or W, R)
        In the worlds of `at`; NaN where it had none.
    """
    n = len(at.residuals)
    told = [one for one in (at, *others) if len(one.residuals) >= n]
    ways = np.array([one.point - at.point for one in told])
    found = np.array([one.residuals[:n] for one in told])
    full = np.isfinite(found).all(axis=(1, 2))
    if not full[0]:
        return prior, at.residuals
    ways, found = ways[full], found[full]
    middle, mean = prior[:n].mean(axis=0), found.mean(axis=1)
    slopes, here = most_likely(middle, ways, mean)
    jacobian, expected = prior + (slopes - middle), np.tile(here, (n, 1))
    if n > 1:
        apart = (found - mean[:, None]).reshape(len(found), -1)
        before = (prior - middle).reshape(-1, prior.shape[2])
        after, off = posterior(before, ways, apart, _SLOPE_APART)
        jacobian = jacobian + (after - before).reshape(prior.shape)
        expected = expected + off.reshape(expected.shape)
    return jacobian, expected


def posterior(
    prior: FloatArray, ways: FloatArray, values: FloatArray, slope: float, rough: float = _ROUGH
) -> tuple[FloatArray, FloatArray]:
    """Return slopes (M, D) and values (M,) where the ways begin, by Bayesian linear regression.

    Parameters
    ----------
    prior : array, shape (M, D)
        Means of the slopes.
    ways : array, shape (N, D)
        To the points.
    values : array, shape (N, M)
        There; nothing is supposed of the value where the ways begin.
    slope : float
        Standard deviation of every slope from its mean.
    """
    square = np.square(ways).sum(axis=1)
    noise = rough**2 + np.square(_BENT * square)
    system = slope**2 * ways @ ways.T + np.diag(noise)
    off = values - ways @ prior.T
    weighed = np.linalg.solve(system, np.column_stack([np.ones(len(ways)), off]))
    here = weighed[:, 1:].sum(axis=0) / weighed[:, 0].sum()
    pulls = weighed[:, 1:] - np.outer(weighed[:, 0], here)
    return prior + slope**2 * pulls.T @ ways, here


def most_likely(
    prior: FloatArray, ways: FloatArray, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the posterior under the roughness and the slopes that make the values most likely."""
    if len(ways) < 3:
        return posterior(prior, ways, values, _SLOPE)
    pairs = [(slope, rough) for slope in _SLOPES for rough in _ROUGHS]
    likely = [evidence(prior, ways, values, *pair) for pair in pairs]
    slope, rough = pairs[int(np.argmax(likely))]
    return posterior(prior, ways, values, slope, rough)


def evidence(
    prior: FloatArray, ways: FloatArray, values: FloatArray, slope: float, rough: float
) -> float:
    """Return the logarithm of how likely values are [1]_, whatever the value at the beginning."""
    square = np.square(ways).sum(axis=1)
    noise = rough**2 + np.square(_BENT * square)
    system = slope**2 * ways @ ways.T + np.diag(noise)
    off = values - ways @ prior.T
    ones = np.ones(len(ways))
    weighed = np.linalg.solve(system, np.column_stack([ones, off]))
    total = weighed[:, 0].sum()
    here = weighed[:, 1:].sum(axis=0) / total
    fit = ((off - here) * (weighed[:, 1:] - np.outer(weighed[:, 0], here))).sum()
    m = values.shape[1]
    prior_of = -0.5 * (np.log(slope / _SLOPE) ** 2 + np.log(rough / _ROUGH) ** 2)
    return float(-0.5 * (fit + m * (np.linalg.slogdet(system)[1] + np.log(total))) + prior_of)
