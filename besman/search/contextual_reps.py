r"""Contextual relative entropy policy search (C-REPS).

As REPS, but a return counts by how much it exceeds what is usual in its context: the baseline
V(s) = nu' phi(s), found together with the temperature by minimising the dual

.. math::

    g(\eta, \nu) = \eta \epsilon + \nu^T \bar\phi
    + \eta \log \frac{1}{N} \sum_i \exp\frac{R_i - \nu^T \phi_i}{\eta}.

References
----------
.. [1] A. G. Kupcsik, M. P. Deisenroth, J. Peters, G. Neumann: Data-Efficient Generalization of
   Robot Skills with Contextual Policy Search. AAAI 2013.
.. [2] M. P. Deisenroth, G. Neumann, J. Peters: A Survey on Policy Search for Robotics. Foundations
   and Trends in Robotics 2 (2013), section 2.4.3.2, DOI 10.1561/2300000021.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from besman.search.gaussian import Bounds, check_bounds, learning_rate, weighted_covariance
from besman.search.reps import LEAST_TEMPERATURE, unit_range
from besman.search.upper_level import Features, context_features, first_policy
from besman.search.usable import usable

FloatArray = npt.NDArray[np.float64]

_NARROW = 1e-12
# With 2, as of REPS, the exploration is gone before the policy fits: around some throws it stayed
# 12 to 15 cm off its targets, with 1 it came to 2 to 7 cm.
_EPSILON = 1.0
_GENERATION = 50


class ContextualReps:
    """Contextual relative entropy policy search.

    Parameters
    ----------
    start : array, shape (D,)
        First point for every context.
    sigma : float or array, shape (D,)
        Initial standard deviation of every coordinate.
    region : two arrays, shape (S,)
        Least and greatest context.
    seed : sequence of int
        Of a random generator of its own.
    features : "affine" or "quadratic"
        Of the context, for the policy's mean. The baseline is quadratic.
    epsilon, memory, covariance_rate
        As in `besman.search.reps.Reps`; the bound is tighter.
    ridge : float
        As in `UpperLevelPolicy.fitted`.
    bounds : two arrays, shape (D,), optional
        Least and greatest value of every coordinate.

    Attributes
    ----------
    policy : UpperLevelPolicy
    usual_sigma, usual_ridge : float
        See `besman.search.contextual.ContextualSearch`.
    """

    usual_sigma: ClassVar[float] = 0.7
    usual_ridge: ClassVar[float] = 1e-4

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: npt.ArrayLike,
        region: tuple[npt.ArrayLike, npt.ArrayLike],
        seed: tuple[int, ...],
        features: Features = "affine",
        epsilon: float = _EPSILON,
        memory: int = 4,
        ridge: float = 1e-4,
        covariance_rate: float | None = None,
        bounds: Bounds | None = None,
    ) -> None:
        self.policy = first_policy(start, sigma, region, features)
        self._bounds = check_bounds(self.policy.gain[:, 0], bounds)
        self._random = np.random.default_rng(seed)
        self._epsilon, self._memory, self._ridge = epsilon, memory, ridge
        self._rate = covariance_rate
        self._past: list[tuple[FloatArray, FloatArray, FloatArray]] = []
        self._first_width = self._width

    @staticmethod
    def usual_generation(dimension: int, n_contexts: int) -> int:
        """Return how many episodes of motion plans a generation has, if nothing else is said."""
        return _GENERATION

    def ask(self, contexts: npt.ArrayLike) -> FloatArray:
        """Return a point to try for each of the contexts (P, S), shape (P, D)."""
        points = self.policy.draw(contexts, self._random)
        return points if self._bounds is None else np.clip(points, *self._bounds)

    def tell(self, contexts: FloatArray, points: FloatArray, returns: FloatArray) -> None:
        """Take the returns (P,) of the points (P, D) in their contexts (P, S)."""
        good = usable(returns)
        if good.any():
            one = (np.asarray(contexts)[good], np.asarray(points)[good], np.asarray(returns)[good])
            self._past = [*self._past, one][-self._memory :]
        if sum(len(one[2]) for one in self._past) > self.policy.gain.shape[1]:
            self._learn()

    def _learn(self) -> None:
        """Fit policy and covariance to the points of the last generations, weighted."""
        contexts, points, returns = (np.concatenate(part) for part in zip(*self._past, strict=True))
        features, policy = self.policy.features_of(contexts), self.policy
        scaled = (contexts - policy.centre) / policy.scale
        weights = contextual_weights(returns, context_features(scaled, "quadratic"), self._epsilon)
        usual = learning_rate(weights, len(policy.gain)) / np.sqrt(self._memory)
        rate = usual if self._rate is None else self._rate
        new = policy.fitted(features, points, weights, self._ridge)
        centre = features @ new.gain.T
        fitted = weighted_covariance(points, centre, weights, unbiased=True)
        self.policy = replace(new, covariance=(1.0 - rate) * policy.covariance + rate * fitted)

    @property
    def _width(self) -> float:
        """Standard deviation in the widest direction."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.policy.covariance)[-1], 0.0)))

    @property
    def exhausted(self) -> bool:
        """Whether all points of a context would be the same."""
        return self._width <= _NARROW * self._first_width


def contextual_dual(
    parameters: FloatArray, returns: FloatArray, features: FloatArray, epsilon: float
) -> tuple[float, FloatArray]:
    """Compute the dual and its gradient.

    Parameters
    ----------
    parameters : array, shape (1 + F,)
        Eta, greater than 0, and nu.
    returns : array, shape (N,)
    features : array, shape (N, F)
        Of the contexts.
    epsilon : float

    Returns
    -------
    value : float
    gradient : array, shape (1 + F,)
    """
    temperature, slope = float(parameters[0]), parameters[1:]
    mean = features.mean(axis=0)
    advantages = returns - features @ slope
    best = advantages.max()
    scaled = (advantages - best) / temperature
    powers = np.exp(scaled)
    shares = powers / powers.sum()
    log_mean = float(np.log(powers.mean()))
    value = temperature * (epsilon + log_mean) + best + slope @ mean
    gradient = np.empty(len(parameters))
    gradient[0] = epsilon + log_mean - shares @ scaled
    gradient[1:] = mean - shares @ features
    return float(value), gradient


def contextual_weights(
    returns: npt.ArrayLike, features: npt.ArrayLike, epsilon: float
) -> FloatArray:
    """Weigh points by how much their returns exceed what is usual in their contexts.

    Parameters
    ----------
    returns : array, shape (N,)
        Finite; in any unit.
    features : array, shape (N, F)
        Of the baseline; the first is 1.
    epsilon : float
        Greatest relative entropy to equal weights.

    Returns
    -------
    array, shape (N,)
        They sum to 1, and their mean features are those of all points, where that is possible.
    """
    from scipy.optimize import minimize

    # The constant moves all returns alike and changes nothing.
    phi = np.asarray(features, dtype=np.float64)[:, 1:]
    # Least squares takes away most of the baseline; what is left has the scale of the noise.
    design = np.column_stack([np.ones(len(phi)), phi])
    raw = unit_range(returns)
    residual = raw - design @ np.linalg.lstsq(design, raw, rcond=None)[0]
    spread = float(np.ptp(residual))
    scaled = residual / spread if spread > 1e-12 else np.zeros(len(residual))
    found = minimize(
        contextual_dual,
        np.concatenate([[1.0], np.zeros(phi.shape[1])]),
        args=(scaled, phi, epsilon),
        jac=True,
        method="L-BFGS-B",
        bounds=[(LEAST_TEMPERATURE, None)] + [(None, None)] * phi.shape[1],
    )
    advantages = scaled - phi @ found.x[1:]
    powers = np.exp((advantages - advantages.max()) / float(found.x[0]))
    return np.asarray(powers / powers.sum(), dtype=np.float64)
