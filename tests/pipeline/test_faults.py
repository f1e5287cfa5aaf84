"""Damaged files, a disk that is full, folders that may not be written, two runs at once."""

import errno
import gc
import hashlib
import json
import os
import subprocess
from contextlib import suppress
from pathlib import Path

import pytest
from command_line import besman
from small_runs import CALLS, run_exports, run_two_stages, short_motions, state_of

from besman.exceptions import BesmanError, FileError, RunError
from besman.pipeline.run_folder import Run
from besman.pipeline.run_lock import is_locked
from besman.pipeline.stage_store import DamageError, read_description
from besman.pipeline.stored_run import open_run
from besman.records.files import digest


@pytest.fixture(autouse=True)
def _no_calls():
    CALLS.clear()


@pytest.fixture(scope="module")
def motions(make_plan):
    return short_motions(make_plan, ("a.tsv:1",))


def without(name):
    return lambda content: {key: value for key, value in content.items() if key != name}


def with_value(name, value):
    return lambda content: {**content, name: value}


FAILED = [{"name": "a:1", "reason": "short", "more": 1}]
DAMAGES = {
    "a list": (lambda content: [content], "is a list, expected an object"),
    "a number": (lambda content: 3, "is a int, expected an object"),
    "no key": (without("key"), "'key' is missing"),
    "no wall_s": (without("wall_s"), "'wall_s' is missing"),
    "unknown key": (with_value("more", 1), "'more' is unknown"),
    "key of a number": (with_value("key", 3), "is not as it was written"),
    "wall_s of text": (with_value("wall_s", "1"), "is not as it was written"),
    "negative wall_s": (with_value("wall_s", -1), "is not as it was written"),
    "endless wall_s": (with_value("wall_s", 1e999), "is no JSON"),
    "failed of text": (with_value("failed", "all"), "is not as it was written"),
    "failed with more": (with_value("failed", FAILED), "is not as it was written"),
    "failed of numbers": (with_value("failed", [{"name": 1, "reason": 2}]), "is not as it was"),
    "config of text": (with_value("config", "x"), "is not as it was written"),
    "versions of a list": (with_value("versions", []), "is not as it was written"),
    "another checksum": (with_value("sha256", "0" * 64), "record.npz is cut or changed"),
}


@pytest.mark.parametrize("kind", DAMAGES)
def test_a_damaged_description_is_computed_again_and_said(tmp_path, kind):
    damage, words = DAMAGES[kind]
    before, _ = run_two_stages(tmp_path / "r")
    path = tmp_path / "r" / "00_one" / "stage.json"
    path.write_text(json.dumps(damage(json.loads(path.read_text()))))
    after, cached = run_two_stages(tmp_path / "r")
    assert cached == [False, True]
    assert digest(after) == digest(before)
    (line,) = [
        line for line in (tmp_path / "r/log.txt").read_text().splitlines() if "again" in line
    ]
    assert f" 00_one: {'' if 'npz' in words else 'stage.json'}" in line
    assert words in line


@pytest.mark.parametrize("content", ["", "{", "\ud800"])
def test_a_garbled_description_is_damage(tmp_path, content):
    run_two_stages(tmp_path / "r")
    path = tmp_path / "r" / "00_one" / "stage.json"
    path.write_bytes(content.encode("utf-8", "surrogatepass"))
    with pytest.raises(DamageError, match=r"stage\.json is no JSON"):
        read_description(path.parent)
    assert run_two_stages(tmp_path / "r")[1] == [False, True]


def test_a_record_that_holds_something_else_is_computed_again(tmp_path):
    run_two_stages(tmp_path / "r")
    place = tmp_path / "r" / "00_one"
    (place / "record.npz").write_bytes(b"no archive")
    description = json.loads((place / "stage.json").read_text())
    description["sha256"] = hashlib.sha256(b"no archive").hexdigest()
    (place / "stage.json").write_text(json.dumps(description))
    assert run_two_stages(tmp_path / "r")[1] == [False, True]
    assert "record.npz: cannot be read as a record" in (tmp_path / "r/log.txt").read_text()


def test_a_stage_that_another_besman_wrote_is_no_damage(tmp_path):
    run_two_stages(tmp_path / "r")
    path = tmp_path / "r" / "00_one" / "stage.json"
    path.write_text(json.dumps({"key": "0" * 64, "wall_s": 1.0, "old": True}))
    assert run_two_stages(tmp_path / "r")[1] == [False, True]
    assert "again" not in (tmp_path / "r/log.txt").read_text()


@pytest.mark.parametrize("name", ["run.json", "results.json", "timing.json", "pipeline.yaml"])
@pytest.mark.parametrize("content", ["[]", "{}", "{", '{"stages": 3, "name": []}'])
def test_a_damaged_file_of_a_run_is_one_line_and_mended(
    tmp_path, robot, motions, monkeypatch, capsys, name, content
):
    folder = tmp_path / "r"
    run_exports(folder, motions, robot)
    path = folder / name
    path.write_text(content)
    code = besman(monkeypatch, "report", folder)
    said = capsys.readouterr().err.strip().splitlines()
    assert not any("Traceback" in line for line in said)
    if code:
        assert code == 2
        assert len(said) == 1
        assert name in said[0] or str(folder) in said[0]
    if name != "pipeline.yaml":
        assert code == 2 or content == "{}"
    assert besman(monkeypatch, "check", folder) in (1, 2)
    capsys.readouterr()
    run_exports(folder, motions, robot)
    assert state_of(folder)["status"] == "done"
    assert open_run(folder).changed() == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("stages", ["../other"]),
        ("stages", "00_one"),
        ("status", "perfect"),
        ("files", {"../x": "0"}),
        ("exports", {"../x": {"of": "", "files": {}}}),
        ("exports", {"exports": {"of": "", "files": {"../../x": "0"}}}),
        ("exports", {"exports": {"of": "", "files": {"x" * 300: "0"}}}),
        ("exports", {"x" * 300: {"of": "", "files": {}}}),
        ("files", {"a\0b": "0"}),
        ("exports", []),
        ("exports", None),
        ("files", None),
        ("stages", None),
        ("error", 3),
        ("inputs", None),
    ],
)
def test_what_a_run_says_of_itself_is_checked(tmp_path, key, value):
    run_two_stages(tmp_path / "r")
    path = tmp_path / "r" / "run.json"
    path.write_text(json.dumps({**state_of(tmp_path / "r"), key: value}))
    with pytest.raises(RunError, match=r"run\.json: is not as besman writes it"):
        open_run(tmp_path / "r")
    run_two_stages(tmp_path / "r")
    assert state_of(tmp_path / "r")["status"] == "done"
    assert "what was here before cannot be read" in (tmp_path / "r/log.txt").read_text()


def test_a_lock_that_is_a_folder(tmp_path):
    run_two_stages(tmp_path / "r")
    (tmp_path / "r/.lock").unlink()
    (tmp_path / "r/.lock").mkdir()
    with pytest.raises(RunError, match=r"\.lock: is a folder; expected a file: remove the folder"):
        run_two_stages(tmp_path / "r")
    assert not is_locked(tmp_path / "r")


def test_a_run_that_was_killed_is_called_so(tmp_path):
    run = Run(tmp_path / "r", "test")
    run.start("", {})
    assert open_run(tmp_path / "r").status == "running"
    run._lock.close()
    assert open_run(tmp_path / "r").status == "killed"
    run_two_stages(tmp_path / "r")
    assert open_run(tmp_path / "r").status == "done"


class Full:
    """A disk on which the n-th file that gets its name finds no room."""

    def __init__(self, monkeypatch, at):
        self.count, self._at = 0, at
        self._replace = Path.replace
        monkeypatch.setattr(Path, "replace", lambda path, target: self.replace(path, target))

    def replace(self, path, target):
        self.count += 1
        if self._at is not None and self.count >= self._at:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return self._replace(path, target)


def content_of(folder):
    kept = [*folder.glob("[0-9]*/record.npz"), *folder.glob("exports/*"), folder / "results.json"]
    return {path.relative_to(folder): path.read_bytes() for path in kept}


def test_a_full_disk_at_every_write_loses_nothing(tmp_path, robot, motions, monkeypatch):
    with monkeypatch.context() as patch:
        disk = Full(patch, None)
        run_exports(tmp_path / "whole", motions, robot, more=("one",))
    expected = content_of(tmp_path / "whole")
    assert disk.count > 15
    # All that the tests before have left is not looked through for every lock below.
    gc.freeze()
    for at in range(1, disk.count + 1):
        folder = tmp_path / f"r{at}"
        with monkeypatch.context() as patch:
            Full(patch, at)
            with pytest.raises(BesmanError, match="cannot be written: No space left on device"):
                run_exports(folder, motions, robot, more=("one",))
        assert not list(folder.rglob("*.tmp*"))
        # The system lets go of the lock with the process that was stopped.
        gc.collect()
        run_exports(folder, motions, robot, more=("one",))
        assert content_of(folder) == expected


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 800 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=800k", "tmpfs", place]
    mounted = subprocess.run(command, check=False, capture_output=True)
    if mounted.returncode:
        pytest.skip("needs the right to mount a disk")
    yield place
    subprocess.run(["umount", "-l", place], check=True)


def test_a_disk_that_is_full(small_disk, robot, motions):
    run_exports(small_disk / "r", motions, robot)
    expected = content_of(small_disk / "r")
    (small_disk / "r/exports/a_1.csv").unlink()
    with suppress(OSError), (small_disk / "large").open("wb", buffering=0) as file:
        while True:
            file.write(bytes(1024))
    with pytest.raises(FileError, match="cannot be written: No space left on device"):
        run_exports(small_disk / "r", motions, robot)
    (small_disk / "large").unlink()
    run_exports(small_disk / "r", motions, robot)
    assert content_of(small_disk / "r") == expected


def test_a_disk_that_is_read_only(small_disk, robot, motions, monkeypatch, capsys):
    run_exports(small_disk / "r", motions, robot)
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    with pytest.raises(RunError, match=r"\.lock: cannot be written: Read-only file system"):
        run_exports(small_disk / "r", motions, robot)
    with pytest.raises(RunError, match="new: cannot be written: Read-only file system"):
        run_exports(small_disk / "new", motions, robot)
    assert open_run(small_disk / "r").status == "done"
    assert besman(monkeypatch, "report", small_disk / "r") == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert len(error) == 1
    assert "cannot be written: Read-only file system" in error[0]


def test_two_runs_at_once(tmp_path):
    run = Run(tmp_path / "r", "test")
    run.start("", {})
    with pytest.raises(RunError, match="another besman is working here; wait or use --out"):
        run_two_stages(tmp_path / "r")
    assert open_run(tmp_path / "r").status == "running"
    run.finish()
    run_two_stages(tmp_path / "r")
