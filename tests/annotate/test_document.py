import json
import os
import signal
import stat
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from besman.annotate.document import Document
from besman.annotate.store import NO_FILE, Store
from besman.exceptions import AnnotationError, ChangedError, RecordingError
from besman.io.segments_json import read_segments
from besman.io.segments_origin import describe_origin
from besman.records import Recording

WRITER = """
import sys
from pathlib import Path
from besman.annotate.store import Store
store = Store(Path(sys.argv[1]))
revision, number = store.revision(), 0
print("ready", flush=True)
while True:
    number += 1
    revision = store.write(f"[{number}]{' ' * 3_000_000}\\n".encode(), revision, milestone=True)
"""


@pytest.fixture
def recording():
    positions = np.zeros((100, 1, 3))
    return Recording(np.arange(100) / 50, positions, ("hand_top",), 50.0, "a.tsv", first_frame=690)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a_manually_segmented.json"


def test_segments_are_written_in_frames_and_read_back(recording, path):
    document = Document(path, recording)
    assert document.revision == NO_FILE
    rows = [[0, 30, "reach", ""], [30, 100, 'a "<b>" é', "left_hand"]]
    document.save(rows, NO_FILE)
    content = json.loads(path.read_text())
    assert content["segments"][0] == {"start index": 690, "end index": 720, "label": "reach"}
    assert content["recording"] == describe_origin(recording)
    read = read_segments(path, recording)
    assert read.bounds.tolist() == [[0, 30], [30, 100]]
    assert read.labels == ("reach", 'a "<b>" é')
    assert Document(path, recording).page_rows() == rows


def test_what_else_stands_in_the_file_is_kept(recording, path):
    events = {"throws": [{"release_frame": 700}]}
    parts = [
        {"start index": 690, "end index": 710, "label": "reach"},
        {"start index": 690, "end index": 700, "label": "reach_part"},
    ]
    path.write_text(json.dumps({"segments": parts, "events": events}))
    document = Document(path, recording)
    assert [row[2] for row in document.page_rows()] == ["reach_part", "reach"]
    document.save([*document.page_rows(), [50, 60, "back", ""]], document.revision)
    content = json.loads(path.read_text())
    assert content["events"] == events
    assert [row["label"] for row in content["segments"]] == ["reach_part", "reach", "back"]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("x", "expected a list"),
        ([[1, 2, "a"]], r"expected \[start, end, label, layer\]"),
        ([[1, 2.5, "a", ""]], r"expected \[start, end, label, layer\]"),
        ([[1, True, "a", ""]], r"expected \[start, end, label, layer\]"),
        ([[1, 9, " ", ""]], "got 1 characters, expected 1 to 200"),
        ([[1, 9, "a" * 201, ""]], "got 201 characters, expected 1 to 200"),
        ([[1, 101, "a", ""]], "do not lie in the recording's frames 690 to 789"),
        ([[-1, 9, "a", ""]], "do not lie in the recording's frames 690 to 789"),
        ([[9, 9, "a", ""]], "end before they start"),
        ([[1, 9, "a", "feet"]], "no layer 'feet'"),
        ([[1, 9, "a", "left_hand"], [8, 12, "b", "left_hand"]], "overlap in layer 'left_hand'"),
    ],
)
def test_segments_that_are_none_are_refused_and_nothing_is_written(recording, path, rows, message):
    document = Document(path, recording)
    with pytest.raises((AnnotationError, RecordingError), match=message):
        document.save(rows, NO_FILE)
    assert list(path.parent.iterdir()) == []


def test_segments_of_another_recording_are_refused_at_the_start(recording, path):
    text = '[{"start index": 1, "end index": 20, "label": "a"}]'
    path.write_text(text)
    with pytest.raises(RecordingError, match="do not lie in the recording's frames 690 to 789"):
        Document(path, recording)
    assert path.read_text() == text


def test_segments_of_a_shorter_recording_are_refused_before_anything_is_written(recording, path):
    shorter = replace(recording, time=recording.time[:50], positions=recording.positions[:50])
    Document(path, shorter).save([[0, 30, "reach", ""]], NO_FILE)
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="has 100 frames, 690 to 789, at 50 Hz; expected"):
        Document(path, recording)
    assert path.read_bytes() == before


def test_a_page_that_knows_an_older_file_of_another_person_does_not_overwrite_it(recording, path):
    mine, theirs = Document(path, recording), Document(path, recording)
    theirs.save([[0, 30, "theirs", ""]], theirs.revision)
    written = path.read_bytes()
    with pytest.raises(ChangedError, match="another window or program changed it"):
        mine.save([[0, 30, "mine", ""]], mine.revision)
    assert path.read_bytes() == written


def test_a_bare_list_gets_its_recording_when_it_is_saved(recording, path):
    path.write_text('[{"start index": 690, "end index": 700, "label": "a"}]')
    document = Document(path, recording)
    document.save(document.page_rows(), document.revision)
    assert json.loads(path.read_text())["recording"]["frames"] == 100


def test_overlap_in_a_file_is_refused_at_the_start(recording, path):
    row = {"start index": 690, "end index": 720, "label": "a", "layer": "actions"}
    path.write_text(json.dumps([row, {**row, "start index": 700}]))
    with pytest.raises(RecordingError, match="overlap in layer 'actions'"):
        Document(path, recording)


def test_file_changed_underneath_is_not_overwritten(path):
    store = Store(path)
    mine = store.write(b"mine", NO_FILE)
    path.write_text("theirs")
    with pytest.raises(ChangedError, match="another window or program changed it"):
        store.write(b"mine again", mine)
    assert path.read_text() == "theirs"
    store.write(b"mine again", mine, replace=True)
    assert path.read_text() == "mine again"
    assert store.backup.read_text() == "theirs"


def test_file_that_came_or_went_is_a_change_too(path):
    store = Store(path)
    path.write_text("theirs")
    with pytest.raises(ChangedError, match="another window"):
        store.write(b"mine", NO_FILE)
    revision = store.revision()
    path.unlink()
    with pytest.raises(ChangedError, match="another window"):
        store.write(b"mine", revision)


def test_version_before_the_session_and_before_a_milestone_is_kept(path):
    path.write_text("old")
    store = Store(path)
    revision = store.write(b"1", store.revision())
    revision = store.write(b"2", revision)
    assert store.backup.read_text() == "old"
    revision = store.write(b"3", revision, milestone=True)
    assert store.backup.read_text() == "old"
    revision = store.write(b"4", revision)
    store.write(b"5", revision)
    assert (store.backup.read_text(), path.read_text()) == ("3", "5")
    assert sorted(file.name for file in path.parent.iterdir()) == [path.name, store.backup.name]


def test_mode_and_link_of_a_file_stay(path):
    target = path.with_name("elsewhere.json")
    target.write_text("[]")
    target.chmod(0o640)
    path.symlink_to(target)
    store = Store(path)
    store.write(b"[1]", store.revision())
    assert path.is_symlink()
    assert target.read_text() == "[1]"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


def test_read_only_folder_is_refused_at_the_start(path, monkeypatch):
    # The tests may run as root, who may write anywhere.
    real = os.access
    monkeypatch.setattr(
        os, "access", lambda place, mode: place != path.parent and real(place, mode)
    )
    with pytest.raises(AnnotationError, match="is read-only; give a file elsewhere with --seg"):
        Store(path)
    assert list(path.parent.iterdir()) == []


def test_read_only_file_is_refused_at_the_start(path, monkeypatch):
    path.write_text("[]")
    monkeypatch.setattr(os, "access", lambda place, mode: place != path)
    with pytest.raises(AnnotationError, match=f"{path.name} is read-only"):
        Store(path)


def test_folder_that_is_not_there_is_said(tmp_path):
    with pytest.raises(AnnotationError, match="no folder"):
        Store(tmp_path / "no" / "a.json")
    with pytest.raises(AnnotationError, match="is a folder; expected a segments file"):
        Store(tmp_path)


def test_disk_that_fails_is_said_and_the_old_file_stays(path, monkeypatch):
    store = Store(path)
    revision = store.write(b"old", NO_FILE)

    def fail(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(AnnotationError, match="cannot be written: No space left on device"):
        store.write(b"new", revision)
    assert path.read_text() == "old"


@pytest.mark.parametrize("wait_s", [0.0, 0.003, 0.011, 0.02])
def test_killed_in_the_middle_of_a_save_the_file_is_whole(path, wait_s):
    """A process that does nothing but save is killed; what stands there is one whole version."""
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, env=os.environ
    )
    writer.stdout.readline()
    until = time.monotonic() + 60
    while not path.exists():
        assert writer.poll() is None
        assert time.monotonic() < until
    time.sleep(wait_s)
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    text = path.read_bytes()
    assert text.startswith(b"[")
    assert text.endswith(b"\n")
    assert len(text) > 3_000_000
    # And the next session goes on from there.
    store = Store(path)
    store.write(b"next", store.revision())
    assert path.read_bytes() == b"next"
    assert store.backup.read_bytes() == text


def test_what_stands_in_the_file_already_is_no_change(path):
    path.write_text("old")
    store = Store(path)
    base = store.revision()
    first = store.write(b"1", base)
    # An answer that was lost: the same again, from the revision before.
    assert store.write(b"1", base, milestone=True) == first
    assert store.backup.read_text() == "old"
    store.write(b"2", first)
    assert store.backup.read_text() == "1"
