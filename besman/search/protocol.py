"""What every search is: points are asked for, and told what they were worth.

Returns that are not finite count as the worst: they pull no search anywhere.
"""

from __future__ import annotations

from typing import Literal, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

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

        A search that can tell which moment a reward came of (`besman.search.pi2`) takes the
        rewards of every moment as well, shape (P, T).
        """
        ...

    @property
    def exhausted(self) -> bool:
        """Whether going on is of no use."""
        ...


@runtime_checkable
class ResidualSearch(Search, Protocol):
    """A search that learns from outcomes as well: how far off the target each was, and whither."""

    def tell(
        self, points: FloatArray, returns: FloatArray, residuals: FloatArray | None = None
    ) -> None:
        """Take the residuals (P, W, R) of the points in W worlds too; the first is the model."""
        ...

    def tell_start(self, point: FloatArray, residuals: FloatArray) -> None:
        """Take the residuals (1, R) of the start (D,), before anything is asked for."""
        ...

    def enter_worlds(self, point: FloatArray) -> None:
        """Look at all worlds from now on, beginning at a point (D,)."""
        ...

    @property
    def jacobian(self) -> FloatArray | None:
        """Of the residuals, shape (W, R, D), as far as it is known."""
        ...

    @property
    def n_worlds(self) -> int:
        """How many worlds it looks at; 1 for the model as it is."""
        ...

    @property
    def in_worlds(self) -> bool:
        """Whether the points asked for next are to be tried in all of them."""
        ...

    def hand_over(self) -> None:
        """Have another search go on, if none does: what this one ended with does not hold."""
        ...

    @property
    def handed_over(self) -> bool:
        """Whether another search has had to go on."""
        ...
