import numpy as np
import pytest
from sklearn.neighbors import KNeighborsClassifier

from besman.classifiers.nearest_neighbour import classify, fit_scale, fit_spread, scale
from besman.exceptions import RecognitionError


def test_labels_and_distances_are_those_of_a_second_library():
    rng = np.random.default_rng(0)
    examples, vectors = rng.normal(size=(20, 12)), rng.normal(size=(50, 12))
    labels = [f"class{k % 4}" for k in range(20)]
    found, distances = classify(vectors, examples, labels)
    second = KNeighborsClassifier(1, algorithm="brute").fit(examples, labels)
    assert found == tuple(second.predict(vectors))
    np.testing.assert_allclose(distances * np.sqrt(12), second.kneighbors(vectors)[0][:, 0])


def test_an_example_is_its_own_neighbour():
    examples = np.eye(3)
    labels, distances = classify(examples, examples, ["a", "b", "a"])
    assert labels == ("a", "b", "a")
    np.testing.assert_array_equal(distances, 0)


def test_no_segments_get_no_labels():
    labels, distances = classify(np.empty((0, 3)), np.eye(3), ["a", "b", "c"])
    assert labels == ()
    assert distances.shape == (0,)


def test_features_that_are_not_numbers_are_refused():
    vectors = np.zeros((4, 3))
    vectors[2, 1] = np.nan
    with pytest.raises(RecognitionError, match="features of segment 2 must be finite"):
        classify(vectors, np.eye(3), ["a", "b", "c"])


def test_scale_takes_every_feature_to_zero_and_one():
    values = np.random.default_rng(1).normal(size=(5, 25, 4)) * [1, 10, 0, 3] + [0, 5, 7, -2]
    low, span = fit_scale(values, (2, 1, 1))
    out = scale(values, low, span).reshape(5, 25, 4)
    np.testing.assert_allclose(out.min(axis=(0, 1)), 0, atol=1e-12)
    np.testing.assert_allclose(out.max(axis=(0, 1))[1:], [1, 0, 1])
    assert span[0] == span[1]
    assert span[2] == 1


def test_every_feature_has_the_same_spread():
    values = np.random.default_rng(1).normal(size=(5, 25, 4)) * [1, 10, 0, 3] + [0, 5, 7, -2]
    out = scale(values, *fit_spread(values, (2, 1, 1))).reshape(5, 25, 4)
    np.testing.assert_allclose(out.mean(axis=(0, 1)), 0, atol=1e-12)
    variance = (out**2).mean(axis=(0, 1))
    np.testing.assert_allclose([variance[:2].sum(), variance[2], variance[3]], [1, 0, 1])
