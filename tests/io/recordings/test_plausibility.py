"""What every recording is held against once it is read."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.plausibility import check_rate, check_recording
from besman.records import Recording

PATH = Path("a.tsv")


def recording(positions=None, names=("Hand", None), first_frame=1, rate_hz=100.0, n=40):
    if positions is None:
        time = np.arange(n)[:, None, None] / rate_hz
        positions = np.sin(time + np.arange(6).reshape(2, 3))
    return Recording(
        np.arange(len(positions)) / rate_hz, positions, names, rate_hz, "a.tsv", first_frame
    )


def test_what_makes_sense_stays_as_it_is():
    one = recording()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert check_recording(one, PATH) is one


def test_a_sample_that_no_body_makes_becomes_a_gap_and_is_named():
    positions = recording().positions.copy()
    positions[20, 0] += 3.0
    positions[30:32, 1] -= 3.0
    with pytest.warns(RecordingWarning) as said:
        checked = check_recording(recording(positions), PATH)
    assert [str(one.message) for one in said] == [
        "a.tsv: 3 samples that no body makes became gaps: 'Hand' frame 21, "
        "trajectory 2 frames 31 to 32"
    ]
    gone = np.isnan(checked.positions).any(axis=2)
    assert np.argwhere(gone).tolist() == [[20, 0], [30, 1], [31, 1]]
    np.testing.assert_array_equal(checked.positions[~gone], positions[~gone])


def test_a_step_that_is_not_taken_back_is_named():
    positions = recording().positions.copy()
    positions[20:, 0] += 9.0
    with pytest.warns(RecordingWarning, match=r"1 step faster than .* 'Hand' at frame 21; two th"):
        checked = check_recording(recording(positions), PATH)
    np.testing.assert_array_equal(checked.positions, positions)


@pytest.mark.parametrize(
    ("one", "message"),
    [
        (lambda: recording(n=1), "a recording of one frame; expected at least two"),
        (lambda: recording(names=("a\x1b", None)), r"trajectory 1: name .* U\+001B"),
        (lambda: recording(names=("a", "a")), "2 trajectories are named 'a'; expected each name"),
        (lambda: recording(first_frame=-1), "frames -1 to 38; expected 0 to"),
        (lambda: recording(1000.0 + recording().positions), "half of all coordinates are beyond"),
        (lambda: recording(rate_hz=0.001), "0.001 frames a second; expected"),
    ],
)
def test_what_no_camera_delivers_is_refused(one, message):
    with pytest.raises(RecordingError, match=message):
        check_recording(one(), PATH)


def test_what_has_an_empty_name_has_none():
    assert check_recording(recording(names=("", "Hand")), PATH).names == (None, "Hand")
    assert check_recording(recording(names=(" ", "")), PATH).names == (None, None)


def test_the_name_of_the_file_is_one_too():
    with pytest.raises(RecordingError, match="the name of the file has the control character"):
        check_recording(recording(), Path("a\x1b.tsv"))


def test_a_rate_is_named_with_its_place():
    check_rate(100.0, "x")
    with pytest.raises(RecordingError, match=r"x\.yaml:3: 1e\+09 frames a second"):
        check_rate(1e9, "x.yaml:3")
