"""Upper-level policies: Gaussians over points whose mean depends on the context."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from besman.exceptions import RefinementError
from besman.records import Record, freeze
from besman.search.gaussian import draw

FloatArray = npt.NDArray[np.float64]

Features = Literal["affine", "quadratic"]


@dataclass(frozen=True, eq=False)
class UpperLevelPolicy(
    Record,
    stored_as="besman.refinement.upper_level:UpperLevelPolicy",
    finite=("gain", "covariance", "centre", "scale"),
):
    """A Gaussian over points; its mean is linear in features of the context.

    Attributes
    ----------
    gain : array, shape (D, F)
        The mean is gain times the context's features.
    covariance : array, shape (D, D)
        The same in every context.
    features : "affine" or "quadratic"
        1 and the context's coordinates; for quadratic their products, too.
    centre, scale : array, shape (S,)
        The features are those of (context - centre) / scale.
    """

    gain: FloatArray
    covariance: FloatArray
    features: Features
    centre: FloatArray
    scale: FloatArray

    def __post_init__(self) -> None:
        """Copy the arrays, make them read-only and check their shapes."""
        freeze(
            self,
            {"gain": ("D", "F"), "covariance": ("D", "D"), "centre": ("S",), "scale": ("S",)},
        )

    def features_of(self, contexts: npt.ArrayLike) -> FloatArray:
        """Return the features of contexts (P, S), shape (P, F).

        Raises
        ------
        RefinementError
            If the contexts have another number of coordinates or are not finite.
        """
        array = np.asarray(contexts, dtype=np.float64)
        if array.ndim != 2 or array.shape[1] != len(self.centre):
            raise RefinementError(
                f"contexts must have shape (P, {len(self.centre)}), got {array.shape}"
            )
        if not np.isfinite(array).all():
            raise RefinementError("contexts must be finite, got NaN or infinity")
        return context_features((array - self.centre) / self.scale, self.features)

    def means(self, contexts: npt.ArrayLike) -> FloatArray:
        """Return the best known point for each of the contexts (P, S), shape (P, D)."""
        return self.features_of(contexts) @ self.gain.T

    def draw(self, contexts: npt.ArrayLike, random: np.random.Generator) -> FloatArray:
        """Draw a point for each of the contexts (P, S), shape (P, D)."""
        means = self.means(contexts)
        return means + draw(random, self.covariance, len(means))

    def fitted(
        self, features: FloatArray, points: FloatArray, weights: FloatArray, ridge: float
    ) -> UpperLevelPolicy:
        """Return the policy whose mean is nearest to weighted points.

        Parameters
        ----------
        features : array, shape (P, F)
            Of the points' contexts.
        points : array, shape (P, D)
        weights : array, shape (P,)
            They sum to 1.
        ridge : float
            Weight of the squared change of the gain: what the points leave open stays.
        """
        n = features.shape[1]
        gram = (features * weights[:, None]).T @ features + ridge * np.eye(n)
        missing = points - features @ self.gain.T
        change = np.linalg.solve(gram, (features * weights[:, None]).T @ missing)
        return replace(self, gain=self.gain + change.T)


def first_policy(
    start: npt.ArrayLike,
    sigma: npt.ArrayLike,
    region: tuple[npt.ArrayLike, npt.ArrayLike],
    features: Features,
) -> UpperLevelPolicy:
    """Set up the policy that gives the same point in every context.

    Parameters
    ----------
    start : array, shape (D,)
        That point.
    sigma : float or array, shape (D,)
        Standard deviation of every coordinate.
    region : two arrays, shape (S,)
        Least and greatest context.
    features : "affine" or "quadratic"

    Raises
    ------
    RefinementError
        If the region has no extent.
    """
    low, high = (np.atleast_1d(np.asarray(one, dtype=np.float64)) for one in region)
    if low.shape != high.shape or not (low < high).all():
        raise RefinementError(
            f"context region: got {low.tolist()} to {high.tolist()}, expected least below greatest"
        )
    point = np.array(start, dtype=np.float64)
    centre, scale = 0.5 * (low + high), 0.5 * (high - low)
    n_features = context_features(np.zeros((1, len(low))), features).shape[1]
    gain = np.zeros((len(point), n_features))
    gain[:, 0] = point
    covariance = np.diag(np.broadcast_to(np.square(sigma), len(point)).astype(np.float64))
    return UpperLevelPolicy(gain, covariance, features, centre, scale)


def context_features(contexts: FloatArray, features: Features) -> FloatArray:
    """Return 1, the coordinates of contexts (P, S) and for quadratic their products: (P, F)."""
    columns = [np.ones((len(contexts), 1)), contexts]
    if features == "quadratic":
        first, second = np.triu_indices(contexts.shape[1])
        columns.append(contexts[:, first] * contexts[:, second])
    return np.concatenate(columns, axis=1)
