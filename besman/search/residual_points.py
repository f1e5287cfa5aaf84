"""Points that a search has tried with the residuals of their outcomes, and what they tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# What an outcome that there is not counts at least, in radii of success.
_FAILED = 3.0


@dataclass(frozen=True, eq=False)
class Tried:
    """A point with what came of it.

    Attributes
    ----------
    point : array, shape (D,)
    residuals : array, shape (W, R)
        In the worlds that it was tried in, in radii of success; NaN where one gave no outcome.
    """

    point: FloatArray
    residuals: FloatArray

    @property
    def cost(self) -> float:
        """Root mean square over the worlds of the distance to the target, in radii."""
        return rms(self.residuals)

    @property
    def first(self) -> float:
        """The distance to the target in the first world, in radii."""
        return rms(self.residuals[:1])

    @property
    def spread(self) -> float:
        """The root mean square of the distance to the mean of all worlds."""
        finite = self.residuals[np.isfinite(self.residuals).all(axis=1)]
        return rms(self.residuals - finite.mean(axis=0)) if len(finite) else np.inf

    @property
    def within(self) -> bool:
        """Whether every world's outcome is within the radius."""
        return bool((np.square(self.residuals).sum(axis=1) <= 1.0).all())

    @property
    def apart(self) -> bool:
        """Whether what is left is how far the worlds are apart, rather than their mean."""
        return self.spread**2 > 0.5 * self.cost**2


def rms(residuals: FloatArray) -> float:
    """Return the root mean square over worlds of the norms of residuals (W, R).

    A world without an outcome costs as much as the farthest of the others at least; infinite if
    none has one.
    """
    squares = np.square(residuals).sum(axis=1)
    known = np.isfinite(squares)
    if not known.any():
        return np.inf
    lost = max(_FAILED**2, float(squares[known].max()))
    return float(np.sqrt(np.where(known, squares, lost).mean()))


def correct_by_all(
    jacobian: FloatArray, at: Tried, others: Sequence[Tried], reach: float, damping: float
) -> FloatArray:
    """Correct a Jacobian by ridge regression on what came of the points around one.

    Parameters
    ----------
    jacobian : array, shape (W, R, D)
        What is known; all worlds are corrected by what happened in the first.
    at : Tried
        Where it is to hold.
    others : sequence of Tried
    reach : float
        Points farther off than this are left out.
    damping : float
        How much a correction costs, beside errors of slopes along the ways to the points.

    Returns
    -------
    array, shape (W, R, D)
    """
    ways, errors = [], []
    for one in others:
        way = one.point - at.point
        length = float(np.linalg.norm(way))
        error = one.residuals[0] - at.residuals[0] - jacobian[0] @ way
        if 0 < length <= reach and np.isfinite(error).all():
            ways.append(way / length)
            errors.append(error / length)
    if not ways:
        return jacobian
    rows = np.array(ways)
    system = rows @ rows.T + damping * np.eye(len(rows))
    correction: FloatArray = (rows.T @ np.linalg.solve(system, np.array(errors))).T
    return jacobian + correction


def important_directions(rows: FloatArray, most: int) -> FloatArray:
    """Return directions that outcomes depend on most.

    Where the rows have fewer, coordinates go on with what is left of them.

    Parameters
    ----------
    rows : array, shape (M, D)
        Slopes of outcomes.
    most : int

    Returns
    -------
    array, shape (P, D)
        Orthonormal; P is `most`, or as many coordinates as have slopes.
    """
    directions = np.linalg.svd(rows, full_matrices=False)[2][:most]
    slopes = np.linalg.norm(rows, axis=0)
    moving = np.argsort(-slopes, kind="stable")[: np.count_nonzero(slopes)]
    found = np.linalg.qr(np.vstack([directions, np.eye(len(slopes))[moving]]).T)[0].T
    return np.asarray(found[: min(most, len(moving))])
