r"""Policy improvement with path integrals (PI2), and with covariance adaptation (PI2-CMA).

At every moment t, the exploration :math:`\epsilon_i` of rollout i counts by the softmax of what
came from then on,

.. math::

    P_i(t) = \frac{\exp(h \tilde S_i(t))}{\sum_k \exp(h \tilde S_k(t))}, \quad
    S_i(t) = \sum_{s \ge t} r_i(s),

where :math:`\tilde S` is scaled to [0, 1] over the rollouts. Each coordinate is changed by the
mean of :math:`\sum_i P_i(t) \epsilon_i` over time, weighted by how active it is at that moment.

Searches are told rewards of every moment (P, T), or one return per episode (P,). Of the latter
all moments have the same weights: this is PI2 for tasks that pay at the end alone (PI^BB of [3]_),
as all simulated tasks here do.

References
----------
.. [1] E. Theodorou, J. Buchli, S. Schaal: A Generalized Path Integral Control Approach to
   Reinforcement Learning. JMLR 11 (2010), table 1.
.. [2] F. Stulp, O. Sigaud: Path Integral Policy Improvement with Covariance Matrix Adaptation.
   ICML 2012, equations 9 to 11.
.. [3] F. Stulp, O. Sigaud: Policy Improvement Methods: Between Black-Box Optimization and Episodic
   Reinforcement Learning, 2012, hal-00738463.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import RefinementError
from besman.search.gaussian import Bounds, GaussianSearch, learning_rate, weighted_covariance
from besman.search.reps import unit_range

FloatArray = npt.NDArray[np.float64]


class Pi2(GaussianSearch):
    """Policy improvement with path integrals.

    Parameters
    ----------
    start, sigma, population, seed, bounds
        As in `GaussianSearch`.
    sharpness : float
        h of the softmax.
    decay : float
        The exploration's standard deviation is multiplied with this after every generation.
    activations : array, shape (T, D), optional
        How active every coordinate is at every moment; not given: equally. Only matters where
        rewards of every moment are told.
    """

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: npt.ArrayLike,
        population: int,
        seed: tuple[int, ...],
        bounds: Bounds | None = None,
        sharpness: float = 10.0,
        decay: float = 0.99,
        activations: npt.ArrayLike | None = None,
    ) -> None:
        super().__init__(start, sigma, population, seed, bounds)
        self._sharpness, self._decay = sharpness, decay
        self._activations = None if activations is None else np.asarray(activations, np.float64)

    def _learn(self, points: FloatArray, returns: FloatArray) -> None:
        """Move the mean, and explore a little less."""
        self.mean = self._moved(points, self._weights(returns))
        self.covariance = self._decay**2 * self.covariance

    def _weights(self, returns: FloatArray) -> FloatArray:
        """Return the weights of every moment, shape (T, P); of episodic returns T is 1."""
        rewards = returns[:, None] if returns.ndim == 1 else returns
        to_go = np.cumsum(rewards[:, ::-1], axis=1)[:, ::-1]
        return np.stack([path_weights(column, self._sharpness) for column in to_go.T])

    def _shares(self, n_moments: int) -> FloatArray:
        """Return how much every moment counts for every coordinate, shape (T, D)."""
        n = len(self.mean)
        if self._activations is None or n_moments == 1:
            return np.full((n_moments, n), 1.0 / n_moments)
        if self._activations.shape != (n_moments, n):
            raise RefinementError(
                f"pi2: activations have shape {self._activations.shape}, expected that of "
                f"moments and coordinates ({n_moments}, {n})"
            )
        return np.asarray(self._activations / self._activations.sum(axis=0))

    def _moved(self, points: FloatArray, weights: FloatArray) -> FloatArray:
        """Return the next mean."""
        changes = weights @ (points - self.mean)
        return np.asarray(self.mean + (self._shares(len(weights)) * changes).sum(axis=0))


class Pi2Cma(Pi2):
    """PI2 that learns the exploration's covariance as well.

    Parameters
    ----------
    start, sigma, population, seed, bounds, sharpness, activations
        As in `Pi2`.
    covariance_rate : float, optional
        As in `besman.search.cem.Cem`.
    """

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: npt.ArrayLike,
        population: int,
        seed: tuple[int, ...],
        bounds: Bounds | None = None,
        sharpness: float = 10.0,
        activations: npt.ArrayLike | None = None,
        covariance_rate: float | None = None,
    ) -> None:
        super().__init__(start, sigma, population, seed, bounds, sharpness, 1.0, activations)
        self._rate = covariance_rate

    def _learn(self, points: FloatArray, returns: FloatArray) -> None:
        """Move mean and covariance; both are compared with the mean that was drawn around."""
        weights = self._weights(returns)
        over_time = weights.mean(axis=0)
        fitted = weighted_covariance(points, self.mean, over_time)
        usual = learning_rate(over_time, len(self.mean))
        rate = usual if self._rate is None else self._rate
        self.mean = self._moved(points, weights)
        self.covariance = (1.0 - rate) * self.covariance + rate * fitted


def path_weights(to_go: npt.ArrayLike, sharpness: float) -> FloatArray:
    """Weigh rollouts by the softmax of what they are worth from one moment on.

    Parameters
    ----------
    to_go : array, shape (P,)
        Sum of rewards from that moment on.
    sharpness : float
        h: the best counts exp(h) times as much as the worst.

    Returns
    -------
    array, shape (P,)
        They sum to 1.
    """
    powers = np.exp(sharpness * (unit_range(to_go) - 1.0))
    return np.asarray(powers / powers.sum(), dtype=np.float64)
