"""What every search is: points are asked for, and told what they were worth.

Returns that are not finite count as the worst: they pull no search anywhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from besman.refinement.upper_level import UpperLevelPolicy

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# What of a motion plan a search may change.
Part = Literal["start", "goal", "duration", "weights"]


class Search(Protocol):
    """A black-box search for the point of the greatest return."""

    def ask(self) -> FloatArray:
        """Return the points to try next, shape (P, D)."""
        ...

    def tell(self, points: FloatArray, returns: FloatArray) -> None:
        """Take the returns (P,) of the points (P, D) that were asked for.

        A search that can tell which moment a reward came of (`besman.refinement.pi2`) takes the
        rewards of every moment as well, shape (P, T).
        """
        ...

    @property
    def exhausted(self) -> bool:
        """Whether going on is of no use."""
        ...


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


def usable(returns: npt.ArrayLike) -> BoolArray:
    """Tell which episodes a search can learn from.

    Parameters
    ----------
    returns : array, shape (P,) or (P, T)
        Of episodes, or of every moment of them.

    Returns
    -------
    array of bool, shape (P,)
        Episodes without a return that is not finite.
    """
    finite = np.isfinite(np.asarray(returns, dtype=np.float64))
    return np.asarray(finite if finite.ndim == 1 else finite.all(axis=1), dtype=np.bool_)
