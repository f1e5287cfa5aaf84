"""One bad sample moves no border but its own."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from places import SAMPLE

from besman.exceptions import RecordingWarning
from besman.io.recordings.formats import read_recording, write_recording
from besman.standalone.segment_files import segment_files

N = 700


def borders_of(recording, folder):
    path = folder / "throw.tsv"
    write_recording(recording, path)
    (found,) = segment_files([path], "valley_vmci", "right_arm", None)
    return np.array(found["borders_s"])


@pytest.fixture(scope="module")
def throw():
    """One stick throw."""
    whole = read_recording(SAMPLE / "subject1.tsv")
    return replace(whole, time=whole.time[:N], positions=whole.positions[:N])


@pytest.fixture(scope="module")
def clean(throw, tmp_path_factory):
    return borders_of(throw, tmp_path_factory.mktemp("clean"))


def test_a_hundred_metres_at_frame_400_move_nothing(throw, clean, tmp_path):
    positions = throw.positions.copy()
    positions[399, throw.names.index("Hand top"), 0] = 99.999
    message = "1 sample that no body makes became a gap: 'Hand top' frame 400"
    with pytest.warns(RecordingWarning, match=message):
        found = borders_of(replace(throw, positions=positions), tmp_path)
    np.testing.assert_array_equal(found, clean)
    np.testing.assert_allclose(clean, [0, 2, 2.97, 3.55, 4.33, 6.35, 7], atol=0.005)


@settings(max_examples=25, deadline=None)
@example(spikes=[(5, 690, 10, 0.0)], seed=0, together=True)
@example(spikes=[(5, 690, 10, 0.0)], seed=2, together=False)
@example(spikes=[(5, 0, 1, 0.0)], seed=0, together=False)
@example(spikes=[(5, 0, 3, 0.0)], seed=0, together=False)
@given(
    spikes=st.lists(
        st.tuples(st.integers(0, 8), st.integers(0, N - 10), st.integers(1, 10), st.floats(0, 2)),
        min_size=1,
        max_size=3,
    ),
    seed=st.integers(0, 2**16),
    together=st.booleans(),
)
def test_spikes_anywhere_move_no_border(throw, clean, tmp_path_factory, spikes, seed, together):
    """On up to three markers, 1 to 10 frames each, 1 to 100 m, in one direction or in many."""
    positions, random = throw.positions.copy(), np.random.default_rng(seed)
    for column, start, length, power in spikes:
        away = random.normal(size=(1 if together else length, 3))
        away *= 10**power / np.linalg.norm(away, axis=1, keepdims=True)
        positions[start : start + length, column] += away
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RecordingWarning)
        found = borders_of(replace(throw, positions=positions), tmp_path_factory.mktemp("spikes"))
    assert len(found) == len(clean)
    np.testing.assert_allclose(found, clean, atol=0.02 + 1e-9)
