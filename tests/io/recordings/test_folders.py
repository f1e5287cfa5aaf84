import os
from pathlib import Path

import pytest
from one_frame_files import write_panoptic

from besman.exceptions import RecordingError
from besman.io.recordings.folders import find_recordings, look_into


def make(folder: Path, *names: str) -> list[Path]:
    paths = [folder / name for name in names]
    for path in paths:
        path.touch()
    return paths


def test_folder_in_natural_order(tmp_path):
    make(tmp_path, "run10.tsv", "run2.tsv", "run1.TSV", "run1_manually_segmented.json", "10.tsv")
    found = find_recordings([tmp_path])
    assert [path.name for path in found] == ["10.tsv", "run1.TSV", "run2.tsv", "run10.tsv"]


def test_files_keep_their_order_and_count_once(tmp_path):
    first, second = make(tmp_path, "b.tsv", "a.txt")
    assert find_recordings([first, second, first]) == [first, second]


def test_nothing_found(tmp_path):
    with pytest.raises(RecordingError, match=r"no recording in this folder; expected .* \.tsv"):
        find_recordings([tmp_path])
    for name in ("empty", "person1", "person2"):
        (tmp_path / name).mkdir()
        if name != "empty":
            make(tmp_path / name, "a.tsv")
    with pytest.raises(
        RecordingError, match=r"no recording .*; there are some in .*person1, .*person2$"
    ):
        find_recordings([tmp_path])
    with pytest.raises(RecordingError, match="absent: no such file or folder"):
        find_recordings([tmp_path / "absent"])
    with pytest.raises(RecordingError, match="no recordings given"):
        find_recordings([])


def test_folders_hold_other_files_too(tmp_path):
    make(tmp_path, "run.tsv", ".hidden.tsv")
    for name in ("README.md", "results.csv", "robot.urdf", "x_truth.json"):
        (tmp_path / name).write_text("<robot>Population, text, and numbers 1,2,3\n")
    assert [path.name for path in find_recordings([tmp_path])] == ["run.tsv"]


def test_a_folder_of_one_frame_a_file_is_one_recording(tmp_path):
    take = write_panoptic(tmp_path / "take1", 3)
    make(tmp_path, "run1.tsv", "notes.txt")
    picture = tmp_path / "take2"
    picture.mkdir()
    for number in range(3):
        file = picture / f"a_{number:012d}_keypoints.json"
        file.write_text('{"people": [{"pose_keypoints_2d": [1, 2, 0.5], "pose_keypoints_3d": []}]}')
    assert find_recordings([tmp_path]) == [tmp_path / "run1.tsv", take]
    assert find_recordings([take]) == [take]
    inside = look_into(tmp_path)
    assert [one.pattern for one in inside.refused] == ["a_*_keypoints.json"]
    assert inside.others == [tmp_path / "notes.txt"]
    with pytest.raises(RecordingError, match=r"a_\*_keypoints.json: 3 files of one frame each: p"):
        find_recordings([picture])


def test_where_recordings_lie_deeper_that_is_said(tmp_path):
    write_panoptic(tmp_path / "day" / "person" / "take1", 2)
    with pytest.raises(RecordingError, match=r"no recording .*; there are some in .*person$"):
        find_recordings([tmp_path / "day"])


def test_a_folder_inside_that_may_not_be_read_is_passed_over(tmp_path, monkeypatch):
    # Nothing is closed to root, as whom tests may run.
    shut = tmp_path / "shut"
    for place in (shut, tmp_path / "open"):
        place.mkdir()
        make(place, "a.tsv")
    may, into = os.access, Path.iterdir

    def iterdir(place):
        if place == shut:
            raise PermissionError(13, "Permission denied", str(place))
        return into(place)

    monkeypatch.setattr(os, "access", lambda place, mode: place != shut and may(place, mode))
    monkeypatch.setattr(Path, "iterdir", iterdir)
    with pytest.raises(RecordingError, match=r"no recording .*; there are some in [^,]*open$"):
        find_recordings([tmp_path])
