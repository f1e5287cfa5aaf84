"""What the searches with a Gaussian have in common: drawing from it, bounds, and its end."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import numpy.typing as npt

from besman.exceptions import RefinementError
from besman.search.usable import usable

FloatArray = npt.NDArray[np.float64]

Bounds = tuple[npt.ArrayLike, npt.ArrayLike]

# A search ends when its widest direction is this narrow, relative to how it began.
_NARROW = 1e-12


class GaussianSearch(ABC):
    """A search that draws its points from a Gaussian and moves that towards the good ones.

    Parameters
    ----------
    start : array, shape (D,)
        First mean.
    sigma : float or array, shape (D,)
        Initial standard deviation of every coordinate.
    population : int
        Points per generation.
    seed : sequence of int
        Of a random generator of its own.
    bounds : two arrays, shape (D,), optional
        Least and greatest value of every coordinate; what is drawn beyond is moved there.

    Attributes
    ----------
    mean : array, shape (D,)
    covariance : array, shape (D, D)

    Raises
    ------
    RefinementError
        If the start lies outside the bounds.
    """

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: npt.ArrayLike,
        population: int,
        seed: tuple[int, ...],
        bounds: Bounds | None = None,
    ) -> None:
        self.mean = np.array(start, dtype=np.float64)
        n = len(self.mean)
        self.covariance = np.diag(np.broadcast_to(np.square(sigma), n).astype(np.float64))
        self._population = population
        self._random = np.random.default_rng(seed)
        self._bounds = check_bounds(self.mean, bounds)
        self._first_width = self._width

    def ask(self) -> FloatArray:
        """Return the points to try next, shape (P, D)."""
        points = self.mean + draw(self._random, self.covariance, self._population)
        return points if self._bounds is None else np.clip(points, *self._bounds)

    def tell(self, points: FloatArray, returns: FloatArray) -> None:
        """Take the returns (P,) of the points (P, D) that were asked for."""
        good = usable(returns)
        if good.sum() > 1:
            self._learn(np.asarray(points)[good], np.asarray(returns)[good])

    @abstractmethod
    def _learn(self, points: FloatArray, returns: FloatArray) -> None:
        """Move the Gaussian, knowing at least two points with finite returns."""

    @property
    def _width(self) -> float:
        """Standard deviation in the widest direction."""
        return float(np.sqrt(max(np.linalg.eigvalsh(self.covariance)[-1], 0.0)))

    @property
    def exhausted(self) -> bool:
        """Whether all points would be the same."""
        return self._width <= _NARROW * self._first_width


def check_bounds(start: FloatArray, bounds: Bounds | None) -> tuple[FloatArray, FloatArray] | None:
    """Return bounds as two arrays, shape (D,).

    Raises
    ------
    RefinementError
        If the start lies outside, or there is no room between the bounds.
    """
    if bounds is None:
        return None
    low, high = (np.broadcast_to(np.asarray(one, np.float64), start.shape) for one in bounds)
    outside = np.flatnonzero((start < low) | (start > high) | (low >= high))
    if len(outside):
        at = outside[0]
        raise RefinementError(
            f"search: coordinate {at} starts at {start[at]:g}, expected within its bounds "
            f"{low[at]:g} to {high[at]:g}"
        )
    return low, high


def draw(random: np.random.Generator, covariance: FloatArray, n: int) -> FloatArray:
    """Draw from a Gaussian around zero, also where its covariance (D, D) is singular: (n, D)."""
    spread, axes = np.linalg.eigh(covariance)
    scaled = axes * np.sqrt(np.maximum(spread, 0.0))
    drawn: FloatArray = random.standard_normal((n, len(covariance))) @ scaled.T
    return drawn


def weighted_covariance(
    points: FloatArray, centre: FloatArray, weights: FloatArray, unbiased: bool = False
) -> FloatArray:
    """Return the covariance of weighted points.

    Parameters
    ----------
    points : array, shape (P, D)
    centre : array, shape (D,) or (P, D)
        What they are compared with.
    weights : array, shape (P,)
        They sum to 1.
    unbiased : bool
        Divide by 1 - sum of squared weights, as if the centre were their weighted mean.

    Returns
    -------
    array, shape (D, D)
    """
    apart = points - centre
    covariance = (apart * weights[:, None]).T @ apart
    if unbiased:
        covariance /= max(1.0 - float(weights @ weights), 1e-12)
    return covariance


def learning_rate(weights: FloatArray, dimension: int) -> float:
    """Say how far to trust a covariance: fully of many points, little of fewer than dimensions.

    Parameters
    ----------
    weights : array, shape (P,)
        Of the points; they sum to 1.
    dimension : int

    Returns
    -------
    float
        0 to 1: n / (n + D), where n is the effective number of points.
    """
    effective = 1.0 / float(weights @ weights)
    return effective / (effective + dimension)
