"""Samples of a stream that no body makes are gaps, what stays where it jumped to is there."""

import numpy as np
import pytest

from besman.following.impossible_samples import SampleGate
from besman.geometry.spikes import LONGEST

RATE_HZ = 100.0


def passed(path, names=("hand",)):
    """Return which samples of a path (T, 3) are followed and recorded, and what was said."""
    gate = SampleGate(names, RATE_HZ)
    with np.errstate(all="raise"):
        pairs = [gate.take(one[None]) for one in np.asarray(path, float)]
    recorded, followed = (np.isfinite(np.array(one)[:, 0]).all(axis=1) for one in zip(*pairs))  # noqa: B905
    return followed.tolist(), recorded.tolist(), gate


def way(n=60):
    """A hand that goes to and fro at up to 6 m/s."""
    return np.column_stack([np.sin(6 * np.arange(n) / RATE_HZ), np.zeros(n), np.ones(n)])


def test_what_a_hand_does_passes():
    followed, recorded, gate = passed(way())
    assert all(followed)
    assert all(recorded)
    assert (gate.hidden, gate.first) == (0, "")


@pytest.mark.parametrize("length", [1, 3, LONGEST])
def test_a_spike_is_a_gap_that_is_recorded_as_it_came(length):
    path = way()
    path[20 : 20 + length] += 99.0
    followed, recorded, gate = passed(path)
    assert [row for row, one in enumerate(followed) if not one] == list(range(20, 20 + length))
    assert all(recorded)
    assert gate.hidden == length
    assert gate.first.startswith("'hand' in frame 21 is faster than anything")


@pytest.mark.parametrize("before", [0, 5])
def test_what_stays_where_it_jumped_to_is_there(before):
    path = way()
    path[10 : 10 + before] += 50.0
    path[30:] += 99.0
    followed, _, _ = passed(path)
    gone = [*range(10, 10 + before), *range(30, 30 + LONGEST)]
    assert [row for row, one in enumerate(followed) if not one] == gone


@pytest.mark.parametrize("odd", [np.inf, -np.inf, 1e300, 1001.0])
def test_what_is_no_place_is_not_recorded_either(odd):
    path = way()
    path[20, 1] = odd
    followed, recorded, gate = passed(path, (None,))
    assert [row for row, one in enumerate(recorded) if not one] == [20]
    assert followed == recorded
    assert gate.first == "trajectory 1 in frame 21 is no place: such samples are gaps"


def test_a_sample_without_a_coordinate_is_a_gap():
    path = way()
    path[20, 1] = np.nan
    path[25] = np.nan
    followed, recorded, gate = passed(path)
    assert [row for row, one in enumerate(followed) if not one] == [20, 25]
    assert followed == recorded
    # What was not seen is nothing to say.
    assert gate.hidden == 1
