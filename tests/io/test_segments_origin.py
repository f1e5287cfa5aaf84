"""A segments file says which recording it belongs to, and every reader looks."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest

from besman.annotate.session import Session
from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.segments_json import read_segments, read_throws, segments_path, write_segments
from besman.io.segments_origin import check_origin, describe_origin
from besman.records import LabelledRecording, LabelledSegments, Recording
from besman.stages.read.read_inputs import read_inputs
from besman.standalone.train_files import train_files
from besman.synthetic.datasets import write_synthetic


@pytest.fixture
def recording():
    rng = np.random.default_rng(0)
    positions = np.cumsum(rng.normal(scale=0.002, size=(3000, 4, 3)), axis=0)
    positions[100:130, 2] = np.nan
    names = ("Elbow", "Shoulder", "Hand top", None)
    return Recording(np.arange(3000) / 100, positions, names, 100.0, "take.tsv", 7)


@pytest.fixture
def segments(recording):
    return LabelledSegments(
        np.array([[0, 100], [200, 300]]), ("reach", "back"), np.zeros(2), 100.0, "take.tsv", 7
    )


def part(recording, rows):
    return replace(recording, time=recording.time[rows], positions=recording.positions[rows])


def write(recording, segments, folder):
    path = folder / "take_manually_segmented.json"
    write_segments(segments, path, origin=describe_origin(recording))
    return path


def test_its_own_recording_is_taken_without_a_word(recording, segments, tmp_path):
    path = write(recording, segments, tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read = read_segments(path, recording)
    np.testing.assert_array_equal(read.bounds, segments.bounds)
    assert read_throws(path) == ()
    content = json.loads(path.read_text())["recording"]
    assert (content["first frame"], content["frames"], content["rate_hz"]) == (7, 3000, 100.0)


@pytest.mark.parametrize("ending", [".tsv", ".c3d"])
def test_digest_is_that_of_the_take_whatever_it_is_called_and_written_in(
    recording, tmp_path, ending
):
    # Files have micrometres, and so have the recordings that are read from them.
    write_recording(recording, tmp_path / "take.tsv")
    path = tmp_path / f"other{ending}"
    write_recording(read_recording(tmp_path / "take.tsv"), path)
    digest = describe_origin(recording)["sha256"]
    assert describe_origin(read_recording(path))["sha256"] == digest
    order = [3, 1, 0, 2]
    turned = replace(
        recording, positions=recording.positions[:, order], names=("a", None, "b", "c")
    )
    assert describe_origin(turned)["sha256"] == digest
    split = np.full((3000, 5, 3), np.nan)
    split[:, :4] = recording.positions
    split[1500:, 4], split[1500:, 0] = split[1500:, 0].copy(), np.nan
    broken = replace(recording, positions=split, names=(None,) * 5)
    assert describe_origin(broken)["sha256"] == digest


def test_digest_is_another_one_for_another_take(recording):
    digest = describe_origin(recording)["sha256"]
    moved = replace(recording, positions=recording.positions + 2e-6)
    late = part(recording, slice(1, None))
    shuffled = replace(recording, positions=recording.positions[::-1])
    digests = {describe_origin(one)["sha256"] for one in (moved, late, shuffled)}
    assert len(digests | {digest}) == 4


@pytest.mark.parametrize(
    ("change", "got"),
    [
        (lambda r: part(r, slice(0, 2000)), "take.tsv has 2000 frames, 7 to 2006, at 100 Hz"),
        (lambda r: replace(r, first_frame=6), "take.tsv has 3000 frames, 6 to 3005, at 100 Hz"),
        (lambda r: replace(r, rate_hz=60.0), "take.tsv has 3000 frames, 7 to 3006, at 60 Hz"),
    ],
)
def test_other_frames_or_another_rate_are_refused(recording, segments, tmp_path, change, got):
    path = write(recording, segments, tmp_path)
    with pytest.raises(RecordingError) as error:
        read_segments(path, change(recording))
    said = str(error.value)
    assert said.startswith(f"{path}: belongs to another recording: {got}; expected 3000 frames, 7 ")
    assert said.endswith("take 'recording' out of the file")
    assert len(said.splitlines()) == 1
    content = json.loads(path.read_text())
    del content["recording"]
    path.write_text(json.dumps(content))
    assert len(read_segments(path, change(recording)).labels) == 2


def test_other_places_in_as_many_frames_are_told(recording, segments, tmp_path):
    path = write(recording, segments, tmp_path)
    other = replace(recording, positions=recording.positions + 0.1)
    expected = "made of another recording of as many frames, or of take.tsv before its samples were"
    with pytest.warns(RecordingWarning, match=expected):
        read = read_segments(path, other)
    assert read.labels == segments.labels


def test_filled_gaps_are_no_other_take(recording, segments, tmp_path):
    path = write(recording, segments, tmp_path)
    labelled = LabelledRecording(
        recording.time,
        np.nan_to_num(recording.positions),
        ("a", "b", "c", "d"),
        np.zeros((3000, 4), dtype=bool),
        100.0,
        "take.tsv",
        7,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_segments(path, labelled)
    with pytest.raises(RecordingError, match="belongs to another recording"):
        read_segments(path, replace(labelled, first_frame=1))


SAID = {"first frame": 7, "frames": 3000, "rate_hz": 100.0, "sha256": "0"}


@pytest.mark.parametrize(
    ("said", "message"),
    [
        (3, r"recording: got 3, expected the keys first frame, frames, rate_hz"),
        ({"frames": 3000}, "expected the keys first frame, frames, rate_hz"),
        ({**SAID, "frame": 1}, "recording: no key 'frame'; did you mean 'frames'"),
        ({**SAID, "frames": 3000.0}, "expected two whole numbers from 0, a rate in Hz"),
        ({**SAID, "first frame": -1}, "expected two whole numbers from 0"),
        ({**SAID, "frames": True}, "expected two whole numbers from 0"),
        ({**SAID, "rate_hz": "100"}, "expected two whole numbers from 0, a rate in Hz"),
        ({**SAID, "rate_hz": 0}, "a rate in Hz and, if given, a digest"),
        ({**SAID, "sha256": 3}, "if given, a digest"),
    ],
)
def test_what_is_said_of_a_recording_has_its_layout(recording, tmp_path, said, message):
    with pytest.raises(RecordingError, match=message):
        check_origin(said, describe_origin(recording), "take.tsv", tmp_path / "a.json")


def test_an_older_file_is_held_against_its_borders(recording, segments, tmp_path):
    path = tmp_path / "take_manually_segmented.json"
    write_segments(segments, path)
    assert isinstance(json.loads(path.read_text()), list)
    # Labelled up to the middle: as good as whole.
    read_segments(path, recording)
    with pytest.raises(RecordingError, match="do not lie in the recording's frames 7 to 256"):
        read_segments(path, part(recording, slice(0, 250)))


@pytest.mark.parametrize(
    "dataset", ["stick_throw_marked", "gestures", "circle_drawing", "object_rotation"]
)
def test_a_simulated_take_and_its_segments_belong_together(dataset, tmp_path):
    paths = write_synthetic(dataset, tmp_path, n_subjects=1, n_repetitions=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordingWarning)
        inputs = read_inputs([str(tmp_path)])
    assert len(inputs.recordings) == len(paths)
    for path, recording in zip(sorted(paths), inputs.recordings, strict=True):
        said = json.loads(segments_path(path).read_text())["recording"]
        assert ("sha256" in said) == (path.suffix == ".tsv")
        assert said.items() <= describe_origin(recording).items() or path.suffix != ".tsv"


def test_commands_refuse_the_segments_of_a_shorter_recording(tmp_path):
    (path,) = write_synthetic("stick_throw_marked", tmp_path, n_subjects=1, n_repetitions=2)
    whole = read_recording(path)
    write_recording(part(whole, slice(0, len(whole.time) - 10)), path)
    with pytest.raises(RecordingError, match="belongs to another recording"):
        read_inputs([str(path)])
    with pytest.raises(RecordingError, match="belongs to another recording"):
        train_files([path], tmp_path / "model", "right_arm", ())
    with pytest.raises(RecordingError, match="belongs to another recording"):
        Session([path])
