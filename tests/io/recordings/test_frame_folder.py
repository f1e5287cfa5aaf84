import hashlib
import json
import random
import warnings
from pathlib import Path

import numpy as np
import pytest
from fuzz.mutations import json_file
from one_frame_files import panoptic_body, write_panoptic

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.formats import read_recording
from besman.io.recordings.frame_folder import digest_frame_files, find_frame_files

NAMES = ("nose", "left_shoulder", "right_shoulder", "right_elbow", "right_wrist")


def write_frames(folder: Path, contents, name="pose_{}.json", start=1) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for number, content in enumerate(contents, start=start):
        text = content if isinstance(content, str) else json.dumps(content)
        (folder / name.format(number)).write_text(text)
    return folder


def frames(n, names=NAMES):
    return [
        {name: [0.01 * row, 0.1 * k, 2.0 - 0.3 * k] for k, name in enumerate(names)}
        for row in range(n)
    ]


def test_frames_of_panoptic(tmp_path):
    folder = write_panoptic(tmp_path / "hdPose3d_stage1_coco19", 40, without=(7, 8))
    with pytest.warns(RecordingWarning, match="2 frames are missing and became gaps, first before"):
        recording = read_recording(folder)
    assert (recording.rate_hz, recording.first_frame, len(recording.time)) == (29.97, 100, 40)
    assert recording.time[0] == pytest.approx(53.541542)
    assert recording.source == folder.name
    origin = recording.origin
    assert (origin.format, origin.units, origin.up) == ("keypoints JSON", "cm", "-y")
    wrist = recording.positions[:, recording.names.index("person0:RWrist")]
    assert np.flatnonzero(np.isnan(wrist[:, 0])).tolist() == [7, 8]
    # The file's y points down; what is up in the recording is z.
    heights = np.array([-panoptic_body(row)[11, 1] / 100 for row in range(40)])
    np.testing.assert_allclose(np.delete(wrist[:, 2] - heights, [7, 8]), 0.0, atol=1e-7)


def test_people_and_nobody(tmp_path):
    folder = write_panoptic(tmp_path / "two", 12, people=2)
    empty = '{"version": 0.7, "fpsType": "hd_29_97", "bodies": []}'
    for row in (0, 6, 11):
        file = folder / f"body3DScene_{100 + row:08d}.json"
        file.write_text(empty.replace("[]", f'[], "univTime": {53541.542 + 1000 * row / 29.97}'))
    recording = read_recording(folder)
    hidden = np.isnan(recording.positions).all(axis=(1, 2))
    assert np.flatnonzero(hidden).tolist() == [0, 6, 11]
    assert len(read_recording(folder, subject="person1").names) == 19


def test_one_file_of_two_people_is_no_recording_of_two_frames(tmp_path):
    folder = write_panoptic(tmp_path / "two", 2, people=2)
    with pytest.raises(RecordingError, match=r"of one frame; .*of its own, give their folder$"):
        read_recording(folder / "body3DScene_00000101.json", rate_hz=30.0)


@pytest.mark.parametrize(
    "change",
    [
        lambda frame: frame,
        lambda frame: {"keypoints": [{"name": name, "position": at} for name, at in frame.items()]},
        lambda frame: {"people": [{"pose_keypoints_3d": [1.0, 2.0, 3.0, 0.5] * 25}]},
    ],
    ids=["by_name", "listed", "openpose"],
)
def test_other_layouts_read_as_their_frames_in_one_file(tmp_path, change):
    contents = [change(frame) for frame in frames(12)]
    folder = write_frames(tmp_path / "take", contents, "v_{:012d}_keypoints.json", start=5)
    lines = tmp_path / "take.jsonl"
    lines.write_text("\n".join(map(json.dumps, contents)))
    with pytest.raises(RecordingError, match="say it with --rate"):
        read_recording(folder)
    read, expected = (read_recording(one, units="m", rate_hz=30.0) for one in (folder, lines))
    assert read.names == expected.names
    assert (read.first_frame, read.rate_hz) == (5, 30.0)
    np.testing.assert_array_equal(read.positions, expected.positions)


def easymocap(n_points, row=0):
    places = [[0.01 * row, 0.1 * k, 2.0 - 0.05 * k, 0.9] for k in range(n_points)]
    places[4][3] = 0
    return [{"id": 3, "keypoints3d": places}]


@pytest.mark.parametrize("n_points", [15, 25, 67])
def test_people_without_names_are_bodies_of_openpose(tmp_path, n_points):
    contents = [easymocap(n_points, row) for row in range(12)]
    contents[6] = []
    folder = write_frames(tmp_path / "keypoints3d", contents, "{:06d}.json", start=0)
    recording = read_recording(folder, units="m", rate_hz=30.0, up="z")
    assert recording.first_frame == 0
    assert recording.names[:3] == ("person3:Nose", "person3:Neck", "person3:RShoulder")
    seen = np.isfinite(recording.positions[:, :, 0]).sum(axis=1)
    assert seen.tolist() == [min(n_points, 25) - 1] * 6 + [0] + [min(n_points, 25) - 1] * 5
    np.testing.assert_allclose(recording.positions[5, 7], [0.05, 0.7, 1.65])


def test_people_without_names_in_an_order_that_is_not_known(tmp_path):
    folder = write_frames(tmp_path / "a", [easymocap(17)] * 12, "{:06d}.json")
    with pytest.raises(RecordingError, match=r"000001.json: 17 keypoints without names; expec"):
        read_recording(folder, rate_hz=30.0)
    write_frames(folder, [[{"keypoints3d": [[1, 2, 3]] * 25}]] * 12, "{:06d}.json")
    with pytest.raises(RecordingError, match=r"000001.json: a keypoint is \[1, 2, 3\]; expected"):
        read_recording(folder, rate_hz=30.0)


def test_numbers_count_by_value_whatever_else_is_in_names(tmp_path):
    folder = write_frames(tmp_path / "a", frames(11), "S2_hd_{}_body3d.json")
    (found,) = find_frame_files(folder)
    assert found.pattern == "S2_hd_*_body3d.json"
    assert found.numbers == tuple(range(1, 12))
    assert [one.name for one in found.files[8:10]] == [
        "S2_hd_9_body3d.json",
        "S2_hd_10_body3d.json",
    ]


@pytest.mark.parametrize(
    "contents",
    [
        [frames(3)] * 12,
        [{"fps": 30, "frames": frames(3)}] * 12,
        [{name: [[0, 0, 1]] * 3 for name in NAMES}] * 12,
        [{str(row): frame for row, frame in enumerate(frames(3))}] * 12,
        [{"trials": [{"frames": frames(2)}]}] * 12,
        [{"t": [1, 2, 3], "K": [1, 0, 0, 0, 1, 0, 0, 0, 1]}] * 12,
        [{"eye": [1, 2, 3], "at": [0, 0, 0], "up": [0, 0, 1]}] * 4,
        [{"people": [{"name": "Ann"}]}] * 12,
        [[1, 2, 3]] * 12,
        ["{" * 5] * 12,
    ],
    ids=[
        "list",
        "frames",
        "turned",
        "numbered",
        "trials",
        "cameras",
        "view",
        "names",
        "lists",
        "cut",
    ],
)
def test_files_of_something_else_are_no_frames(tmp_path, contents):
    assert find_frame_files(write_frames(tmp_path / "a", contents)) == []


def test_what_cannot_be_read_is_said_with_its_file(tmp_path):
    folder = write_frames(tmp_path / "a", frames(12))
    (folder / "pose_4.json").write_text('{"nose": [')
    with pytest.raises(RecordingError, match=r"pose_4\.json:1: not valid JSON.*is the file cut\?$"):
        read_recording(folder, rate_hz=30.0)
    (folder / "pose_4.json").write_text("[1, 2]")
    with pytest.raises(RecordingError, match=r"pose_4\.json: got \[1, 2\]; expected positions"):
        read_recording(folder, rate_hz=30.0)
    write_frames(folder, frames(12), "other_{}.json")
    with pytest.raises(RecordingError, match=r"2 recordings of one frame a file, .*; expected one"):
        read_recording(folder)
    with pytest.raises(RecordingError, match="a folder, without files of one frame each; expected"):
        read_recording(tmp_path)


def test_points_in_pictures_are_refused_once(tmp_path):
    person = {"person_id": [-1], "pose_keypoints_2d": [1.0, 2.0, 0.5], "pose_keypoints_3d": []}
    folder = write_frames(tmp_path / "a", [{"version": 1.3, "people": [person]}] * 3)
    with pytest.raises(RecordingError, match=r"pose_\*.json: 3 files of one frame each: points in"):
        read_recording(folder)


def test_one_checksum_for_all_files(tmp_path):
    folder = write_frames(tmp_path / "a", frames(12))
    text = b"".join((folder / f"pose_{number}.json").read_bytes() for number in range(1, 13))
    assert digest_frame_files(folder) == hashlib.sha256(text).hexdigest()


def test_damaged_frames_end_in_one_line_that_names_the_file_or_are_taken(tmp_path):
    folder = write_panoptic(tmp_path / "take", 12)
    files = sorted(folder.iterdir())
    whole = [file.read_bytes() for file in files]
    refused = 0
    for seed in range(16):
        rng = random.Random(seed)
        at = rng.randrange(len(files))
        files[at].write_bytes(json_file(rng, whole[at]))
        said = ""
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                assert len(read_recording(folder).time) >= 11
        except RecordingError as error:
            said = str(error)
        assert "\n" not in said
        refused += said != ""
        files[at].write_bytes(whole[at])
    assert 3 < refused < 16
