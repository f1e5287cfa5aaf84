import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from besman.classifiers.block_order import BlockOrder
from besman.exceptions import RecognitionError

LABELS = ("a", "b", "c")


def plain(sequences, before, longest, labels=LABELS):
    """The equation, written as the recursion that it is."""

    def follow(context):
        padded = [("", *sequence) for sequence in sequences]
        return [
            one[k]
            for one in padded
            for k in range(1, len(one))
            if one[max(0, k - len(context)) : k] == context
        ]

    def p(label, context):
        lower = 1 / len(labels) if not context else p(label, context[1:])
        after = follow(context)
        n, t = len(after), len(set(after))
        return (after.count(label) + t * lower) / (n + t) if n else lower

    context = ("", *before)[-longest:] if longest else ()
    while context and not follow(context):
        context = context[1:]
    return np.array([p(label, context) for label in labels])


@given(
    st.lists(st.lists(st.sampled_from(LABELS), min_size=1, max_size=6), min_size=1, max_size=4),
    st.lists(st.sampled_from(LABELS), max_size=4),
    st.integers(0, 3),
)
def test_probabilities_are_those_of_the_equation(sequences, before, longest):
    found = BlockOrder(sequences, LABELS, longest).probabilities(before)
    np.testing.assert_allclose(found, plain(sequences, before, longest), atol=1e-12)
    assert found.sum() == pytest.approx(1)


def test_what_follows_two_labels_is_told_from_what_follows_one():
    order = BlockOrder([["a", "b", "c", "b"] * 8])
    assert LABELS[order.probabilities(["a", "b"]).argmax()] == "c"
    assert LABELS[order.probabilities(["c", "b"]).argmax()] == "a"


def test_the_frequencies_of_a_source_are_found():
    rng = np.random.default_rng(0)
    true = {"a": (0.1, 0.6, 0.3), "b": (0.5, 0.0, 0.5), "c": (0.8, 0.2, 0.0)}
    sequence = ["a"]
    for _ in range(3000):
        sequence.append(str(rng.choice(LABELS, p=true[sequence[-1]])))
    order = BlockOrder([sequence], longest_context=1)
    for label, share in true.items():
        np.testing.assert_allclose(order.probabilities([label]), share, atol=0.05)


def test_a_label_may_be_context_alone():
    order = BlockOrder([["a", "?", "b"]], ("a", "b"))
    assert order.labels == ("a", "b")
    assert order.probabilities(["a", "?"])[1] > 0.7


@pytest.mark.parametrize(("labels", "longest"), [((), 1), (("a",), -1)])
def test_nothing_to_foresee_is_refused(labels, longest):
    with pytest.raises(RecognitionError, match="expected one label or more, and a context of 0"):
        BlockOrder([["a"]], labels, longest)
