import numpy as np
import pytest

from besman.recognition.novelty import distances, fit_threshold, measure_novelty


def test_the_threshold_covers_the_classes_and_what_is_between_them():
    examples = np.array([[0.0], [1.0], [10.0], [11.0]])
    # Within a class 1 apart, between classes 9 to 10.
    assert fit_threshold(examples, tuple("aabb"), 2.0) == pytest.approx(9.5)
    assert fit_threshold(examples, tuple("aabb"), 20.0) == pytest.approx(20.0)


def test_one_example_a_class_is_judged_by_the_others():
    assert fit_threshold(np.array([[0.0], [4.0]]), tuple("ab"), 2.0) == pytest.approx(4.0)


def test_a_single_class_is_judged_by_itself():
    assert fit_threshold(np.array([[0.0], [1.0]]), tuple("aa"), 3.0) == pytest.approx(3.0)


def test_one_example_alone_knows_no_bound():
    assert fit_threshold(np.zeros((1, 3)), tuple("a"), 2.0) == np.inf


def test_distances_are_root_mean_squares():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(3, 5)), rng.normal(size=(4, 5))
    brute = np.sqrt(((a[:, None] - b) ** 2).mean(axis=2))
    np.testing.assert_allclose(distances(a, b), brute)
    np.testing.assert_allclose(measure_novelty(a, b), brute.min(axis=1))
    assert measure_novelty(np.empty((0, 5)), b).shape == (0,)
