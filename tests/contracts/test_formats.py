"""What every format of recordings keeps to; a new one needs its entry in `FORMATS`, no more.

A format without a writer of its own needs a line in `SAMPLES` too.
"""

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from format_samples import HAD, LOG, SAMPLES, recording_of, write_sample
from places import TOP
from typer.testing import CliRunner

from besman.cli.main import app
from besman.exceptions import RecordingError, one_of
from besman.io.recordings import format as format_module
from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import (
    FORMATS,
    WRITTEN_SUFFIXES,
    find_companions,
    read_recording,
    recognise,
    write_recording,
)

EVERY = pytest.mark.parametrize("entry", HAD, ids=lambda entry: entry.reader.split(":")[0])
WRITTEN = pytest.mark.parametrize(
    "entry", [one for one in FORMATS if one.writer], ids=lambda entry: entry.reader.split(":")[0]
)
N_CUTS = 40


# Formats that count no frames.
UNCOUNTED = {"BVH", "ROS bag"}
# What programs leave open is concluded, and said.
CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    """One file of each format, under an ending that says nothing."""
    folder = tmp_path_factory.mktemp("formats")
    return {entry.name: write_sample(entry, folder / f"{at}.dat") for at, entry in enumerate(HAD)}


def assert_same(one, two):
    np.testing.assert_array_equal(one.time, two.time)
    np.testing.assert_array_equal(one.positions, two.positions)
    assert (one.names, one.rate_hz, one.first_frame) == (two.names, two.rate_hz, two.first_frame)


def assert_one_line(error, path):
    assert "\n" not in str(error)
    assert str(path) in str(error)
    assert len(str(error)) < 400


@EVERY
def test_the_entry_names_functions_that_are_there(entry):
    for name in filter(None, (entry.reader, entry.writer, entry.companions)):
        assert callable(format_module._function(name))
    assert entry.suffixes
    for suffix in entry.suffixes:
        assert re.fullmatch(r"\.[a-z0-9]+", suffix)
    for words in (entry.name, entry.about):
        assert words.strip()
        assert "\n" not in words
    assert entry.writer or entry.name in SAMPLES, "a line in SAMPLES is missing"


def test_no_two_formats_are_called_or_written_alike():
    assert len({entry.name for entry in FORMATS}) == len(FORMATS)
    assert len(set(WRITTEN_SUFFIXES)) == len(WRITTEN_SUFFIXES)
    assert {entry.name for entry in FORMATS} > set(SAMPLES)


@EVERY
def test_content_tells_one_format(entry, samples):
    head = samples[entry.name].read_bytes()
    assert [one.name for one in FORMATS if one.sniff(head)] == [entry.name]
    assert recognise(head) is entry


@pytest.mark.parametrize(
    "content",
    [
        b"", b"\n\t \n", b"<robot/>", b"time,x\n1,2\n", b'{"labels": []}', b"PK\x03\x04",
        b"\x89PNG\r\n\x1a\n\0\0", b"# Notes\n\nrun 2 was better\n", b"Frame\tTime\n1\t0.0\n",
    ],
)  # fmt: skip
def test_what_is_no_recording_is_of_no_format(content, tmp_path):
    assert recognise(content) is None
    path = tmp_path / "x"
    path.write_bytes(content)
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    for entry in FORMATS:
        assert entry.name in str(caught.value)


@EVERY
@CONCLUDING
def test_a_sample_comes_back(entry, samples):
    path, written = samples[entry.name], recording_of()
    read = read_recording(path)
    assert_same(read, read_recording(path))
    assert read.rate_hz == written.rate_hz
    assert read.source == path.name
    np.testing.assert_allclose(np.diff(read.time), np.diff(written.time), atol=1e-9)
    if entry.name != LOG:
        assert read.names == written.names
        assert entry.name in UNCOUNTED or read.first_frame == written.first_frame
        np.testing.assert_allclose(read.positions, written.positions, atol=1e-6)


@WRITTEN
def test_what_is_written_is_read(entry, tmp_path):
    written = recording_of((None, "elbow", None), gaps=True)
    path = tmp_path / f"a{entry.suffixes[0].upper()}"
    write_recording(written, path)
    read = read_recording(path)
    np.testing.assert_allclose(read.positions, written.positions, atol=1e-6)
    np.testing.assert_allclose(read.time, written.time, atol=1e-9)
    assert (read.names, read.first_frame) == (written.names, written.first_frame)
    # Once rounded, nothing changes any more.
    again = tmp_path / "again" / path.name
    again.parent.mkdir()
    write_recording(read, again)
    assert again.read_bytes() == path.read_bytes()
    assert_same(read_recording(again), read)


@EVERY
@CONCLUDING
def test_line_ends_and_marks_of_encoding_change_nothing(entry, samples, tmp_path):
    content = samples[entry.name].read_bytes()
    if b"\0" in content:
        pytest.skip("no text")
    path = tmp_path / "windows"
    path.write_bytes(b"\xef\xbb\xbf" + content.replace(b"\n", b"\r\n"))
    assert_same(read_recording(path), read_recording(samples[entry.name]))


# Of what is damaged, only what was concluded may be warned of.
CONCLUDED = pytest.mark.filterwarnings("error", "ignore::besman.exceptions.RecordingWarning")


@EVERY
@CONCLUDED
def test_a_cut_file_ends_in_one_line_or_earlier(entry, samples, tmp_path):
    content, path = samples[entry.name].read_bytes(), tmp_path / "cut"
    whole = read_recording(samples[entry.name])
    outcomes = set()
    # Among them are all that end within the first lines: headers without numbers.
    for length in {*range(60), *np.linspace(0, len(content) - 1, N_CUTS).astype(int).tolist()}:
        path.write_bytes(content[:length])
        try:
            read = read_recording(path)
        except RecordingError as error:
            assert_one_line(error, path)
            outcomes.add("refused")
        else:
            n = len(read.time)
            assert n <= len(whole.time)
            np.testing.assert_array_equal(read.time, whole.time[:n])
            # The last number may have lost digits.
            np.testing.assert_array_equal(read.positions[: n - 1], whole.positions[: n - 1])
    assert outcomes == {"refused"}


@EVERY
@CONCLUDED
def test_damage_ends_in_one_line(entry, samples, tmp_path):
    content, path = samples[entry.name].read_bytes(), tmp_path / "damaged"
    random = np.random.default_rng(1)
    refused = 0
    for trial in range(N_CUTS):
        damaged = bytearray(content)
        # Few flips that may go unnoticed, and noise in place of all that follows the beginning.
        for at in random.integers(0, len(content), 1 + trial % 3):
            damaged[at] = random.integers(256)
        if trial % 4 == 0:
            damaged[64:] = random.bytes(500)
        path.write_bytes(damaged)
        try:
            assert len(read_recording(path).time) >= 2
        except RecordingError as error:
            assert_one_line(error, path)
            refused += 1
    assert refused >= N_CUTS // 4


@EVERY
def test_one_frame_is_no_recording(entry, tmp_path):
    path = write_sample(entry, tmp_path / "one", n_samples=1)
    with pytest.raises(RecordingError, match=r"one: (a recording of one frame|one row); expected"):
        read_recording(path)


@EVERY
def test_a_file_that_is_not_there(entry, tmp_path):
    with pytest.raises(RecordingError, match="no such file") as caught:
        entry.read(tmp_path / "absent")
    assert_one_line(caught.value, tmp_path)


@EVERY
def test_folders_and_companions(entry, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    path = write_sample(entry, folder / f"run2{entry.suffixes[-1]}")
    (folder / "notes.csv").write_text("a,b\n1,2\n")
    assert find_recordings([folder]) == [path]
    for companion in find_companions(path):
        assert companion.is_file()
        assert companion != path
    # A damaged file that ends like a recording must not go unnoticed.
    for suffix in entry.own_suffixes:
        (folder / f"run1{suffix}").touch()
    assert len(find_recordings([folder])) == 1 + len(entry.own_suffixes)


def test_messages_help_and_page_go_through_the_table(tmp_path):
    with pytest.raises(RecordingError) as caught:
        write_recording(recording_of(), tmp_path / "x.unknown")
    assert f"the ending must be {one_of(WRITTEN_SUFFIXES)}" in str(caught.value)
    wide = {"COLUMNS": "1000"}
    told = CliRunner().invoke(app, ["label-markers", "--help"], env=wide).output
    assert f"File to write, {one_of(WRITTEN_SUFFIXES)}." in told
    told = CliRunner().invoke(app, ["segment", "--help"], env=wide).output
    for entry in FORMATS:
        assert entry.name in told
    page = (TOP / "docs/howto/recording.md").read_text()
    assert "{table-of} besman.io.recordings.formats:FORMATS" in page


def test_every_module_of_the_folder_is_used_by_the_table():
    """A reader that nobody entered is found."""
    folder = Path(format_module.__file__).parent
    entered = {entry.reader.split(":")[0] for entry in FORMATS}
    readers = {
        path.stem for path in folder.glob("*.py") if re.search(r"^def read_\w+\(path: Path[,)]",
        path.read_text(), re.MULTILINE)
    }  # fmt: skip
    assert readers - {"formats", "true_names"} == entered


def test_the_table_loads_no_reader(samples):
    code = (
        "import sys; from pathlib import Path; from besman.io.recordings import formats\n"
        "print(sorted(m for m in sys.modules if m.startswith('besman.io.recordings.')))\n"
        "print('numpy' in sys.modules)\n"
        f"formats.read_recording(Path({str(samples['Qualisys TSV'])!r}))\n"
        "print(sorted(m for m in sys.modules if m.startswith('besman.io.recordings.')))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=TOP
    )
    table, numpy, after = done.stdout.splitlines()
    assert table == str(["besman.io.recordings.format", "besman.io.recordings.formats"])
    assert numpy == "False"
    readers = {f"besman.io.recordings.{entry.reader.split(':')[0]}" for entry in FORMATS}
    assert readers & set(ast.literal_eval(after)) == {"besman.io.recordings.qtm_tsv"}
