"""CMA-ES behind the ask/tell protocol, with restarts.

References
----------
.. [1] N. Hansen, A. Ostermeier: Completely Derandomized Self-Adaptation in Evolution Strategies.
   Evolutionary Computation 9 (2001), DOI 10.1162/106365601750190398.
.. [2] A. Auger, N. Hansen: A Restart CMA Evolution Strategy With Increasing Population Size
   (IPOP). CEC 2005, DOI 10.1109/CEC.2005.1554902.
.. [3] N. Hansen: Benchmarking a BI-Population CMA-ES on the BBOB-2009 Function Testbed. GECCO
   2009, DOI 10.1145/1570256.1570333.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from besman.search.gaussian import Bounds, check_bounds
from besman.search.load_cma import load_cma

FloatArray = npt.NDArray[np.float64]

Restarts = Literal["none", "ipop", "bipop"]

_LARGER = 2  # a restart's population, relative to the last large one's


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
    bounds : two arrays, shape (D,), optional
        Least and greatest value of every coordinate.
    restarts : "none", "ipop" or "bipop"
        What follows when the strategy has converged: nothing; starts with twice the population
        each; or such and others with a small population and step, whichever have had less.
    n_restarts : int
        Greatest number of restarts; of "bipop" those with a large population.
    scales : array, shape (D,), optional
        Of every coordinate's initial standard deviation, relative to `sigma`.
    """

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: float,
        population: int | None,
        seed: tuple[int, ...],
        bounds: Bounds | None = None,
        restarts: Restarts = "none",
        n_restarts: int = 9,
        scales: npt.ArrayLike | None = None,
    ) -> None:
        self._start, self._sigma = np.array(start, dtype=np.float64), sigma
        self._bounds = check_bounds(self._start, bounds)
        self._scales = None if scales is None else np.asarray(scales, dtype=np.float64)
        self._random = np.random.default_rng(seed)
        self._restarts, self._left = restarts, n_restarts if restarts != "none" else 0
        self._large = self._small = 0  # points told to starts of either kind
        self._is_large = False
        self._strategy = self._begin(population, sigma)
        self._first = self._last_large = int(self._strategy.popsize)

    def _begin(self, population: int | None, sigma: float, budget: float | None = None) -> Any:
        """Return a strategy at the start; of a budget of points it uses no more."""
        random = self._random
        options: dict[str, Any] = {
            "randn": lambda *shape: random.standard_normal(shape),
            # cma must leave numpy's global generator alone.
            "seed": np.nan,
            "verbose": -9,
            # All may fail alike at first.
            "tolflatfitness": np.inf,
        }
        if population is not None:
            options["popsize"] = population
        if self._bounds is not None:
            options["bounds"] = [self._bounds[0].tolist(), self._bounds[1].tolist()]
        if self._scales is not None:
            options["CMA_stds"] = self._scales
        if budget is not None:
            options["maxfevals"] = budget
        return load_cma().CMAEvolutionStrategy(self._start.copy(), sigma, options)

    def ask(self) -> FloatArray:
        """Return the points to try next, shape (P, D)."""
        if self._left > 0 and self._strategy.stop():
            self._restart()
        return np.array(self._strategy.ask())

    def tell(self, points: FloatArray, returns: FloatArray) -> None:
        """Take the returns (P,) of the points (P, D) that were asked for."""
        if not np.isfinite(returns).any():
            return
        # The strategy minimises, and cannot rank what is not a number.
        costs = np.nan_to_num(-np.asarray(returns), nan=1e9, posinf=1e9, neginf=-1e9)
        self._strategy.tell(list(points), costs.tolist())
        if self._is_large:
            self._large += len(points)
        else:
            self._small += len(points)

    def _restart(self) -> None:
        """Start again: larger, or small if small starts have had fewer points than large ones."""
        if self._restarts == "bipop" and self._small < self._large:
            share = self._last_large / self._first / _LARGER
            population = int(self._first * share ** (self._random.uniform() ** 2))
            sigma = self._sigma * 0.01 ** self._random.uniform()
            self._is_large = False
            budget = max(0.5 * self._large, population)
            self._strategy = self._begin(max(population, self._first), sigma, budget)
            return
        self._left -= 1
        self._last_large *= _LARGER
        self._is_large = True
        self._strategy = self._begin(self._last_large, self._sigma)

    @property
    def exhausted(self) -> bool:
        """Whether the strategy has converged or broken down, and may not start again."""
        return self._left == 0 and bool(self._strategy.stop())
