"""Faults put into a smooth path are found again, and nothing else is."""

import numpy as np
import pytest

from besman.geometry.spikes import LONGEST, find_faults

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
