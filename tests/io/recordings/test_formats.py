import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import DATA

from besman.exceptions import RecordingError
from besman.io.recordings.c3d import write_c3d
from besman.io.recordings.formats import read_recording, write_recording
from besman.records import LabelledRecording, Recording


def test_read_recording_of_the_sample():
    sample = DATA / "stick_throw" / "subject1.tsv"
    assert "Stick" in read_recording(sample).names


def sample_recording(n_samples=10, positions=None):
    if positions is None:
        positions = 0.03 * np.random.default_rng(0).normal(size=(n_samples, 2, 3))
    return Recording(np.arange(len(positions)) / 100, positions, ("a", "b"), 100.0, "x")


def test_units_that_are_wrong(tmp_path):
    write_c3d(sample_recording(positions=np.full((5, 2, 3), 700.0)), tmp_path / "a.c3d")
    with pytest.raises(RecordingError, match=r"beyond 100 m \(median 700 m\); are the units"):
        read_recording(tmp_path / "a.c3d")


def test_units_given(tmp_path):
    path = tmp_path / "a.c3d"
    write_c3d(sample_recording(), path)
    content = path.read_bytes()
    path.write_bytes(content.replace(b"\x02mm", b"\x02  ").replace(b"\x02\x01mm", b"\x02\x01  "))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        recording = read_recording(path, units="mm")
    np.testing.assert_allclose(recording.positions, sample_recording().positions, atol=1e-6)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty; expected Qualisys TSV, C3D, .* or ROS bag"),
        (b"\n \n", "the file is empty"),
        (b"time,x\n1,2\n", "a format that is not known; expected Qualisys TSV, C3D"),
        (b"\x89PNG\r\n\x1a\n\0\0", "a format that is not known"),
        (b"<html/>", "a format that is not known"),
        (b"\x02P", "no C3D header"),
        (b"<mvnx", "not valid XML"),
        (b"FREQUENCY\t60\n", "no line MARKER_NAMES"),
        (b"# urdf: x.urdf\n", "no line of columns"),
    ],
)
def test_other_files(tmp_path, content, message):
    path = tmp_path / "x"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=message):
        read_recording(path)
    with pytest.raises(RecordingError, match="absent: no such file"):
        read_recording(tmp_path / "absent")
    with pytest.raises(RecordingError, match="a folder, without files of one frame each;"):
        read_recording(tmp_path)


@pytest.mark.parametrize("ending", ["tsv", "c3d", "C3D"])
def test_labelled_recordings_keep_their_gaps(tmp_path, ending):
    positions = 0.03 * np.random.default_rng(0).normal(size=(8, 2, 3))
    positions[2:4, 1] = np.nan
    labelled = LabelledRecording(
        time=np.arange(4, 12) / 100,
        positions=positions,
        markers=("elbow", "hand_top"),
        filled=np.zeros((8, 2)),
        rate_hz=100.0,
        source="x",
        first_frame=5,
    )
    path = tmp_path / f"a.{ending}"
    write_recording(labelled, path)
    again = read_recording(path)
    np.testing.assert_allclose(again.positions, positions, atol=1e-6)
    np.testing.assert_allclose(again.time, labelled.time)
    assert (again.names, again.first_frame) == (labelled.markers, 5)


def test_what_cannot_be_written(tmp_path):
    with pytest.raises(RecordingError, match=r"x.csv: cannot be written: the ending must be \.tsv"):
        write_recording(sample_recording(), tmp_path / "x.csv")
    with pytest.raises(RecordingError, match="cannot be written: No such file"):
        write_recording(sample_recording(), tmp_path / "absent" / "x.tsv")


@settings(max_examples=300, deadline=None)
@given(
    start=st.sampled_from([b"", b"\x02P", b"<mvnx>", b"FREQUENCY\t60\n", b"# urdf: a\n"]),
    content=st.binary(max_size=1200),
)
def test_noise_ends_in_one_line(tmp_path_factory, start, content):
    path = tmp_path_factory.getbasetemp() / "noise"
    path.write_bytes(start + content)
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)
