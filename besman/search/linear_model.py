"""Slopes of an outcome that contacts roughen, learnt from all that was tried.

A class of motions has one Jacobian, nearly; what single points say of it is blurred, because a
contact that comes a little sooner sends an object another way. So a step does not replace what was
known, as Broyden's update would: the Jacobian that was given is the mean of a prior, every outcome
an observation with noise. How rough outcomes are, and how far slopes are from the given ones, is
what makes all of them most likely (Bayesian linear regression with its evidence) [1]_.

References
----------
.. [1] D. J. C. MacKay: Bayesian interpolation. Neural Computation 4(3), 1992, equations 2.6 and
   4.3, DOI 10.1162/neco.1992.4.3.415.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.search.residual_points import Tried

FloatArray = npt.NDArray[np.float64]

# In radii of success: how far slopes may be from the given ones (a unit), how rough outcomes may
# be, the first guess of each, and how much outcomes bend by the squared distance.
_SLOPES, _ROUGHS = (0.2, 0.4, 0.8, 1.6, 3.2), (0.1, 0.2, 0.4, 0.8, 1.6)
_SLOPE, _ROUGH, _BENT = 0.4, 0.3, 0.1
# From so many outcomes on they tell how rough they are.
_TELLING = 3


def learn_slopes(given: FloatArray, at: Tried, others: Sequence[Tried]) -> FloatArray:
    """Return the Jacobian at a point, by what happened in the first world: what it does, all do.

    Parameters
    ----------
    given : array, shape (W, R, D)
        What is known beforehand.
    at : Tried
    others : sequence of Tried
        What else was tried; points without an outcome there tell nothing.

    Returns
    -------
    array, shape (W, R, D)
    """
    known = [one for one in (at, *others) if np.isfinite(one.residuals[0]).all()]
    if not known or known[0] is not at:
        return given
    ways = np.array([one.point - at.point for one in known])
    values = np.array([one.residuals[0] for one in known])
    return np.asarray(given + (most_likely_slopes(given[0], ways, values) - given[0]))


def most_likely_slopes(given: FloatArray, ways: FloatArray, values: FloatArray) -> FloatArray:
    """Return slopes (R, D) that outcomes speak for, given some (R, D) beforehand.

    Parameters
    ----------
    given : array, shape (R, D)
    ways : array, shape (N, D)
        From where they are to hold to the points.
    values : array, shape (N, R)
        Residuals there; nothing is supposed of those where the ways begin.
    """
    off = values - ways @ given.T
    pairs = [(slope, rough) for slope in _SLOPES for rough in _ROUGHS]
    if len(ways) < _TELLING:
        pairs = [(_SLOPE, _ROUGH)]
    likely = max((_explain(ways, off, *pair) for pair in pairs), key=lambda one: one[0])
    return given + likely[1]


def _explain(
    ways: FloatArray, off: FloatArray, slope: float, rough: float
) -> tuple[float, FloatArray]:
    """Return how likely deviations (N, R) are, its logarithm, and the slopes' change (R, D)."""
    noise = rough**2 + np.square(_BENT * np.square(ways).sum(axis=1))
    system = slope**2 * ways @ ways.T + np.diag(noise)
    weighed = np.linalg.solve(system, np.column_stack([np.ones(len(ways)), off]))
    total = weighed[:, 0].sum()
    # The level is anything: integrated over, with a flat prior.
    pulls = weighed[:, 1:] - np.outer(weighed[:, 0], weighed[:, 1:].sum(axis=0) / total)
    spread = np.linalg.slogdet(system)[1] + np.log(total)
    guess = np.log(slope / _SLOPE) ** 2 + np.log(rough / _ROUGH) ** 2
    likelihood = -0.5 * (float((off * pulls).sum()) + off.shape[1] * spread + guess)
    return likelihood, slope**2 * pulls.T @ ways
