"""Distances of fragments: the way for few pairs, the compiled one and the plain one agree."""

import numpy as np
import pytest

from besman.stages.label import pair_distances
from besman.stages.label.fragments import measure_pairs, split_fragments
from besman.stages.label.pair_distances import average_distances, compile_average


def make_pairs(seed, n_frames=400):
    """Return the arguments for all pairs of fragments of random trajectories."""
    rng = np.random.default_rng(seed)
    positions = np.cumsum(rng.normal(scale=0.01, size=(n_frames, 7, 3)), axis=0)
    positions[rng.random((n_frames, 7)) < 0.03] = np.nan
    fragments = split_fragments(positions, 100.0)
    first, second = np.triu_indices(fragments.n_fragments, 1)
    start = np.maximum(fragments.start[first], fragments.start[second])
    together = start < np.minimum(fragments.stop[first], fragments.stop[second])
    places = (fragments.start, fragments.stop, fragments.offset, fragments.samples, fragments.step)
    return (first[together], second[together], *places, 5), fragments


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_few_pairs_get_the_bits_that_compiled_code_gives(seed, monkeypatch):
    arguments, _ = make_pairs(seed)
    # Some pairs at a time, the last of which are fewer.
    monkeypatch.setattr(pair_distances, "_PAIRS_AT_ONCE", 7)
    by_rows = average_distances(*arguments)
    for got, expected in zip(by_rows, compile_average()(*arguments), strict=True):
        np.testing.assert_array_equal(got, expected)
    # Python's own root is a power, which may round the other way.
    for got, expected in zip(by_rows, pair_distances._average_plain(*arguments), strict=True):
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-15)


def test_mean_and_variance_are_those_of_the_common_frames():
    arguments, fragments = make_pairs(3)
    # Of up to 48 frames every one is looked at.
    mean, variance = average_distances(*arguments[:-1], 1)
    for k, (i, j) in enumerate(zip(*arguments[:2], strict=True)):
        frames = np.arange(
            max(fragments.start[i], fragments.start[j]), min(fragments.stop[i], fragments.stop[j])
        )
        if len(frames) > 48:
            continue
        places = [fragments.position(np.full(len(frames), one), frames) for one in (i, j)]
        apart = np.linalg.norm(places[0] - places[1], axis=1)
        assert mean[k] == pytest.approx(apart.mean(), abs=1e-12)
        assert variance[k] == pytest.approx(apart.var(), abs=1e-12)


def test_many_pairs_are_compiled_with_the_same_result(monkeypatch):
    _, fragments = make_pairs(4)
    few = measure_pairs(fragments)
    monkeypatch.setattr(pair_distances, "_FEW_PAIRS", 0)
    monkeypatch.setattr(pair_distances, "_average_by_rows", None)
    many = measure_pairs(fragments)
    for name in ("first", "second", "row", "mean", "variance", "overlap_s"):
        np.testing.assert_array_equal(getattr(few, name), getattr(many, name))


def test_no_pair_is_no_distance():
    none = np.empty(0, dtype=np.int64)
    mean, variance = average_distances(none, none, none, none, none, np.empty((0, 3)), 1, 1)
    assert mean.shape == variance.shape == (0,)
