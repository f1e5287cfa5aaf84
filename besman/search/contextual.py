"""What every contextual search is: it learns a policy from contexts to points."""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from besman.search.upper_level import Features, UpperLevelPolicy

FloatArray = npt.NDArray[np.float64]


class ContextualSearch(Protocol):
    """A search for a policy that gives the best point for every context.

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
        Of the context, for the policy's mean.
    ridge : float
        As in `UpperLevelPolicy.fitted`.

    Attributes
    ----------
    policy : UpperLevelPolicy
        The best so far.
    usual_sigma, usual_ridge : float
        For motion plans, if none is given.
    """

    policy: UpperLevelPolicy
    usual_sigma: ClassVar[float]
    usual_ridge: ClassVar[float]

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: float,
        region: tuple[npt.ArrayLike, npt.ArrayLike],
        seed: tuple[int, ...],
        features: Features = "affine",
        *,
        ridge: float,
    ) -> None: ...

    @staticmethod
    def usual_generation(dimension: int, n_contexts: int) -> int:
        """Return how many episodes of motion plans a generation has, if nothing else is said."""
        ...

    def ask(self, contexts: npt.ArrayLike) -> FloatArray:
        """Return a point to try for each of the contexts (P, S), shape (P, D)."""
        ...

    def tell(self, contexts: FloatArray, points: FloatArray, returns: FloatArray) -> None:
        """Take the returns (P,) of the points (P, D) in their contexts (P, S)."""
        ...

    @property
    def exhausted(self) -> bool:
        """Whether going on is of no use."""
        ...
