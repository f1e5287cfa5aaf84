"""What every contextual search is: it learns a policy from contexts to points."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from besman.search.upper_level import UpperLevelPolicy

FloatArray = npt.NDArray[np.float64]


class ContextualSearch(Protocol):
    """A search for a policy that gives the best point for every context.

    Attributes
    ----------
    policy : UpperLevelPolicy
        The best so far.
    """

    policy: UpperLevelPolicy

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
