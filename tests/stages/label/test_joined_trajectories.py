"""Trajectories of pieces, against arrays that are written to sample by sample."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.records import Recording
from besman.stages.label.joined_trajectories import (
    TrajectoryPiece,
    WovenRecording,
    is_seen,
    lay_out,
    split_path,
)

N_FRAMES, N_MARKERS = 60, 4


def make_case(seed):
    """Make pieces that lie anywhere, in any order, and the array that they are."""
    rng = np.random.default_rng(seed)
    whole, paths = np.full((N_FRAMES, N_MARKERS, 3), np.nan), []
    for column in range(N_MARKERS):
        pieces = []
        edges = np.unique(rng.integers(0, N_FRAMES + 1, size=rng.integers(0, 8))).tolist()
        for start, stop in rng.permutation(list(pairwise(edges))[::2]).reshape(-1, 2).tolist():
            samples = rng.normal(size=(stop - start, 3))
            samples[rng.random(len(samples)) < 0.2] = np.nan
            whole[start:stop, column] = samples
            pieces.append(TrajectoryPiece(start, samples))
        paths.append(tuple(pieces))
    time, nothing = np.arange(N_FRAMES) / 50, np.empty((N_FRAMES, 0, 3))
    frames = Recording(time, nothing, (), 50.0, "a.tsv", 7)
    return WovenRecording(frames, ("a", None, "b", None), paths), whole


rows = st.tuples(st.integers(0, N_FRAMES), st.integers(0, N_FRAMES)).map(sorted)


@given(
    seed=st.integers(0, 10_000),
    bounds=rows,
    step=st.integers(1, 70),
    columns=st.permutations(range(N_MARKERS)).flatmap(
        lambda order: st.integers(0, N_MARKERS).map(lambda n: order[:n])
    ),
)
@settings(max_examples=100, deadline=None)
def test_places_are_those_of_the_pieces(seed, bounds, step, columns):
    woven, whole = make_case(seed)
    start, stop = bounds
    found = woven.rows(start, stop, columns, step)
    np.testing.assert_array_equal(found, whole[start:stop:step][:, columns])
    np.testing.assert_array_equal(woven.rows(start, stop), whole[start:stop])
    np.testing.assert_array_equal(woven.gather(columns), whole[:, columns])
    seen = np.flatnonzero(np.isfinite(whole[start:stop]).any(axis=(0, 2)))
    assert set(seen) <= set(woven.columns_in(start, stop))


@given(seed=st.integers(0, 10_000), bounds=rows)
@settings(max_examples=60, deadline=None)
def test_a_trajectory_is_what_is_inside_and_what_is_outside(seed, bounds):
    woven, whole = make_case(seed)
    start, stop = bounds
    for path, places in zip(woven.paths, whole.swapaxes(0, 1), strict=True):
        inside, outside = split_path(path, start, stop)
        is_in = ((np.arange(N_FRAMES) >= start) & (np.arange(N_FRAMES) < stop))[:, None]
        np.testing.assert_array_equal(lay_out(inside, 0, N_FRAMES), np.where(is_in, places, np.nan))
        np.testing.assert_array_equal(
            lay_out(outside, 0, N_FRAMES), np.where(is_in, np.nan, places)
        )
        np.testing.assert_array_equal(lay_out(path, start, stop), places[start:stop])
        assert is_seen(path) == np.isfinite(places).any()


@pytest.mark.parametrize("columns", [(), (2, 0), (0, 1, 2, 3)])
def test_what_is_packed_is_filled_once_and_looks_the_same(columns):
    woven, whole = make_case(4)
    packed = woven.pack(columns)
    own = packed.gather_to_fill(columns)
    np.testing.assert_array_equal(own, whole[:, columns])
    own[np.isnan(own)] = 99.0
    np.testing.assert_array_equal(packed.whole().positions, whole)
    # What was filled is no start for another who fills.
    again = packed.gather_to_fill(columns)
    np.testing.assert_array_equal(again, whole[:, columns])
    assert again is not own
    assert not any(
        np.shares_memory(piece.samples, old.samples)
        for path, before in zip(packed.paths, woven.paths, strict=True)
        for piece in path
        for old in before
    )


def test_others_do_not_take_what_is_packed_for_one():
    woven, whole = make_case(4)
    packed = woven.pack((2, 0))
    other = packed.gather_to_fill((0, 2))
    other[:] = 0.0
    np.testing.assert_array_equal(packed.gather_to_fill((2, 0)), whole[:, (2, 0)])
