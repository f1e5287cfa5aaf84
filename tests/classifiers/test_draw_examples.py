import numpy as np
import pytest

from besman.classifiers.draw_examples import draw_examples
from besman.exceptions import RecognitionError

LABELS = ["b"] * 10 + ["a"] * 3 + ["c"] * 7


def test_as_many_of_each_class_as_asked_for_or_all():
    drawn = draw_examples(LABELS, 5, seed=0)
    counts = {name: sum(LABELS[k] == name for k in drawn) for name in "abc"}
    assert counts == {"a": 3, "b": 5, "c": 5}
    assert len(set(drawn)) == len(drawn)
    assert list(drawn) == sorted(drawn)


def test_the_seed_decides():
    np.testing.assert_array_equal(draw_examples(LABELS, 2, 1), draw_examples(LABELS, 2, 1))
    draws = {tuple(draw_examples(LABELS, 2, seed)) for seed in range(10)}
    assert len(draws) > 5


def test_other_classes_are_drawn_the_same_without_one():
    every = [k for k in draw_examples(LABELS, 2, 3) if LABELS[k] != "b"]
    assert list(draw_examples(LABELS, 2, 3, classes=("a", "c"))) == every


def test_a_class_without_examples_is_refused():
    with pytest.raises(RecognitionError, match="class 'thrw' has no labelled examples; did you me"):
        draw_examples(["throw", "idle"], 5, 0, classes=("thrw",))


def test_nothing_to_learn_from_is_refused():
    with pytest.raises(RecognitionError, match="no labelled segments to learn from"):
        draw_examples([], 5, 0)
