"""What is put together by decisions, against a plain copy sample by sample."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.person.marker_set import load_marker_set
from besman.records import Recording
from besman.stages.label.fragments import split_fragments
from besman.stages.label.gather import LeftOver, NamedPaths, found_markers, gather_markers
from besman.stages.label.joined_trajectories import weave_names
from besman.stages.label.named_recording import NameDecision

MARKERS = ("hand_top", "elbow", "shoulder")


@pytest.fixture(scope="module")
def marker_set():
    return load_marker_set("right_arm")


def make_case(seed):
    rng = np.random.default_rng(seed)
    positions = rng.normal(size=(80, 5, 3))
    positions[rng.random((80, 5)) < rng.choice([0.02, 0.2, 0.9])] = np.nan
    names = ("toy", None, None, None, "thing")
    recording = Recording(np.arange(80) / 50, positions, names, 50.0, "a.tsv", 3)
    fragments = split_fragments(positions, 50.0)
    decisions = tuple(
        NameDecision(int(column), int(start), int(stop), marker, 0.9, bool(marker) and named)
        for column, start, stop, marker, named in zip(
            fragments.column,
            fragments.start,
            fragments.stop,
            rng.choice(["", *MARKERS], fragments.n_fragments).tolist(),
            rng.random(fragments.n_fragments) < 0.7,
            strict=True,
        )
    )
    return recording, decisions


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_every_sample_is_where_its_decision_puts_it(marker_set, seed):
    recording, decisions = make_case(seed)
    markers = found_markers(decisions, marker_set)
    assert set(markers) == {one.marker for one in decisions if one.named}
    named, rest = np.full((80, len(markers), 3), np.nan), recording.positions.copy()
    for one in decisions:
        for row in range(one.start, one.stop):
            if one.named:
                named[row, markers.index(one.marker)] = recording.positions[row, one.trajectory]
                rest[row, one.trajectory] = np.nan
    kept = [k for k in range(5) if np.isfinite(rest[:, k]).any()]
    woven, places = weave_names(recording, decisions, markers)
    whole, names = woven.whole(), woven.names
    expected = np.concatenate((named, rest[:, kept]), axis=1)
    np.testing.assert_array_equal(whole.positions, expected)
    assert whole.names == names == (*markers, *(recording.names[k] for k in kept))
    assert places == {column: len(markers) + k for k, column in enumerate(kept)}
    packed = woven.pack(tuple(range(len(markers))))
    np.testing.assert_array_equal(packed.whole().positions, expected)
    np.testing.assert_array_equal(gather_markers(recording, decisions, markers), named)
    paths = NamedPaths(recording, decisions, markers)
    assert tuple(paths) == markers
    for k, marker in enumerate(markers):
        np.testing.assert_array_equal(paths[marker], named[:, k])
    left = LeftOver(recording, decisions)
    assert (left.columns, left.names) == (tuple(kept), names[len(markers) :])
    for start, stop in ((0, 80), (0, 1), (13, 60), (79, 80)):
        np.testing.assert_array_equal(left.rows(start, stop), rest[start:stop][:, kept])


def test_markers_are_in_the_order_of_the_set(marker_set):
    decisions = [NameDecision(0, 0, 1, name, 1.0, name != "elbow") for name in MARKERS]
    found = found_markers(decisions, marker_set)
    assert found == tuple(m for m in marker_set.markers if m in ("hand_top", "shoulder"))
