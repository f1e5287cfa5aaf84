"""What every search is: points are asked for, and told what they were worth.

Returns that are not finite count as the worst: they pull no search anywhere.
"""

from __future__ import annotations

from typing import Literal, Protocol

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
