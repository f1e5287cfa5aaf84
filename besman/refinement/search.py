"""What every search is: points are asked for, and told what they were worth."""

from __future__ import annotations

from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# What of a motion plan a search may change.
Part = Literal["goal", "duration", "weights"]


class Search(Protocol):
    """A black-box search for the point of the greatest return."""

    def ask(self) -> FloatArray:
        """Return the points to try next, shape (P, D)."""
        ...

    def tell(self, points: FloatArray, returns: FloatArray) -> None:
        """Take the returns (P,) of the points (P, D) that were asked for."""
        ...

    @property
    def exhausted(self) -> bool:
        """Whether going on is of no use."""
        ...
