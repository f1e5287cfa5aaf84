"""Contextual CMA-ES: CMA-ES whose mean depends on the context.

References
----------
.. [1] A. Abdolmaleki, B. Price, N. Lau, L. P. Reis, G. Neumann: Contextual Covariance Matrix
   Adaptation Evolutionary Strategies. IJCAI 2017, DOI 10.24963/ijcai.2017/191.
.. [2] N. Hansen: The CMA Evolution Strategy: A Tutorial, 2016, arXiv 1604.00772; table 1 for the
   rates, which are those of the dimension without the context's.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from besman.search.gaussian import Bounds, check_bounds, draw
from besman.search.upper_level import Features, context_features, first_policy

FloatArray = npt.NDArray[np.float64]

_NARROW = 1e-12
_BASELINE_RIDGE = 1e-8


def usual_population(dimension: int, context_dimension: int) -> int:
    """Return how many episodes a generation should have: (4 + 3 ln(D + S)) (1 + 2 S)."""
    plain = 4 + int(3 * np.log(dimension + context_dimension))
    return plain * (1 + 2 * context_dimension)


class ContextualCmaEs:
    """Contextual covariance matrix adaptation evolution strategy.

    Parameters
    ----------
    start : array, shape (D,)
        First point for every context.
    sigma : float
        Initial standard deviation of every coordinate.
    region : two arrays, shape (S,)
        Least and greatest context.
    seed : sequence of int
        Of a random generator of its own.
    features : "affine" or "quadratic"
        Of the context, for the policy's mean. The baseline is quadratic.
    ridge : float
        As in `UpperLevelPolicy.fitted`.
    bounds : two arrays, shape (D,), optional
        Least and greatest value of every coordinate.

    Attributes
    ----------
    policy : UpperLevelPolicy
    usual_sigma, usual_ridge : float
        See `besman.search.contextual.ContextualSearch`: sigma may grow, and each generation is
        learnt from alone.
    """

    usual_sigma: ClassVar[float] = 0.3
    usual_ridge: ClassVar[float] = 1e-2

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: float,
        region: tuple[npt.ArrayLike, npt.ArrayLike],
        seed: tuple[int, ...],
        features: Features = "affine",
        ridge: float = 1e-10,
        bounds: Bounds | None = None,
    ) -> None:
        self.policy = first_policy(start, sigma, region, features)
        n = len(self.policy.gain)
        self._bounds = check_bounds(self.policy.gain[:, 0], bounds)
        self._random = np.random.default_rng(seed)
        self._ridge = ridge
        self._sigma = self._first_sigma = float(sigma)
        self._shape = np.eye(n)
        self._path, self._step_path = np.zeros(n), np.zeros(n)
        self._generation = 0

    @staticmethod
    def usual_generation(dimension: int, n_contexts: int) -> int:
        """Return twice its paper's size of a generation, which is for affine features."""
        return 2 * usual_population(dimension, n_contexts)

    def ask(self, contexts: npt.ArrayLike) -> FloatArray:
        """Return a point to try for each of the contexts (P, S), shape (P, D)."""
        means = self.policy.means(contexts)
        points = means + self._sigma * draw(self._random, self._shape, len(means))
        return points if self._bounds is None else np.clip(points, *self._bounds)

    def tell(self, contexts: FloatArray, points: FloatArray, returns: FloatArray) -> None:
        """Take the returns (P,) of the points (P, D) in their contexts (P, S)."""
        returns = np.asarray(returns, dtype=np.float64)
        finite = np.isfinite(returns)
        if finite.sum() < 2:
            return
        contexts, points, returns = (np.asarray(x)[finite] for x in (contexts, points, returns))
        policy, features = self.policy, self.policy.features_of(contexts)
        scaled = (contexts - policy.centre) / policy.scale
        weights = rank_weights(advantages(returns, context_features(scaled, "quadratic")))
        new = policy.fitted(features, points, weights, self._ridge)
        steps = (points - features @ policy.gain.T) / self._sigma
        moved = (new.gain - policy.gain) @ features.mean(axis=0) / self._sigma
        self._adapt(steps, moved, weights)
        self.policy = replace(new, covariance=self._sigma**2 * self._shape)

    def _adapt(self, steps: FloatArray, moved: FloatArray, weights: FloatArray) -> None:
        """Adapt shape and step size to steps (P, D) and the mean's (D,), in units of sigma."""
        n = len(moved)
        effective = 1.0 / float(weights @ weights)
        c_sigma = (effective + 2) / (n + effective + 5)
        damping = 1 + 2 * max(0.0, np.sqrt((effective - 1) / (n + 1)) - 1) + c_sigma
        c_path = (4 + effective / n) / (n + 4 + 2 * effective / n)
        c_one = 2 / ((n + 1.3) ** 2 + effective)
        c_mu = min(1 - c_one, 2 * (effective - 2 + 1 / effective) / ((n + 2) ** 2 + effective))
        spread, axes = np.linalg.eigh(self._shape)
        whitened = axes @ ((axes.T @ moved) / np.sqrt(np.maximum(spread, 1e-20)))
        self._generation += 1
        self._step_path *= 1 - c_sigma
        self._step_path += np.sqrt(c_sigma * (2 - c_sigma) * effective) * whitened
        squared = float(self._step_path @ self._step_path)
        settled = 1 - (1 - c_sigma) ** (2 * self._generation)
        # A path that is too long says that sigma must grow first.
        short = squared / settled / n < 2 + 4 / (n + 1)
        self._path *= 1 - c_path
        self._path += short * np.sqrt(c_path * (2 - c_path) * effective) * moved
        lost = 0.0 if short else c_path * (2 - c_path)
        self._shape = (
            (1 - c_one * (1 - lost) - c_mu) * self._shape
            + c_one * np.outer(self._path, self._path)
            + c_mu * (steps * weights[:, None]).T @ steps
        )
        self._sigma *= float(np.exp(min(0.6, c_sigma / (2 * damping) * (squared / n - 1))))

    @property
    def exhausted(self) -> bool:
        """Whether all points of a context would be the same."""
        width = self._sigma * np.sqrt(max(np.linalg.eigvalsh(self._shape)[-1], 0.0))
        return bool(width <= _NARROW * self._first_sigma)


def advantages(returns: FloatArray, features: FloatArray) -> FloatArray:
    """Return by how much returns (P,) exceed their regression on features (P, F), shape (P,)."""
    n = features.shape[1]
    gram = features.T @ features + _BASELINE_RIDGE * len(features) * np.eye(n)
    middle = returns.mean()
    slope = np.linalg.solve(gram, features.T @ (returns - middle))
    return np.asarray(returns - middle - features @ slope)


def rank_weights(values: FloatArray) -> FloatArray:
    """Return the weights of CMA-ES (P,) for values (P,): the better half, by their ranks."""
    n = len(values)
    by_rank = np.maximum(np.log(0.5 * (n + 1)) - np.log(np.arange(1, n + 1)), 0.0)
    weights = np.empty(n)
    weights[np.argsort(-values, kind="stable")] = by_rank / by_rank.sum()
    return weights
