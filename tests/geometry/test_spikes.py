"""Faults put into a smooth path are found again, and nothing else is."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import DATA, REAL_DATA

from besman.geometry.gaps import find_runs
from besman.geometry.spikes import LONGEST, find_faults
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording

RATE_HZ = 100.0
N = 300


@pytest.fixture
def path():
    """One marker of a hand that waves at up to 3 m/s, shape (T, 1, 3)."""
    time = np.arange(N) / RATE_HZ
    wave = np.column_stack([0.5 * np.sin(6 * time), 0.3 * np.cos(4 * time), 1 + 0.1 * time])
    return wave[:, None]


def faults(positions, joined=True):
    return find_faults(positions, RATE_HZ, np.full(positions.shape[1], joined))


@pytest.mark.parametrize("rows", [(100,), (50, 51, 52), (0,), (N - 1,), (40, 200, 201)])
def test_what_is_put_away_and_comes_back_is_a_spike(path, rows):
    path[list(rows), 0] += [2.0, -1.0, 0.5]
    found = faults(path)
    assert np.flatnonzero(found.spikes[:, 0]).tolist() == list(rows)
    assert found.jumps == ()


def test_a_moving_hand_and_a_trembling_marker_are_none(path):
    path += np.random.default_rng(0).uniform(-0.02, 0.02, path.shape)
    found = faults(path)
    assert not found.spikes.any()
    assert found.jumps == ()


def test_what_stays_away_longer_is_a_jump_out_and_one_back(path):
    path[100 : 100 + LONGEST + 5, 0] += [5.0, 0.0, 0.0]
    found = faults(path)
    assert not found.spikes.any()
    assert found.jumps == ((100, 0), (100 + LONGEST + 5, 0))


def test_a_trajectory_without_a_name_may_be_another_thing_after_a_gap(path):
    path[100:120] = np.nan
    path[120:] += [60.0, 0.0, 0.0]
    assert faults(path, joined=False).jumps == ()
    assert faults(path, joined=True).jumps == ((120, 0),)


# The same ones each time: of spikes in random directions about one in 6000 keeps a sample that lies
# as if on the way, which no rule of speed can tell.
@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    rate_hz=st.sampled_from([24.0, 30.0, 60.0, 100.0, 240.0, 500.0, 1000.0]),
    spikes=st.lists(
        st.tuples(st.integers(0, 2), st.floats(0, 1), st.integers(1, LONGEST), st.integers(0, 99)),
        max_size=4,
    ),
    size_m=st.floats(2.5, 100.0),
    together=st.booleans(),
)
def test_spikes_of_any_rate_are_found_and_nothing_else(rate_hz, spikes, size_m, together):
    """Up to four of them, of up to ten frames each, on three markers of a throwing arm."""
    n = max(80, int(2 * rate_hz))
    time = np.arange(n)[:, None] / rate_hz
    # A throw: 8 m/s within 0.15 s.
    swing = 1.2 / (1 + np.exp(-27 * (time - time[-1] / 2)))
    path = np.stack([0.5 * np.sin(3 * time + k) * [1, 0.5, 0.2] + swing for k in range(3)], axis=1)
    true = np.zeros((n, 3), dtype=bool)
    for column, share, length, seed in spikes:
        start = int(share * (n - length))
        # Some samples between two of them, or they are one that lasts longer.
        if true[max(0, start - LONGEST) : start + length + LONGEST, column].any():
            continue
        random = np.random.default_rng(seed)
        away = random.normal(size=(1 if together else length, 3))
        away *= size_m / np.linalg.norm(away, axis=1, keepdims=True)
        path[start : start + length, column] += away
        true[start : start + length, column] = True
    found = find_faults(path, rate_hz, np.ones(3, dtype=bool))
    # Of those at the ends, only what is too fast for a way without a return is told.
    inside = slice(LONGEST + 1, -LONGEST - 1)
    np.testing.assert_array_equal(found.spikes[inside], true[inside])
    assert not (found.spikes & ~true).any()


def test_what_was_recorded_has_none():
    """Neither the sample nor, where they are, any real recording, also with frames left out."""
    folders = [folder for folder in DATA.iterdir() if folder.is_dir()]
    folders += [path for path in (REAL_DATA / "pick_and_place", REAL_DATA / "c3d") if path.is_dir()]
    looked_at = 0
    for path in find_recordings(folders):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            recording = read_recording(path)
        assert not [one for one in said if "UNITS" not in str(one.message)], path
        named = np.array([name is not None for name in recording.names])
        step = 2 if recording.rate_hz >= 60 and named.all() else 1
        found = find_faults(recording.positions[::step], recording.rate_hz / step, named)
        assert not found.spikes.any(), path
        assert found.jumps == (), path
        looked_at += 1
    assert looked_at >= 11


@pytest.mark.parametrize("rate_hz", [30.0, 100.0, 1000.0])
def test_stretches_that_are_passed_over_have_no_faults(monkeypatch, rate_hz):
    rng = np.random.default_rng(5)
    positions = np.cumsum(rng.normal(scale=0.3 / rate_hz, size=(3000, 6, 3)), axis=0)
    for k in range(6):
        for at in rng.integers(0, 2990, size=12):
            positions[at : at + rng.integers(1, 12), k] += rng.choice([0.05, 0.2, 2.0])
    positions[rng.random((3000, 6)) < 0.03] = np.nan
    found = find_faults(positions, rate_hz, np.zeros(6, bool))
    assert found.spikes.any()
    assert found.jumps

    def every(path, seen, rate_hz):
        return [np.arange(start, end) for start, end in find_runs(seen)]

    monkeypatch.setattr("besman.geometry.spikes._pieces_with_steps", every)
    again = find_faults(positions, rate_hz, np.zeros(6, bool))
    np.testing.assert_array_equal(found.spikes, again.spikes)
    assert found.jumps == again.jumps
