"""Where results go is looked at before the work; the table is there whatever becomes of a file."""

import errno

import pytest
from command_line import besman
from places import DATA

from besman.cli import main
from besman.exceptions import FileError

RECORDING = DATA / "stick_throw" / "subject1.tsv"
JSON = {
    "segment": (RECORDING,),
    "label-markers": (RECORDING, "--out", "named.tsv"),
    "follow": (RECORDING,),
    "robustness": ("run",),
    "verify": ("run",),
    "plan": ("run", "--goal", "box1 on table"),
    "template apply": ("run", "--context", "x=1"),
    "evaluate segmentation": (),
    "evaluate labelling": (),
    "evaluate recognition": (),
    "evaluate mapping": (),
    "evaluate refinement": (),
    "evaluate hierarchy": (),
}
FOLDERS = {
    "evaluate segmentation": "--figures",
    "evaluate recognition": "--figures",
    "evaluate mapping": "--figures",
    "evaluate refinement": "--figures",
    "synth stick_throw": "--out",
}


def last_line(capsys):
    said = capsys.readouterr()
    assert "Traceback" not in said.err
    return said.err.strip().splitlines()[-1]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    (tmp_path / "cwd").mkdir()
    monkeypatch.chdir(tmp_path / "cwd")


@pytest.mark.parametrize("command", JSON)
def test_a_json_file_that_cannot_be_is_refused_before_the_work(
    command, tmp_path, monkeypatch, capsys
):
    for path, words in (
        (tmp_path / "no" / "a.json", f": there is no folder {tmp_path / 'no'}"),
        (tmp_path, ": is a folder; expected the name of a file"),
    ):
        code = besman(monkeypatch, *command.split(), *JSON[command], "--json", path)
        assert code == 2
        assert last_line(capsys) == f"besman: error: --json: {path}{words}"
    assert not list((tmp_path / "cwd").iterdir())


@pytest.mark.parametrize("command", FOLDERS)
def test_a_folder_that_cannot_be_is_refused_before_the_work(command, tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    path = tmp_path / "file" / "below"
    assert besman(monkeypatch, *command.split(), FOLDERS[command], path) == 2
    words = f"{path}: cannot be written: {tmp_path / 'file'} is a file, expected a folder"
    assert last_line(capsys) == f"besman: error: {FOLDERS[command]}: {words}"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--out", "no/named.tsv"), "no/named.tsv: there is no folder no"),
        (("--out", "named.txt"), "named.txt: cannot be written: the ending must be .tsv or .c3d"),
        (
            ("--out", "a.tsv", "--figure", "a.gif"),
            "a.gif: got ending '.gif', expected .png or .svg",
        ),
        (("--out", "a.tsv", "--figure", "no/a.png"), "--figure: no/a.png: there is no folder no"),
    ],
)
def test_what_label_markers_writes_is_looked_at_first(
    options, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("besman.standalone.label_file.read_recording", None)
    assert besman(monkeypatch, "label-markers", RECORDING, *options) == 2
    assert last_line(capsys) == f"besman: error: {words}"
    assert not list((tmp_path / "cwd").iterdir())


def test_train_looks_first(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("besman.standalone.train_files.read_inputs", None)
    (tmp_path / "file").write_text("")
    assert besman(monkeypatch, "train", RECORDING, "--out", tmp_path / "file" / "model") == 2
    assert last_line(capsys).endswith("/file is a file, expected a folder")


def test_the_table_is_printed_although_the_file_cannot_be_written(tmp_path, monkeypatch, capsys):
    def refuse(path, content):
        raise FileError(f"{path}: cannot be written: No space left on device")

    monkeypatch.setattr("besman.io.atomic_files.write_json", refuse)
    assert besman(monkeypatch, "segment", RECORDING, "--json", tmp_path / "a.json") == 2
    said = capsys.readouterr()
    assert "subject1.tsv" in said.out
    assert said.err.strip().endswith("a.json: cannot be written: No space left on device")


def test_what_the_system_refuses_is_one_line(monkeypatch, capsys):
    def fail(*arguments):
        raise OSError(errno.EIO, "Input/output error", "/disk/subject1.tsv")

    monkeypatch.setattr("besman.standalone.segment_files.segment_files", fail)
    assert besman(monkeypatch, "segment", RECORDING) == 2
    assert last_line(capsys) == "besman: error: /disk/subject1.tsv: Input/output error"
    monkeypatch.setattr("sys.argv", ["besman", "--debug", "segment", str(RECORDING)])
    with pytest.raises(OSError, match="Input/output error"):
        main.main()
