"""What is written is whole or not there; what stops a write is one line that names the path."""

import ast
import errno
import json
import os
import re
import resource
import subprocess
import sys

import numpy as np
import pytest
from places import TOP
from sources import nodes

from besman.exceptions import FileError, RecordingError
from besman.io.atomic_files import (
    check_file,
    check_folder,
    make_folder,
    write_json,
    write_record,
    write_text,
    written_aside,
)
from besman.records import Segments
from besman.records.files import load_record


def files(folder):
    return sorted(path.name for path in folder.iterdir())


def stop_writing(path, error):
    with written_aside(path) as temporary:
        temporary.write_text("half")
        raise error


def test_a_write_that_fails_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with pytest.raises(FileError, match=r"a\.txt: cannot be written: No space left on device"):
        stop_writing(path, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    with pytest.raises(KeyboardInterrupt):
        stop_writing(path, KeyboardInterrupt())
    assert path.read_text() == "old"
    assert files(tmp_path) == ["a.txt"]


def test_the_ending_stays_and_a_reader_sees_nothing_before_the_end(tmp_path):
    with written_aside(tmp_path / "a.ros.json") as temporary:
        assert temporary.suffix == ".json"
        assert temporary.name.startswith(".")
        temporary.write_text("new")
        assert not (tmp_path / "a.ros.json").exists()
    assert (tmp_path / "a.ros.json").read_text() == "new"


def test_the_error_is_of_the_kind_asked_for(tmp_path):
    with pytest.raises(RecordingError, match=r"no/a\.txt: cannot be written: No such file or dir"):
        write_text(tmp_path / "no" / "a.txt", "", kind=RecordingError)
    with pytest.raises(FileError, match="cannot be written: Is a directory"):
        write_text(tmp_path, "")


def test_json_has_no_nan(tmp_path):
    write_json(tmp_path / "a.json", {"x": np.float64("nan"), "y": (np.int64(3), np.arange(2.0))})
    assert json.loads((tmp_path / "a.json").read_text()) == {"x": None, "y": [3, [0.0, 1.0]]}


def test_a_record_is_written_whole(tmp_path):
    write_record(tmp_path / "r.npz", Segments([[0, 9]], 0.5, 1.0, "x"))
    assert load_record(tmp_path / "r.npz").log_evidence == 0.5


def test_targets_are_refused_before_the_work(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"--json: .*: is a folder; expected the name of a file"):
        check_file(tmp_path, f"--json: {tmp_path}")
    with pytest.raises(FileError, match=r"/no/a\.json: there is no folder .*/no$"):
        check_file(tmp_path / "no" / "a.json")
    with pytest.raises(
        FileError, match=r"/it: cannot be written: .*/file is a file, expected a folder"
    ):
        check_folder(tmp_path / "file" / "below" / "it")
    with pytest.raises(FileError, match="cannot be written: is a file, expected a folder"):
        make_folder(tmp_path / "file")
    check_file(tmp_path / "a.json")
    check_folder(tmp_path / "new" / "below")
    # For root everything may be written.
    monkeypatch.setattr("besman.io.atomic_files.os.access", lambda path, mode: False)
    with pytest.raises(FileError, match=r"a\.json: cannot be written: .* is read-only"):
        check_file(tmp_path / "a.json")
    with pytest.raises(FileError, match=r"cannot be written: .* is read-only"):
        check_folder(tmp_path / "new")


def no_room():
    """Let no file be larger than some bytes, as on a disk that is nearly full."""
    import signal

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (40, 40))


MESSAGE = "ros_joint_trajectory(time, one, one, one, 'j')"
WRITERS = {
    "a.tsv": "write_recording(recording, path)",
    "a.c3d": "write_recording(recording, path)",
    "a.mvnx": "write_mvnx(recording, path)",
    "log.csv": "write_joint_log(path, time, one, ['j'], 'a.urdf', {'wrist': 'w'})",
    "a.json": "write_segments(segments, path)",
    "limits.json": "write_json(path, {'a': 'b' * 90})",
    "t.csv": "write_joint_csv(path, time, one, one, one, ('j',))",
    "t.ros.json": f"write_ros_joint_trajectory(path, {MESSAGE})",
    "t.ros.yaml": f"write_ros_joint_trajectory(path, {MESSAGE})",
    "t.script": "write_urscript(path, 'a', time, np.tile(one, 6))",
    "r.npz": "write_record(path, recording)",
}
SCRIPT = """
import sys
from pathlib import Path
import numpy as np
from besman.exceptions import BesmanError
from besman.io.atomic_files import write_json, write_record
from besman.io.exports import *
from besman.io.recordings.exoskeleton import write_joint_log
from besman.io.recordings.formats import write_recording
from besman.io.recordings.mvnx import write_mvnx
from besman.io.segments_json import write_segments
from besman.io.urscript import write_urscript
from besman.records import LabelledSegments, Recording

time, one = np.arange(100) * 0.002, np.ones((100, 1))
recording = Recording(np.arange(5) / 100, np.ones((5, 1, 3)), ("a",), 100.0, "a.tsv")
segments = LabelledSegments([[0, 5]], ("throw",), [0.0], 100.0, "a.tsv")
for name, call in WRITERS.items():
    path = Path(sys.argv[1]) / name
    try:
        eval(call)
    except BesmanError as error:
        print(error)
"""


def test_every_writer_says_where_there_is_no_room(tmp_path):
    for name in WRITERS:
        (tmp_path / name).write_text("before")
    done = subprocess.run(
        [sys.executable, "-c", f"WRITERS = {WRITERS}\n{SCRIPT}", tmp_path],
        capture_output=True,
        text=True,
        preexec_fn=no_room,
        env={**os.environ, "PYTHONPATH": str(TOP)},
        check=False,
    )
    said = done.stdout.splitlines()
    assert [line.split(": cannot be written: ")[0] for line in said] == [
        str(tmp_path / name) for name in WRITERS
    ], done.stderr
    assert files(tmp_path) == sorted(WRITERS)
    assert {path.read_text() for path in tmp_path.iterdir()} == {"before"}


# What writes without `written_aside`, and why that is right.
ALLOWED = {
    "besman/io/atomic_files.py": "is it",
    "besman/records/files.py": "writes to a path that it is given",
    "besman/annotate/store.py": "keeps the version before, under a lock",
    "besman/robot/files/arm_files.py": "never replaces a file",
    "besman/live/play_mcap.py": "is read while it grows, and never replaces a file",
    "besman/pipeline/run_record.py": "adds a line to the log",
    "besman/pipeline/run_lock.py": "a lock has no content",
    "besman/evaluation/counted_episodes.py": "is counted while it grows, in a folder of its own",
}


def writes(path):
    """Return lines of a module that open a file to write outside of `written_aside`."""
    aside = set()
    for node in nodes(path):
        if isinstance(node, ast.With) and "written_aside" in ast.dump(node.items[0]):
            aside |= {id(inner) for inner in ast.walk(node)}
    found = []
    for node in nodes(path):
        if not isinstance(node, ast.Call) or id(node) in aside:
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else ""
        given = [*node.args, *(one.value for one in node.keywords)] if name == "open" else []
        mode = ast.dump(ast.Tuple(given))
        opens = any(f"value='{letter}" in mode for letter in "wax")
        text_buffer = name == "savefig" and isinstance(node.args[0], ast.Name)
        if (
            opens
            or name in {"write_text", "write_bytes", "savez"}
            or (name == "savefig" and not text_buffer)
        ):
            found.append(node.lineno)
    return found


def test_every_write_goes_the_same_way():
    texts = {path: path.read_text(encoding="utf-8") for path in (TOP / "besman").rglob("*.py")}
    calls = re.compile(r"\bopen\b|write_text|write_bytes|savez|savefig")
    modules = sorted(path for path, text in texts.items() if calls.search(text))
    direct = {path.relative_to(TOP).as_posix(): writes(path) for path in modules}
    assert {name for name, lines in direct.items() if lines} <= ALLOWED.keys()
