import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.stages.label.fragments import measure_pairs, split_fragments


def scattered(seed, n_frames=60, n_columns=6, share=0.2):
    rng = np.random.default_rng(seed)
    positions = rng.normal(size=(n_frames, n_columns, 3))
    positions[rng.random((n_frames, n_columns)) < share] = np.nan
    return positions


@given(seed=st.integers(0, 10_000), share=st.sampled_from((0.0, 0.1, 0.5, 0.95, 1.0)))
@settings(max_examples=30, deadline=None)
def test_fragments_are_the_unbroken_stretches(seed, share):
    positions = scattered(seed, share=share)
    fragments = split_fragments(positions, 50.0)
    rebuilt = np.full_like(positions, np.nan)
    for k in range(fragments.n_fragments):
        start, stop, column = fragments.start[k], fragments.stop[k], fragments.column[k]
        frames = np.arange(start, stop)
        rebuilt[frames, column] = fragments.position(np.full(len(frames), k), frames)
        assert start == 0 or np.isnan(positions[start - 1, column]).all()
        assert stop == len(positions) or np.isnan(positions[stop, column]).all()
    np.testing.assert_array_equal(rebuilt, positions)
    assert (np.diff(fragments.start) >= 0).all()


@pytest.mark.parametrize("seed", range(5))
def test_pairs_against_all_frames_one_by_one(seed):
    fragments = split_fragments(scattered(seed), 50.0)
    # With a stride of one frame short overlaps are measured at every frame.
    pairs = measure_pairs(fragments, stride_s=0.02)
    expected = {}
    for i in range(fragments.n_fragments):
        for j in range(fragments.n_fragments):
            frames = np.arange(
                max(fragments.start[i], fragments.start[j]),
                min(fragments.stop[i], fragments.stop[j]),
            )
            if i != j and 0 < len(frames) <= 48:
                apart = np.linalg.norm(
                    fragments.position(np.full(len(frames), i), frames)
                    - fragments.position(np.full(len(frames), j), frames),
                    axis=1,
                )
                expected[i, j] = apart.mean(), apart.var(), len(frames) / 50.0
    found = {
        (i, j): (pairs.mean[k], pairs.variance[k], pairs.overlap_s[k])
        for k, (i, j) in enumerate(zip(pairs.first.tolist(), pairs.second.tolist(), strict=True))
    }
    assert found.keys() == expected.keys()
    for key, values in expected.items():
        np.testing.assert_allclose(found[key], values, rtol=1e-9, atol=1e-12)
    for fragment in range(fragments.n_fragments):
        inside = slice(pairs.row[fragment], pairs.row[fragment + 1])
        assert (pairs.first[inside] == fragment).all()


def test_a_long_overlap_is_sampled_evenly():
    time = np.linspace(0.0, 1.0, 5001)
    positions = np.zeros((5001, 2, 3))
    positions[:, 1, 0] = 1.0 + time
    pairs = measure_pairs(split_fragments(positions, 500.0))
    np.testing.assert_allclose(pairs.mean, 1.5, atol=1e-3)
    np.testing.assert_allclose(pairs.variance, 1.0 / 12.0, rtol=1e-2)
