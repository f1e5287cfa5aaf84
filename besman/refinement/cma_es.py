"""CMA-ES behind the ask/tell protocol.

References
----------
.. [1] N. Hansen, A. Ostermeier: Completely Derandomized Self-Adaptation in Evolution Strategies.
   Evolutionary Computation 9 (2001), DOI 10.1162/106365601750190398.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


class CmaEs:
    """Covariance matrix adaptation evolution strategy.

    Parameters
    ----------
    start : array, shape (D,)
        First mean; D is at least 2.
    sigma : float
        Initial standard deviation of every coordinate.
    population : int or None
        Points per generation; None for 4 + 3 ln D.
    seed : sequence of int
        Of a random generator of its own, so that searches side by side do not disturb each other.
    """

    def __init__(
        self, start: npt.ArrayLike, sigma: float, population: int | None, seed: tuple[int, ...]
    ) -> None:
        import cma

        random = np.random.default_rng(seed)
        options = {
            "randn": lambda *shape: random.standard_normal(shape),
            # cma must leave numpy's global generator alone.
            "seed": np.nan,
            "verbose": -9,
            # All may fail alike at first.
            "tolflatfitness": np.inf,
        }
        if population is not None:
            options["popsize"] = population
        self._strategy = cma.CMAEvolutionStrategy(np.array(start, dtype=float), sigma, options)

    def ask(self) -> FloatArray:
        """Return the points to try next, shape (P, D)."""
        return np.array(self._strategy.ask())

    def tell(self, points: FloatArray, returns: FloatArray) -> None:
        """Take the returns (P,) of the points (P, D) that were asked for."""
        # The strategy minimises, and cannot rank what is not a number.
        costs = np.nan_to_num(-np.asarray(returns), nan=1e9, posinf=1e9, neginf=-1e9)
        self._strategy.tell(list(points), costs.tolist())

    @property
    def exhausted(self) -> bool:
        """Whether the strategy has converged or broken down."""
        return bool(self._strategy.stop())
