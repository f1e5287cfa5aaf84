import json
import shutil
import warnings

import numpy as np
import pytest
from command_line import besman
from one_frame_files import write_panoptic
from places import SAMPLE

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.recordings.frame_folder import digest_frame_files
from besman.records import Recording
from besman.stages.read.read_inputs import is_same_take, read_inputs


@pytest.fixture(scope="module")
def raw():
    return read_recording(SAMPLE / "subject1.tsv")


def test_recordings_of_a_recipe_that_do_not_come_along(monkeypatch, capsys):
    assert besman(monkeypatch, "check", "rh5_two_arms") == 2
    said = capsys.readouterr().err
    assert "object_rotation: no such file or folder; these recordings do not come with" in said
    assert "--set recordings=FOLDER" in said


@pytest.mark.parametrize("twin", ["a.c3d", "a.TSV"])
def test_two_files_of_one_name_are_refused(tmp_path, raw, twin, monkeypatch, capsys):
    write_recording(raw, tmp_path / "a.tsv")
    write_recording(raw, tmp_path / twin)
    words = r"a\..* and .*a\..*: two recordings have this name, 'a', and motions and exports are "
    with pytest.raises(RecordingError, match=words + "called by it; rename one, or name the files"):
        read_inputs([str(tmp_path)])
    settings = ("--set", f"recordings={tmp_path}")
    for command in (
        ("check", "ur5_stick_throw", *settings),
        ("run", "ur5_stick_throw", *settings, "--out", tmp_path / "run"),
    ):
        assert besman(monkeypatch, *command) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert "two recordings have this name, 'a'" in line
    assert not (tmp_path / "run").exists()
    assert len(read_inputs([str(tmp_path / "a.tsv")]).recordings) == 1


def test_two_folders_with_one_name_are_refused(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        shutil.copy(SAMPLE / "subject1.tsv", tmp_path / name / "a.tsv")
    with pytest.raises(RecordingError, match=r"one/a\.tsv and .*two/a\.tsv: two recordings have"):
        read_inputs([str(tmp_path / "one"), str(tmp_path / "two")])


def test_a_labelled_copy_beside_the_raw_recording_is_told(tmp_path, raw):
    order = np.random.default_rng(0).permutation(len(raw.names))
    positions = raw.positions[:, order].copy()
    positions[100:400, 0] = np.nan
    write_recording(raw, tmp_path / "a.tsv")
    named = Recording(raw.time, positions, (None,) * len(order), raw.rate_hz, "x", raw.first_frame)
    write_recording(named, tmp_path / "a_named.c3d")
    words = r"a\.tsv and a_named\.c3d hold the same take: its movements count twice"
    with pytest.warns(RecordingWarning, match=words):
        read_inputs([str(tmp_path)])


def test_other_takes_are_not_the_same(raw):
    moved = Recording(raw.time, raw.positions + 0.001, raw.names, raw.rate_hz, "b", raw.first_frame)
    assert is_same_take(raw, raw)
    assert not is_same_take(raw, moved)
    unseen = Recording(
        raw.time, np.full_like(raw.positions, np.nan), raw.names, raw.rate_hz, "c", raw.first_frame
    )
    assert not is_same_take(raw, unseen)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_inputs([str(SAMPLE)])


def test_a_folder_of_one_frame_a_file_is_an_input(tmp_path):
    take = write_panoptic(tmp_path / "take", 5)
    (tmp_path / "take_manually_segmented.json").write_text(
        json.dumps([{"start index": 101, "end index": 104, "label": "reach"}])
    )
    for paths in ([str(take)], [str(tmp_path)]):
        inputs = read_inputs(paths)
        assert [one.source for one in inputs.recordings] == ["take"]
        assert inputs.truth[0].labels == ("reach",)
        assert inputs.checksums["take"] == digest_frame_files(take)
