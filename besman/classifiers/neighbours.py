"""Classifiers by nearest examples, under scikit-learn's interface."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.neighbors import KNeighborsClassifier

from besman.classifiers.sequences import SequenceClassifier

FloatArray = npt.NDArray[np.float64]


# scikit-learn has no types.
class NearestNeighbours(KNeighborsClassifier):  # type: ignore[misc]
    """k nearest neighbours, Euclidean.

    Parameters
    ----------
    n_neighbors : int
        Examples that vote.

    References
    ----------
    Thesis 5.2.1.
    """

    def __init__(self, n_neighbors: int = 1) -> None:
        super().__init__(n_neighbors=n_neighbors, algorithm="brute")

    def uncertainty(self, X: npt.ArrayLike) -> FloatArray:
        """Return the root mean square difference to the nearest example, shape (S,)."""
        apart, _ = self.kneighbors(X, n_neighbors=1)
        return np.asarray(apart[:, 0] / np.sqrt(self.n_features_in_))


class DtwNeighbour(SequenceClassifier):
    """Nearest neighbour under dynamic time warping.

    Parameters
    ----------
    n_channels : int
        Channels of a point.
    band_points : int
        How far warped time may run ahead or behind, in points (Sakoe-Chiba).

    References
    ----------
    Thesis 5.2.1 names it as the alternative to the Euclidean distance.
    """

    def __init__(self, n_channels: int = 1, band_points: int = 5) -> None:
        self.n_channels = n_channels
        self.band_points = band_points

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike) -> DtwNeighbour:
        """Keep the examples.

        Parameters
        ----------
        X : array, shape (N, P * n_channels)
        y : array, shape (N,)
        """
        self.examples_, self.codes_ = self._check_training(X, y)
        return self

    def predict(self, X: npt.ArrayLike) -> Any:
        """Return the class of the nearest example."""
        nearest, _ = self._nearest(X)
        return self.classes_[self.codes_[nearest]]

    def uncertainty(self, X: npt.ArrayLike) -> FloatArray:
        """Return the warped distance to the nearest example per value, shape (S,)."""
        return np.asarray(self._nearest(X)[1] / np.sqrt(self.n_features_in_))

    def _nearest(self, X: npt.ArrayLike) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Return the nearest example of each, and its distance, shape (S,)."""
        from besman.classifiers.dtw_kernel import nearest_warped

        found: tuple[npt.NDArray[np.int64], FloatArray] = nearest_warped(
            self._check_test(X), self.examples_, self.band_points
        )
        return found
