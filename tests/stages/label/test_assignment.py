from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.stages.label.assignment import assign_fragments
from besman.stages.label.fragments import Fragments
from besman.stages.label.scores import GHOST


def make_fragments(start, stop):
    start, stop = np.array(start), np.array(stop)
    order = np.lexsort((stop, start))
    n = stop - start
    return Fragments(
        start[order], stop[order], np.arange(len(n)), np.cumsum(n) - n,
        np.zeros((n.sum(), 3)), 1, int(stop.max()), 100.0,
    )  # fmt: skip


def worth(score, labels):
    return sum(score[k, label] for k, label in enumerate(labels) if label != GHOST)


def allowed(fragments, labels):
    for i in range(len(labels)):
        for j in range(i):
            overlap = (
                fragments.start[i] < fragments.stop[j] and fragments.start[j] < fragments.stop[i]
            )
            if overlap and labels[i] == labels[j] != GHOST:
                return False
    return True


@given(st.integers(0, 100_000))
@settings(max_examples=60, deadline=None)
def test_no_labelling_is_better(seed):
    rng = np.random.default_rng(seed)
    n_fragments, n_markers = int(rng.integers(1, 7)), int(rng.integers(1, 4))
    start = rng.integers(0, 20, n_fragments)
    fragments = make_fragments(start, start + rng.integers(1, 12, n_fragments))
    score = rng.normal(1.0, 3.0, (n_fragments, n_markers))
    labels = assign_fragments(fragments, score)
    assert allowed(fragments, labels)
    best = max(
        worth(score, candidate)
        for candidate in product(range(-1, n_markers), repeat=n_fragments)
        if allowed(fragments, candidate)
    )
    assert worth(score, labels) == pytest.approx(best, abs=1e-6)


def test_touching_fragments_may_have_one_name():
    fragments = make_fragments([0, 10], [10, 20])
    assert assign_fragments(fragments, np.array([[5.0], [5.0]])).tolist() == [0, 0]


def test_a_worthless_fragment_gets_no_name():
    fragments = make_fragments([0], [10])
    assert assign_fragments(fragments, np.array([[-1.0, 0.0]])).tolist() == [GHOST]
