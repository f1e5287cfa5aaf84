"""What the classifiers of sequences have in common."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from besman.exceptions import RecognitionError, why_not_there

FloatArray = npt.NDArray[np.float64]


def import_extra(name: str, method: str, requirement: str) -> Any:
    """Import a library that only one method needs.

    Raises
    ------
    RecognitionError
        If it is not installed, or cannot be loaded.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        why = why_not_there(error, name.split(".")[0], requirement)
        raise RecognitionError(f"method {method}: {why}") from None


# scikit-learn has no types.
class SequenceClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """A classifier of sequences under scikit-learn's interface.

    A row of ``X`` is one sequence: all channels of its first point, then of its second, and so on.
    Subclasses have the parameter ``n_channels``.

    Attributes
    ----------
    classes_ : array
        Known classes, sorted.
    n_features_in_ : int
        Points times channels.
    """

    n_channels: int

    def _check_training(self, X: npt.ArrayLike, y: npt.ArrayLike) -> tuple[FloatArray, Any]:
        """Return sequences, shape (N, P, C), and the row in `classes_` of each label."""
        values, labels = validate_data(self, X, y, dtype=np.float64)
        check_classification_targets(labels)
        self.classes_, codes = np.unique(labels, return_inverse=True)
        return self._shape(values), codes

    def _check_test(self, X: npt.ArrayLike) -> FloatArray:
        """Return sequences, shape (S, P, C)."""
        check_is_fitted(self)
        return self._shape(validate_data(self, X, dtype=np.float64, reset=False))

    def _shape(self, values: FloatArray) -> FloatArray:
        if values.shape[1] % self.n_channels:
            raise ValueError(
                f"got {values.shape[1]} values a sequence, expected a multiple of "
                f"n_channels={self.n_channels}"
            )
        return values.reshape(len(values), -1, self.n_channels)


class ProbabilisticClassifier(SequenceClassifier):
    """A classifier of sequences whose `parameters_` are arrays.

    Attributes
    ----------
    parameters_ : dict of array
        All that was learnt besides `classes_`.
    """

    def restore(
        self, classes: tuple[str, ...], parameters: dict[str, Any], n_features: int
    ) -> ProbabilisticClassifier:
        """Take what another one learnt."""
        self.classes_ = np.array(classes)
        self.parameters_ = dict(parameters)
        self.n_features_in_ = n_features
        return self

    def predict_proba(self, X: npt.ArrayLike) -> FloatArray:
        """Return the probability of each class, shape (S, K), in the order of ``classes_``."""
        raise NotImplementedError

    def predict(self, X: npt.ArrayLike) -> Any:
        """Return the most probable class of each sequence."""
        probabilities = self.predict_proba(X)
        return self.classes_[probabilities.argmax(axis=1)]

    def uncertainty(self, X: npt.ArrayLike) -> FloatArray:
        """Return one minus the probability of the class predicted, shape (S,)."""
        return np.asarray(1.0 - self.predict_proba(X).max(axis=1))
