r"""Episodic relative entropy policy search (REPS).

The new distribution of points has the greatest expected return of all whose relative entropy to
the one drawn from is at most epsilon. Its weights are d ~ exp(R / eta), with the temperature eta
that minimises the dual

.. math::

    g(\eta) = \eta \epsilon + \eta \log \frac{1}{N} \sum_i \exp(R_i / \eta).

References
----------
.. [1] J. Peters, K. Mülling, Y. Altün: Relative Entropy Policy Search. AAAI 2010.
.. [2] M. P. Deisenroth, G. Neumann, J. Peters: A Survey on Policy Search for Robotics. Foundations
   and Trends in Robotics 2 (2013), section 2.4.3, DOI 10.1561/2300000021.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.search.gaussian import Bounds, GaussianSearch, learning_rate, weighted_covariance

FloatArray = npt.NDArray[np.float64]

LEAST_TEMPERATURE = 1e-8  # of returns that are scaled to [0, 1]


class Reps(GaussianSearch):
    """Relative entropy policy search.

    Parameters
    ----------
    start, sigma, population, seed, bounds
        As in `GaussianSearch`.
    epsilon : float
        Greatest relative entropy of one distribution to the one before.
    memory : int
        From how many generations it learns.
    covariance_rate : float, optional
        As in `besman.search.cem.Cem`; not given: by the root of the memory less than there.
    """

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: npt.ArrayLike,
        population: int,
        seed: tuple[int, ...],
        bounds: Bounds | None = None,
        epsilon: float = 2.0,
        memory: int = 4,
        covariance_rate: float | None = None,
    ) -> None:
        super().__init__(start, sigma, population, seed, bounds)
        self._epsilon, self._memory, self._rate = epsilon, memory, covariance_rate
        self._past: list[tuple[FloatArray, FloatArray]] = []

    def _learn(self, points: FloatArray, returns: FloatArray) -> None:
        """Fit the points of the last generations, weighted."""
        self._past = [*self._past, (points, returns)][-self._memory :]
        points, returns = (np.concatenate(part) for part in zip(*self._past, strict=True))
        weights = reps_weights(returns, self._epsilon)
        # Every point is learnt from several times, so each time a little less.
        usual = learning_rate(weights, len(self.mean)) / np.sqrt(self._memory)
        rate = usual if self._rate is None else self._rate
        self.mean = weights @ points
        fitted = weighted_covariance(points, self.mean, weights, unbiased=True)
        self.covariance = (1.0 - rate) * self.covariance + rate * fitted


def reps_dual(temperature: float, returns: FloatArray, epsilon: float) -> tuple[float, float]:
    """Compute the dual and its derivative.

    Parameters
    ----------
    temperature : float
        Eta, greater than 0.
    returns : array, shape (N,)
    epsilon : float

    Returns
    -------
    value, derivative : float
    """
    best = returns.max()
    scaled = (returns - best) / temperature
    powers = np.exp(scaled)
    log_mean = float(np.log(powers.mean()))
    value = temperature * (epsilon + log_mean) + best
    return float(value), epsilon + log_mean - float(powers @ scaled / powers.sum())


def reps_weights(returns: npt.ArrayLike, epsilon: float) -> FloatArray:
    """Weigh points by their returns.

    Parameters
    ----------
    returns : array, shape (N,)
        Finite; in any unit, because they are scaled to [0, 1].
    epsilon : float
        Greatest relative entropy to equal weights.

    Returns
    -------
    array, shape (N,)
        They sum to 1.
    """
    from scipy.optimize import minimize

    scaled = unit_range(returns)
    found = minimize(
        lambda x: reps_dual(float(x[0]), scaled, epsilon),
        [1.0],
        jac=True,
        method="L-BFGS-B",
        bounds=[(LEAST_TEMPERATURE, None)],
    )
    powers = np.exp((scaled - scaled.max()) / float(found.x[0]))
    return np.asarray(powers / powers.sum(), dtype=np.float64)


def unit_range(returns: npt.ArrayLike) -> FloatArray:
    """Scale returns to [0, 1]; equal ones are all 1."""
    array = np.asarray(returns, dtype=np.float64)
    span = float(array.max() - array.min())
    return np.asarray((array - array.min()) / span if span > 0 else np.ones_like(array))
