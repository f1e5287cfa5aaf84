"""The cross-entropy method: a Gaussian is fitted to the better part of the points.

References
----------
.. [1] R. Y. Rubinstein, D. P. Kroese: The Cross-Entropy Method, 2004, section 5.1,
   DOI 10.1007/978-1-4757-4321-0.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.search.gaussian import Bounds, GaussianSearch, learning_rate, weighted_covariance

FloatArray = npt.NDArray[np.float64]


class Cem(GaussianSearch):
    """Cross-entropy method.

    Parameters
    ----------
    start, sigma, population, seed, bounds
        As in `GaussianSearch`.
    elite_share : float
        Share of the points that the Gaussian is fitted to.
    covariance_rate : float, optional
        Share of the fitted covariance in the next one, the rest is the last one's; 1 is the
        method as published, which collapses if the elite are not many more than the coordinates.
        Not given: see `learning_rate`.
    """

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: npt.ArrayLike,
        population: int,
        seed: tuple[int, ...],
        bounds: Bounds | None = None,
        elite_share: float = 0.5,
        covariance_rate: float | None = None,
    ) -> None:
        super().__init__(start, sigma, population, seed, bounds)
        self._elite_share, self._rate = elite_share, covariance_rate

    def _learn(self, points: FloatArray, returns: FloatArray) -> None:
        """Fit the elite."""
        n_elite = max(2, round(self._elite_share * len(points)))
        elite = points[np.argsort(-returns, kind="stable")[:n_elite]]
        weights = np.full(len(elite), 1.0 / len(elite))
        self.mean = elite.mean(axis=0)
        usual = learning_rate(weights, len(self.mean))
        rate = usual if self._rate is None else self._rate
        fitted = weighted_covariance(elite, self.mean, weights)
        self.covariance = (1.0 - rate) * self.covariance + rate * fitted
