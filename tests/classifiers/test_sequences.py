import sys

import numpy as np
import pytest

from besman.classifiers.sequences import ProbabilisticClassifier, import_extra
from besman.exceptions import RecognitionError


class Means(ProbabilisticClassifier):
    """Looks at the mean of the first channel alone: below zero or above."""

    def __init__(self, n_channels=1):
        self.n_channels = n_channels

    def fit(self, X, y):
        sequences, codes = self._check_training(X, y)
        means = [sequences[codes == k, :, 0].mean() for k in range(len(self.classes_))]
        self.parameters_ = {"means": np.array(means)}
        return self

    def predict_proba(self, X):
        apart = np.abs(
            self._check_test(X)[:, :, 0].mean(axis=1)[:, None] - self.parameters_["means"]
        )
        return np.exp(-apart) / np.exp(-apart).sum(axis=1, keepdims=True)


@pytest.fixture
def taught():
    rows = np.array([[-1.0, 9, -1, 9], [-2, 7, -2, 7], [1, 9, 1, 9], [3, 7, 3, 7]])
    return Means(n_channels=2).fit(rows, ["low", "low", "high", "high"])


def test_channels_of_a_point_stand_side_by_side(taught):
    assert taught.classes_.tolist() == ["high", "low"]
    np.testing.assert_allclose(taught.parameters_["means"], [2.0, -1.5])


def test_the_most_probable_class_and_how_unsure_it_is(taught):
    rows = [[2.0, 0, 2, 0], [-9, 0, -9, 0]]
    assert taught.predict(rows).tolist() == ["high", "low"]
    np.testing.assert_allclose(taught.uncertainty(rows), 1 - taught.predict_proba(rows).max(axis=1))


def test_what_another_one_learnt_predicts_the_same(taught):
    rows = [[0.3, 0, 0.3, 0]]
    other = Means(n_channels=2).restore(("high", "low"), taught.parameters_, 4)
    np.testing.assert_array_equal(other.predict_proba(rows), taught.predict_proba(rows))


def test_sequences_that_do_not_fit_are_refused(taught):
    with pytest.raises(ValueError, match="got 3 values a sequence, expected a multiple of n_chann"):
        Means(n_channels=2).fit([[1.0, 2.0, 3.0]], ["a"])
    with pytest.raises(ValueError, match="X has 2 features, but Means is expecting 4"):
        taught.predict([[1.0, 2.0]])


def test_a_library_that_is_missing_is_named_with_its_extra(monkeypatch):
    assert import_extra("json", "any", "any").loads("1") == 1
    monkeypatch.setitem(sys.modules, "tslearn.metrics", None)
    with pytest.raises(
        RecognitionError,
        match=r"method dtw: tslearn is not installed; pip install 'besman\[sequences\]'",
    ):
        import_extra("tslearn.metrics", "dtw", "besman[sequences]")
