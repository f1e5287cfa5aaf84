from pathlib import Path

import numpy as np
import pytest

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.clock import read_rate, settle_clock, whole_if_near

PATH = Path("a.x")


def settle(frames=None, times=None, rate_hz=None):
    columns = (None if one is None else np.array(one, float) for one in (frames, times))
    return settle_clock(*columns, rate_hz, PATH, 5)


def test_rounded_times_count_a_whole_rate():
    times = np.round(np.arange(50) / 120, 4)
    assert settle(times=times).rate_hz == 120.0
    assert whole_if_near(1 / 0.0083333) == 120.0
    assert whole_if_near(59.94) == 59.94


def cut(times, digits):
    return np.trunc(times * 10.0**digits) / 10.0**digits


@pytest.mark.parametrize(
    ("rate", "digits"),
    [(30, 2), (60, 2), (240, 2), (120, 3), (1500, 3), (29.97, 6), (23.976, 6), (59.94, 4)],
)
@pytest.mark.parametrize("change", [np.round, cut])
def test_the_coarser_times_are_rounded_the_less_they_tell(rate, digits, change):
    for n_frames in (60, 500):
        times = change(3.0 + np.arange(n_frames) / rate, digits)
        found = settle(times=times)
        if rate % 1 == 0:
            assert found.rate_hz == rate
        else:
            assert found.rate_hz == pytest.approx(rate, rel=10.0**-digits)
    with pytest.raises(RecordingError, match="expected rising times"):
        settle(times=np.where(np.arange(500) == 70, 0.0, times))


def test_every_second_frame_and_those_that_are_missing():
    even = settle([0, 2, 4, 6], rate_hz=50.0)
    assert (len(even.time), even.first_frame, even.rows) == (4, 0, None)
    with pytest.warns(RecordingWarning, match="1 frames are missing .* before frame 6 in line 7"):
        gap = settle([0, 2, 6, 8], rate_hz=50.0)
    np.testing.assert_array_equal(gap.rows, [0, 1, 3, 4])
    spread = gap.spread(np.arange(8.0).reshape(4, 2))
    assert np.isnan(spread[2]).all()
    np.testing.assert_array_equal(spread[[0, 1, 3, 4]], np.arange(8.0).reshape(4, 2))


def test_uneven_times_are_said():
    with pytest.warns(
        RecordingWarning, match=r"1 times do not rise evenly, first in line 8: 0.09 s"
    ):
        assert settle(times=[0, 0.02, 0.04, 0.09, 0.11, 0.13]).rate_hz == 50.0


@pytest.mark.parametrize(
    ("text", "said"),
    [("1_000", "no number"), ("\u0663", "no number"), ("0", "0 frames"), ("1e9", r"1e\+09 frames")],
)
def test_a_rate_of_the_header_that_is_none_is_said(text, said):
    with pytest.warns(RecordingWarning, match=f"the header has {said}.*; 50, as the times show"):
        assert settle(times=[0, 0.02, 0.04], rate_hz=read_rate(text)).rate_hz == 50.0
    with pytest.raises(RecordingError, match=f"the header has {said}.*, and no times show"):
        settle(frames=[1, 2, 3], rate_hz=read_rate(text))


def test_rates_of_headers():
    assert [read_rate(text) for text in ("", " EXT", "59.94 ")] == [None, None, 59.94]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"frames": [1, 2]}, "neither the header nor a column of times"),
        ({"frames": [1, 2], "rate_hz": 0.0}, "the header has 0 frames a second, and no times show"),
        ({"frames": [1, 2], "rate_hz": -30.0}, "the header has -30 frames a second, and no times"),
        (
            {"frames": [1, 2], "rate_hz": np.nan},
            "has no number where the rate stands, and no times",
        ),
        ({"frames": [1, 9, 10], "rate_hz": 9.0}, "frame 9 follows frame 1; expected .* evenly"),
        ({"frames": [1, np.nan], "rate_hz": 9.0}, "a.x:6: frame is nan; expected a whole number"),
        ({"times": [0.1, np.nan]}, "a.x:6: time is nan s after 0.1 s; expected rising times"),
        ({"times": [np.nan, 0.1]}, "time is"),
    ],
)
def test_what_is_wrong_is_one_line(given, message):
    with pytest.raises(RecordingError, match=message):
        settle(**given)


@pytest.mark.filterwarnings("error::RuntimeWarning", "ignore::besman.exceptions.RecordingWarning")
def test_times_beyond_all_bounds_are_one_line():
    with pytest.raises(RecordingError):
        settle(times=[0.0, 0.5, 1e308])


def test_times_that_stand_still_leave_the_headers_rate():
    with pytest.warns(RecordingWarning, match="all times are 0 s, .* evenly spaced, 50 a second"):
        clock = settle_clock(np.arange(1.0, 5.0), np.zeros(4), 50.0, Path("still.trc"), 6)
    np.testing.assert_allclose(clock.time, np.arange(4) / 50)
    for rate in (None, float("nan"), 0.0):
        with pytest.raises(
            RecordingError, match=r"still\.trc:7: time is 0 s after 0 s; expected rising"
        ):
            settle_clock(np.arange(1.0, 5.0), np.zeros(4), rate, Path("still.trc"), 6)
