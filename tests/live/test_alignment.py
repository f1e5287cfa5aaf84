"""Frames out of packets that were lost, late, doubled or begun anew."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import ConfigError
from besman.live.alignment import Aligner
from besman.live.playing import schedule_frames
from besman.live.stream import Packet

RATE_HZ = 100.0


def place(row):
    return np.full((2, 3), float(row))


def packet(row, at_s=None, counted=True, time_s=None):
    at_s = row / RATE_HZ if at_s is None else at_s
    time_s = row / RATE_HZ if time_s is None else time_s
    return Packet(time_s, place(row), at_s, row if counted else None)


def deliver(packets, **options):
    """Return what an aligner makes of packets: the row of each frame, None for a gap."""
    aligner = Aligner(RATE_HZ, 2, **options)
    frames = [frame for one in packets for frame in aligner.take(one)]
    frames += aligner.flush()
    rows = [None if np.isnan(one.positions).all() else one.positions[0, 0] for one in frames]
    return rows, aligner.delivery


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_what_overtakes_within_the_patience_comes_out_in_order(seed, counted):
    draw = np.random.default_rng(seed)
    late_s = np.where(draw.random(60) < 0.3, draw.uniform(0, 0.05, 60), 0.0)
    late_s[0] = 0
    order = np.argsort(np.arange(60) / RATE_HZ + late_s, kind="stable")
    packets = [packet(row, row / RATE_HZ + late_s[row], counted) for row in order]
    rows, delivery = deliver(packets)
    assert rows == list(range(60))
    assert (delivery.lost, delivery.late, delivery.doubled, delivery.restarts) == (0, 0, 0, 0)


def test_what_is_lost_is_a_gap_and_later_ones_wait_no_longer_than_asked():
    aligner = Aligner(RATE_HZ, 2, patience_s=0.035)
    taken = {row: aligner.take(packet(row)) for row in (0, 1, 3, 4, 5, 6, 7, 8)}
    counts = {row: len(frames) for row, frames in taken.items()}
    # Row 3 waited from 0.03 s on; at 0.07 s that is longer than the patience.
    assert counts == {0: 1, 1: 1, 3: 0, 4: 0, 5: 0, 6: 0, 7: 6, 8: 1}
    assert np.isnan(taken[7][0].positions).all()
    assert aligner.delivery.lost == 1
    assert aligner.take(packet(2, 0.09)) == []
    assert aligner.delivery.late == 1


def test_time_alone_lets_what_is_missing_be_given_up():
    aligner = Aligner(RATE_HZ, 2)
    aligner.take(packet(0))
    assert aligner.take(packet(2, 0.02)) == []
    assert aligner.waits
    assert aligner.release(0.07) == []
    assert len(aligner.release(0.09)) == 2
    assert not aligner.waits


def test_doubled_packets_count_once():
    rows, delivery = deliver([packet(row) for row in (0, 1, 1, 2, 2, 3, 1)])
    assert rows == [0, 1, 2, 3]
    assert delivery.doubled == 3


@pytest.mark.parametrize("counted", [True, False])
def test_a_source_that_begins_anew_goes_on_after_a_gap(counted):
    before = [packet(row, counted=counted) for row in range(200)]
    # It was away for half a second, and counts from the start.
    after = [packet(row, 2.49 + row / RATE_HZ, counted) for row in range(100)]
    rows, delivery = deliver(before + after)
    assert rows == [*range(200), *[None] * 49, *range(100)]
    assert (delivery.restarts, delivery.lost) == (1, 49)


def test_a_source_that_begins_anew_at_once_is_noticed_too():
    before = [packet(row) for row in range(20)]
    after = [packet(row, 0.2 + row / RATE_HZ) for row in range(50)]
    rows, delivery = deliver(before + after)
    assert delivery.restarts == 1
    assert rows[-40:] == list(range(10, 50))


def test_a_long_silence_is_cut():
    late = [packet(row, row / RATE_HZ) for row in range(100_000, 100_010)]
    rows, delivery = deliver([packet(0), *late], longest_s=2.0)
    assert rows == [0, *[None] * 200, *range(100_000, 100_010)]
    assert delivery.left_out_s == pytest.approx((99_999 - 200) / RATE_HZ)


def test_a_clock_that_drifts_and_shakes_is_followed():
    draw = np.random.default_rng(5)
    n = 5000
    # 300 parts in a million fast: after 50 s more than a frame; shaken by up to 4 ms.
    times = np.arange(n) / RATE_HZ * 1.0003 + np.clip(draw.normal(0, 0.002, n), -0.004, 0.004)
    rows, delivery = deliver([packet(k, times[k], False, times[k]) for k in range(n)])
    assert rows == list(range(n))
    assert delivery.lost == delivery.doubled == 0


def test_a_schedule_loses_and_delays_as_asked():
    times, rows = schedule_frames(20_000, RATE_HZ, 2.0, 0.01, 0.05, seed=1)
    assert np.all(np.diff(times) >= 0)
    assert 1 - len(rows) / 20_000 == pytest.approx(0.01, abs=0.003)
    late_s = times - rows / (2 * RATE_HZ)
    assert late_s.max() <= 0.05
    assert np.mean(late_s > 1e-9) == pytest.approx(0.05, abs=0.01)
    assert np.any(np.diff(rows) < 0)
    with pytest.raises(
        ConfigError, match="got --pace 1, --lose 1, --late 0; expected a pace above 0 and up to"
    ):
        schedule_frames(10, RATE_HZ, lose=1.0)


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e300, -1e308])
@pytest.mark.parametrize("at", [0, 3])
def test_a_clock_that_says_nothing_moves_nothing(odd, at):
    packets = [packet(row, counted=False) for row in range(8)]
    packets[at] = packets[at]._replace(time_s=odd)
    rows, delivery = deliver(packets)
    assert rows == list(range(8))
    assert (delivery.lost, delivery.restarts) == (0, 0)


def test_what_is_given_up_at_the_end_came_no_later_than_the_last():
    aligner = Aligner(RATE_HZ, 2)
    frames = [frame for row in (0, 1, 3) for frame in aligner.take(packet(row))]
    frames += aligner.flush()
    assert [frame.arrived_s for frame in frames] == [0.0, 0.01, 0.03, 0.03]


CLOCKS = st.one_of(
    st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -1e13]),
    st.floats(-20.0, 20.0),
    st.integers(0, 60).map(lambda row: row / RATE_HZ),
)


@settings(max_examples=60, deadline=None)
@given(st.lists(CLOCKS, min_size=1, max_size=60))
def test_whatever_a_clock_says_frames_come_in_time(times):
    aligner = Aligner(RATE_HZ, 2, longest_s=0.5)
    packets = [Packet(time_s, place(row), row / RATE_HZ, None) for row, time_s in enumerate(times)]
    frames = [frame for one in packets for frame in aligner.take(one)] + aligner.flush()
    seen = [frame.positions[0, 0] for frame in frames if np.isfinite(frame.positions).all()]
    told = aligner.delivery
    assert len(seen) + told.late + told.doubled == told.packets == len(times)
    assert np.isfinite([frame.arrived_s for frame in frames]).all()
    assert len(frames) - len(seen) <= 51 * len(times)


def test_a_source_that_stops_counting_and_then_says_no_time():
    told = [(0.32, 16), (0.34, None), (0.36, None), (0.38, None), (np.nan, None), (1.38, None)]
    aligner = Aligner(50.0, 2)
    for row, (time_s, number) in enumerate(told):
        aligner.take(Packet(time_s, place(row), row / 1000, number))
    aligner.flush()
    assert aligner.delivery.packets == len(told)
    assert aligner.delivery.restarts == 1
