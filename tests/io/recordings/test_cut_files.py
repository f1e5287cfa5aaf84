"""A file that was cut in transfer is never taken for whole, and what is there can be had."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from command_line import besman
from places import DATA, REAL_DATA, SAMPLE

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.exoskeleton import write_joint_log
from besman.io.recordings.format import reading
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.recordings.mvnx import write_mvnx

N = 60


@pytest.fixture(scope="module")
def whole():
    recording = read_recording(SAMPLE / "subject1.tsv")
    return replace(recording, time=recording.time[:N], positions=recording.positions[:N])


def write_log(recording, path):
    angles = 0.1 * np.sin(recording.time[:, None] + np.arange(6))
    side = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow_pitch", "forearm_roll",
            "wrist_pitch")  # fmt: skip
    joints = [f"right_{joint}" for joint in side]
    bodies = {"shoulder": "right_shoulder", "wrist": "right_wrist"}
    write_joint_log(path, recording.time, angles, joints, "dual_arm_example", bodies)


WRITERS = {
    "tsv": write_recording,
    "c3d": write_recording,
    "mvnx": write_mvnx,
    "csv": write_log,
}


@pytest.mark.parametrize("ending", WRITERS)
def test_no_cut_goes_unnoticed(ending, whole, tmp_path):
    """Whatever the byte where it ends; but for the last number's last digits, none is missing."""
    path, cut = tmp_path / f"a.{ending}", tmp_path / f"cut.{ending}"
    WRITERS[ending](whole, path)
    content = path.read_bytes()
    read = read_recording(path)
    for length in np.linspace(1, len(content) - 2, 60).astype(int).tolist():
        cut.write_bytes(content[:length])
        if ending == "csv" and b"\n" in content[length - 1 : length + 1]:
            # Nothing says how many rows a log has.
            continue
        try:
            got = read_recording(cut)
        except RecordingError as error:
            assert "cut" in str(error) or "no " in str(error)  # noqa: PT017
        else:
            # What a format fills up at its end, or tags that nothing stands in any more.
            assert len(got.time) == len(read.time)
            np.testing.assert_array_equal(got.positions, read.positions)


@pytest.mark.parametrize("ending", WRITERS)
def test_partial_takes_the_whole_frames(ending, whole, tmp_path):
    path, cut = tmp_path / f"a.{ending}", tmp_path / f"cut.{ending}"
    WRITERS[ending](whole, path)
    content = path.read_bytes()
    read = read_recording(path)
    cut.write_bytes(content[: int(0.8 * len(content))])
    with pytest.raises(RecordingError, match=r"cut.*(--partial takes what is there)?"):
        read_recording(cut)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        got = read_recording(cut, partial=True)
        with reading(partial=True):
            again = read_recording(cut)
    assert 0.6 * N < len(got.time) < N
    assert all(issubclass(one.category, RecordingWarning) for one in said)
    assert said or ending == "csv", "a joint log says nowhere how long it is"
    np.testing.assert_array_equal(got.positions, read.positions[: len(got.time)])
    np.testing.assert_array_equal(again.positions, got.positions)


def tsv(folder, n_frames=1000, first=1, n_rows=29, ends="\n", columns=True):
    """Write a TSV of two markers."""
    names = [f"{name} {axis}" for name in ("Hand top", "Elbow") for axis in "XYZ"]
    extra = ["Frame", "Time"] if columns else []
    rows = []
    for frame in range(first, first + n_rows):
        place = [f"{frame - first + k:.3f}" for k in range(6)]
        clock = [str(frame), f"{(frame - 1) / 100:.5f}"] if columns else []
        rows.append("\t".join([*clock, *place]))
    text = "\n".join([
        f"NO_OF_FRAMES\t{n_frames}", "NO_OF_MARKERS\t2", "FREQUENCY\t100",
        "MARKER_NAMES\tHand top\tElbow", "\t".join([*extra, *names]), *rows,
    ])  # fmt: skip
    path = folder / "run.tsv"
    path.write_text(text + ends)
    return path


def test_29_of_1000_frames_are_not_the_whole(tmp_path):
    message = r"run.tsv: NO_OF_FRAMES is 1000 and 29 frames follow; is the file cut\? --partial"
    with pytest.raises(RecordingError, match=message):
        read_recording(tsv(tmp_path))
    with pytest.warns(RecordingWarning, match="NO_OF_FRAMES is 1000 and 29 frames follow"):
        assert len(read_recording(tsv(tmp_path), partial=True).time) == 29


def test_a_part_of_a_take_counts_the_take(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_recording(tsv(tmp_path, first=690)).first_frame == 690


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"n_frames": 29}, None),
        ({"n_frames": 29, "ends": ""}, None),
        ({"n_frames": 29, "first": 690}, None),
        ({"n_frames": 20}, "NO_OF_FRAMES is 20 and 29 frames follow"),
        ({"n_frames": 99, "first": 690}, "NO_OF_FRAMES is 99 and 29 frames follow"),
        ({"columns": False}, "NO_OF_FRAMES is 1000 and 29 frames follow"),
        ({"columns": False, "n_frames": 29}, None),
    ],
)
def test_counts_that_may_be_right_are_said_at_most(tmp_path, options, said):
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        assert len(read_recording(tsv(tmp_path, **options)).time) == 29
    assert [str(one.message) for one in heard] == ([] if said is None else [f"run.tsv: {said}"])


@pytest.mark.parametrize("lost", [1, 2, 3, 4])
@pytest.mark.parametrize("first", [1, 690])
def test_a_last_number_that_lost_digits_is_seen(tmp_path, lost, first):
    path = tsv(tmp_path, n_frames=29 if first == 1 else 1000, first=first, ends="")
    path.write_text(path.read_text()[:-lost])
    with pytest.raises(RecordingError, match=r"run.tsv:34: the line ends before those above it do"):
        read_recording(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert len(read_recording(path, partial=True).time) == 28


@pytest.mark.skipif(not REAL_DATA.is_dir(), reason="the real recordings are not on this machine")
def test_the_real_recordings_are_whole_and_their_halves_are_not(tmp_path):
    paths = sorted((REAL_DATA / "pick_and_place").glob("*.tsv"))
    assert len(paths) == 12
    for path in paths:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            recording = read_recording(path)
        assert recording.first_frame > 1
        content = path.read_bytes()
        cut = tmp_path / "cut.tsv"
        cut.write_bytes(content[: len(content) // 2])
        with pytest.raises(RecordingError, match="is the file cut"):
            read_recording(cut)


def run(monkeypatch, capsys, *arguments):
    code = besman(monkeypatch, *arguments)
    said = capsys.readouterr()
    assert "Traceback" not in said.err
    return code, said.out, said.err


def test_commands_take_what_is_there_if_told_to(monkeypatch, capsys, tmp_path):
    text = (DATA / "stick_throw" / "subject1.tsv").read_text()
    path, named = tmp_path / "cut.tsv", tmp_path / "named.tsv"
    path.write_text(text[: len(text) // 5])
    code, _, err = run(monkeypatch, capsys, "segment", path)
    assert code == 2
    assert "cut.tsv:" in err
    assert "--partial takes what is there" in err
    code, _, err = run(
        monkeypatch, capsys, "segment", path, "--partial", "--json", tmp_path / "found.json"
    )
    assert code == 0
    assert "warning: cut.tsv: NO_OF_FRAMES is 3798 and" in err
    (found,) = json.loads((tmp_path / "found.json").read_text())
    assert len(found["borders_s"]) > 3
    # And it is forgotten again.
    train = ("train", SAMPLE / "subject1.tsv", "--out", tmp_path / "model")
    assert run(monkeypatch, capsys, *train, "--set", "examples_per_class=3")[0] == 0
    follow = ("follow", path, "--model", tmp_path / "model.npz")
    assert run(monkeypatch, capsys, *follow)[0] == 2
    assert run(monkeypatch, capsys, "--partial", *follow)[0] == 0
    learn = ("--learn-from", DATA / "stick_throw_calibration" / "person.tsv")
    assert run(monkeypatch, capsys, "label-markers", path, "--out", named, *learn)[0] == 2
    assert not named.exists()
    assert (
        run(monkeypatch, capsys, "label-markers", path, "--out", named, *learn, "--partial")[0] == 0
    )
    assert named.is_file()


def test_strict_makes_a_warning_an_error(monkeypatch, capsys, tmp_path, whole):
    positions = whole.positions.copy()
    positions[30, whole.names.index("Hand top"), 0] = 99.999
    path = tmp_path / "spike.tsv"
    write_recording(replace(whole, positions=positions), path)
    code, out, err = run(monkeypatch, capsys, "segment", path)
    assert code == 0
    assert err == (
        "besman: warning: spike.tsv: 1 sample that no body makes became a gap: 'Hand top' "
        "frame 31\n"
    )
    code, out, err = run(monkeypatch, capsys, "segment", path, "--strict")
    assert (code, out) == (2, "")
    assert err == (
        "besman: error: spike.tsv: 1 sample that no body makes became a gap: 'Hand top' "
        "frame 31 (--strict: a warning is an error)\n"
    )
