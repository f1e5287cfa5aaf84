"""Black-box searches for a placement, behind one ask/tell protocol."""

from __future__ import annotations

import queue
import threading
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from besman.search.load_cma import load_cma

FloatArray = npt.NDArray[np.float64]

Optimizer = Literal["cma_es", "differential_evolution"]

_SIGMA = 0.7
_MEMBERS_PER_DIMENSION = 5


class BoxSearch(Protocol):
    """A search for the point of least cost in a box."""

    def ask(self) -> FloatArray:
        """Return the points to try next, shape (P, D)."""
        ...

    def tell(self, points: FloatArray, costs: FloatArray) -> None:
        """Take the costs (P,) of the points (P, D) that were asked for."""
        ...

    @property
    def exhausted(self) -> bool:
        """Whether going on is of no use."""
        ...

    def close(self) -> None:
        """Let go of what the search holds; it is not asked again."""
        ...


def make_box_search(
    optimizer: Optimizer, start: FloatArray, low: FloatArray, high: FloatArray, seed: int
) -> BoxSearch:
    """Return a search by name.

    Parameters
    ----------
    optimizer : "cma_es" or "differential_evolution"
    start : array, shape (D,)
        A good point, inside the box; distances are comparable between coordinates.
    low, high : array, shape (D,)
        The box.
    seed : int
    """
    if optimizer == "cma_es":
        return CmaEsSearch(start, low, high, seed)
    return DifferentialEvolutionSearch(start, low, high, seed)


class CmaEsSearch:
    """Covariance matrix adaptation (library ``cma``), from one point."""

    def __init__(self, start: FloatArray, low: FloatArray, high: FloatArray, seed: int) -> None:
        # The library takes 0 for "draw a seed".
        options = {"seed": seed + 1, "verbose": -9, "bounds": [low.tolist(), high.tolist()]}
        self._strategy = load_cma().CMAEvolutionStrategy(start, _SIGMA, options)

    def ask(self) -> FloatArray:
        """Return the next generation, shape (P, D)."""
        return np.array(self._strategy.ask())

    def tell(self, points: FloatArray, costs: FloatArray) -> None:
        """Take the costs of a generation."""
        self._strategy.tell(list(points), costs.tolist())

    @property
    def exhausted(self) -> bool:
        """Whether it has converged."""
        return bool(self._strategy.stop())

    def close(self) -> None:
        """Nothing is held."""


class DifferentialEvolutionSearch:
    """Differential evolution (``scipy.optimize``), over the whole box and from one point in it.

    SciPy calls the function that it minimises; here that function runs in a thread of its own,
    hands each generation out and waits for its costs.
    """

    def __init__(self, start: FloatArray, low: FloatArray, high: FloatArray, seed: int) -> None:
        self._points: queue.Queue[FloatArray | None] = queue.Queue()
        self._costs: queue.Queue[FloatArray | None] = queue.Queue()
        self._next: FloatArray | None = None
        arguments = (np.clip(start, low, high), low, high, seed)
        self._thread = threading.Thread(target=self._minimise, args=arguments, daemon=True)
        self._thread.start()
        self._fetch()

    def _minimise(self, start: FloatArray, low: FloatArray, high: FloatArray, seed: int) -> None:
        from scipy.optimize import differential_evolution

        try:
            differential_evolution(
                self._cost,
                list(zip(low, high, strict=True)),
                x0=start,
                rng=np.random.default_rng(seed),
                popsize=_MEMBERS_PER_DIMENSION,
                maxiter=100_000,
                vectorized=True,
                updating="deferred",
                polish=False,
            )
        except _AbandonedError:
            return
        self._points.put(None)

    def _cost(self, points: FloatArray) -> FloatArray:
        """Hand out points (D, P) and wait for their costs."""
        self._points.put(np.array(points.T))
        costs = self._costs.get()
        if costs is None:
            raise _AbandonedError
        return costs

    def _fetch(self) -> None:
        self._next = self._points.get()

    def ask(self) -> FloatArray:
        """Return the next generation, shape (P, D)."""
        assert self._next is not None
        return self._next

    def tell(self, points: FloatArray, costs: FloatArray) -> None:
        """Take the costs of a generation."""
        self._costs.put(np.asarray(costs, dtype=np.float64))
        self._fetch()

    @property
    def exhausted(self) -> bool:
        """Whether it has converged."""
        return self._next is None

    def close(self) -> None:
        """End the thread."""
        if self._next is not None:
            self._costs.put(None)
            self._next = None
        self._thread.join()


class _AbandonedError(Exception):
    """The search is not asked any more."""
