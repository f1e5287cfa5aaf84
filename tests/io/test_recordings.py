from pathlib import Path

import pytest

from besman.exceptions import RecordingError
from besman.io.recordings import find_recordings, read_recording


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
    with pytest.raises(RecordingError, match="absent: no such file or folder"):
        find_recordings([tmp_path / "absent"])
    with pytest.raises(RecordingError, match="no recordings given"):
        find_recordings([])


def test_read_recording_of_the_sample():
    sample = Path(__file__).parents[2] / "data" / "stick_throw" / "subject1.tsv"
    assert "Stick" in read_recording(sample).names
