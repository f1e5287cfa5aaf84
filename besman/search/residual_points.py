"""Points that a search has tried with the residuals of their outcomes, and what they tell."""

from __future__ import annotations

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


def correct_by_step(jacobian: FloatArray, before: Tried, after: Tried, trust: float) -> FloatArray:
    """Update a Jacobian (W, R, D) by what a step did [1]_.

    What the first world does, all do, as far as is known; of how the worlds have moved apart from
    each other a share `trust` is believed.

    References
    ----------
    .. [1] C. G. Broyden: A class of methods for solving nonlinear simultaneous equations.
       Mathematics of Computation 19, 1965, equation 4.5, DOI 10.1090/S0025-5718-1965-0198670-6.
    """
    step = after.point - before.point
    length = float(step @ step)
    if length == 0:
        return jacobian
    told = jacobian[: len(after.residuals)] @ step
    off = np.nan_to_num(after.residuals - before.residuals[: len(told)] - told)
    mean = off.mean(axis=0)
    apart = trust * (off - mean) if len(off) == len(jacobian) else 0.0
    return np.asarray(jacobian + (mean + apart)[..., None] * step / length)


def foresee(tried: Tried, jacobian: FloatArray, agreed: FloatArray) -> Tried:
    """Return a point that was tried in the first world with what is to be expected in all.

    Where worlds agree most their distances are least squares: what is left of them there is
    perpendicular to all that a step changes, so that it may be left out.

    Parameters
    ----------
    tried : Tried
        In the first world.
    jacobian : array, shape (W, R, D)
        Of the residuals in all worlds.
    agreed : array, shape (D,)
        Where they agree most.

    Returns
    -------
    Tried
    """
    apart = (jacobian - jacobian[0]) @ (tried.point - agreed)
    return Tried(tried.point, tried.residuals[0] + apart)


def ways_down(jacobian: FloatArray, residuals: FloatArray, most: int) -> FloatArray:
    """Return the directions (P, D) that outcomes depend on most, to the side that leads down.

    `jacobian` is that of W worlds, shape (W, R, D), `residuals`, shape (N, R), those of the first
    N; NaN says nothing. See `important_directions`.
    """
    known = np.isfinite(residuals)
    slopes = jacobian[: len(residuals)][known].T @ residuals[known]
    directions = important_directions(jacobian.reshape(-1, jacobian.shape[2]), most)
    return np.where(directions @ slopes > 0, -1.0, 1.0)[:, None] * directions


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
