import numpy as np
import pytest
from scipy.spatial.distance import cdist

from besman.classifiers import novelty
from besman.classifiers.novelty import fit_threshold, measure_novelty, rms_distances


def test_the_threshold_lies_between_what_is_known_and_what_is_outside():
    examples = np.array([[0.0], [1.0], [10.0], [11.0]])
    # Left out, an example is 1 from the next; a class is 9 to 10 from the others.
    expected = 1.0**0.3 * 9.0**0.7
    assert fit_threshold(examples, tuple("aabb")) == pytest.approx(expected)
    assert fit_threshold(examples, tuple("aabb"), 2.0) == pytest.approx(2 * expected)


def test_where_classes_overlap_the_known_are_kept():
    rejected = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        examples, new = rng.normal(size=(40, 3)), rng.normal(size=(200, 3))
        threshold = fit_threshold(examples, tuple("ab" * 20))
        rejected.append(np.mean(measure_novelty(new, examples) > threshold))
    assert np.mean(rejected) < 0.1


def test_classes_that_were_left_out_are_found():
    rng = np.random.default_rng(1)
    centres = 4.0 * np.eye(5)

    def draw(n):
        return np.concatenate([c + rng.normal(scale=0.5, size=(n, 5)) for c in centres])

    for left_out in range(5):
        examples, new = draw(5), draw(50)
        labels, is_new = np.repeat(np.arange(5), 5), np.repeat(np.arange(5), 50) == left_out
        learn = labels != left_out
        threshold = fit_threshold(examples[learn], [str(k) for k in labels[learn]])
        rejected = measure_novelty(new, examples[learn]) > threshold
        assert rejected[is_new].mean() > 0.95
        assert rejected[~is_new].mean() < 0.05


def test_one_example_a_class_is_judged_by_the_others():
    assert fit_threshold(np.array([[0.0], [4.0]]), tuple("ab")) == pytest.approx(4.0)


def test_a_single_class_is_judged_by_itself():
    assert fit_threshold(np.array([[0.0], [1.0]]), tuple("aa"), 3.0) == pytest.approx(6.0)


def test_examples_that_are_all_alike_leave_room():
    examples = np.array([[0.0], [0.0], [8.0], [8.0]])
    assert 0.0 < fit_threshold(examples, tuple("aabb")) < 8.0


def test_one_example_alone_knows_no_bound():
    assert fit_threshold(np.zeros((1, 3)), tuple("a")) == np.inf


def test_distances_are_root_mean_squares():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(3, 5)), rng.normal(size=(4, 5))
    brute = np.sqrt(((a[:, None] - b) ** 2).mean(axis=2))
    np.testing.assert_allclose(rms_distances(a, b), brute)
    np.testing.assert_allclose(measure_novelty(a, b), brute.min(axis=1))
    assert measure_novelty(np.empty((0, 5)), b).shape == (0,)


@pytest.mark.parametrize("many", [100_000, 10])
def test_distances_are_those_of_scipy_to_the_last_digit(many, monkeypatch):
    monkeypatch.setattr(novelty, "_MANY", many)
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(17, 23)), rng.normal(size=(40, 23), scale=1e3)
    np.testing.assert_array_equal(rms_distances(a, b), cdist(a, b) / np.sqrt(23))
