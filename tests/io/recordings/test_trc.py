# ruff: noqa: E501
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foreign_recordings import trc_lines, write_lines, y_up

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.recordings.formats import read_recording, recognise
from besman.io.recordings.trc import read_trc
from besman.records import Recording

RNG = np.random.default_rng(0)
CONCLUDING = pytest.mark.filterwarnings("ignore::besman.exceptions.RecordingWarning")


def walk(names=("Top.Head", "R Shoulder", "hand"), first_frame=1, n_samples=20, gaps=True):
    time = np.arange(n_samples) / 50
    positions = RNG.normal([0, 0, 1], 0.3, size=(1, len(names), 3))
    positions = positions + 0.1 * np.sin(time)[:, None, None]
    if gaps:
        positions[4:6, 1] = positions[:3, -1] = np.nan
    return Recording(time, positions, names, 50.0, "a.trc", first_frame)


def assert_reads(lines, written, tmp_path, up="y", end="\n", **options):
    found = read_trc(write_lines(lines, tmp_path / "a.trc", end), **options)
    expected = y_up(written.positions) if up == "y" else written.positions
    np.testing.assert_allclose(found.positions, expected, atol=2e-6)
    np.testing.assert_allclose(found.time, written.time, atol=1e-6)
    assert (found.names, found.rate_hz) == (written.names, written.rate_hz)
    assert found.first_frame == written.first_frame
    return found


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("first_frame", [0, 1, 77])
@pytest.mark.parametrize("sep", ["\t", ",", ";"])
def test_separators_and_frames(tmp_path, sep, first_frame, end):
    written = walk(first_frame=first_frame)
    assert_reads(trc_lines(written, sep), written, tmp_path, end=end)


@pytest.mark.parametrize(
    ("units", "scale"), [("mm", 1000), ("m", 1), ("cm", 100), ("meters", 1), ("Millimeters", 1000)]
)
def test_units(tmp_path, units, scale):
    written = walk()
    found = assert_reads(trc_lines(written, units=units, scale=scale), written, tmp_path)
    assert found.origin.units_by == "the file"


def test_another_word_for_the_units_is_decided_by_size(tmp_path):
    written = walk()
    with pytest.warns(RecordingWarning, match=r"Units is 'N'; .* taken for mm, by the size"):
        assert_reads(trc_lines(written, units="N"), written, tmp_path)
    assert_reads(trc_lines(written, units="N", scale=100), written, tmp_path, units="cm")


@pytest.mark.parametrize("blank", [None, "", "\t\t\t", "\t" * 30])
def test_the_line_below_the_header(tmp_path, blank):
    written = walk()
    lines = [line for line in trc_lines(written, blank=blank) if line is not None]
    assert_reads(lines, written, tmp_path)


def test_doubled_tabs_padded_cells_and_blanks(tmp_path):
    written = walk(gaps=False)
    lines = trc_lines(written)
    doubled = [*lines[:6], *(line.replace("\t", "\t\t") for line in lines[6:])]
    assert_reads(doubled, written, tmp_path)
    padded = [*lines[:6], *(line.replace("\t", "\t   ") for line in lines[6:])]
    assert_reads(padded, written, tmp_path)
    bare = walk(("a", "b", "c"), gaps=False)
    blanks = [line.replace("\t", " ") for line in trc_lines(bare)]
    assert_reads(blanks, bare, tmp_path)


def test_lines_that_end_at_gaps_or_in_more_tabs(tmp_path):
    written = walk()
    lines = trc_lines(written)
    assert_reads([*lines[:6], *(line.rstrip("\t") for line in lines[6:])], written, tmp_path)
    assert_reads([*lines[:6], *(line + "\t\t" for line in lines[6:])], written, tmp_path)


@pytest.mark.parametrize("word", ["NaN", "nan", "NA", "-nan(ind)", "1.#QNAN"])
def test_words_for_gaps(tmp_path, word):
    written = walk()
    lines = trc_lines(written)
    rows = [
        line.replace("\t\t", f"\t{word}\t").replace("\t\t", f"\t{word}\t") for line in lines[6:]
    ]
    assert_reads([*lines[:6], *rows], written, tmp_path)


def test_names_apart_by_other_numbers_of_tabs(tmp_path):
    written = walk()
    lines = trc_lines(written)
    lines[3] = "Frame#\tTime\t" + "\t".join(written.names)
    assert_reads(lines, written, tmp_path)


def test_trajectories_without_a_name(tmp_path):
    written = walk(("a", None, "c"))
    assert_reads(trc_lines(written), written, tmp_path)


def test_counts_of_the_header_that_are_wrong(tmp_path):
    written = walk()
    lines = trc_lines(written, n_markers=5)[:-2]
    cut = Recording(written.time[:-2], written.positions[:-2], written.names, 50.0, "a.trc")
    with pytest.warns(RecordingWarning, match="NumMarkers is 5 and 3 .*; NumFrames is 20 and 18"):
        assert_reads(lines, cut, tmp_path)


def test_missing_frames_become_gaps(tmp_path):
    written = walk(gaps=False)
    lines = trc_lines(written)
    with pytest.warns(RecordingWarning, match="2 frames are missing .* before frame 8 in line 12"):
        found = read_trc(write_lines([*lines[:11], *lines[13:]], tmp_path / "a.trc"))
    assert np.flatnonzero(np.isnan(found.positions[:, 0, 0])).tolist() == [5, 6]
    np.testing.assert_allclose(found.time, written.time, atol=1e-6)


def test_the_times_count_more_than_the_header(tmp_path):
    written = walk()
    lines = [line.replace("50\t50", "200\t200") for line in trc_lines(written)]
    with pytest.warns(RecordingWarning, match="header says 200 frames a second and the times 50"):
        assert_reads(lines, written, tmp_path)


def test_which_way_is_up(tmp_path):
    names = ("Head", "LShoulder", "LKnee", "LAnkle")
    written = walk(names, gaps=False)
    high = Recording(
        written.time, written.positions + np.array([[0, 0, 0.7], [0, 0, 0.4], [0, 0, -0.6], [0, 0, -1]]),
        names, 50.0, "a",
    )  # fmt: skip
    for up in "yz":
        path = write_lines(trc_lines(high, up=up), tmp_path / f"{up}.trc")
        found = read_recording(path)
        np.testing.assert_allclose(found.positions, high.positions, atol=2e-6)
        assert found.origin.up == up


@CONCLUDING
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: lines[:1], "no line of names that begins with Frame"),
        (lambda lines: lines[:5], "no frames after the header"),
        (lambda lines: [*lines[:6], "1\tx" + lines[6][2:], *lines[7:]], "column 2: got 'x.*expected a number"),
        (lambda lines: [*lines[:8], lines[8] + "\t7", *lines[9:]], ":9: got 12 columns, expected 11"),
        (lambda lines: [*lines[:8], lines[7], *lines[9:]], "frame 2 follows frame 2; expected frames that rise"),
        (lambda lines: [*lines[:8], "3.5" + lines[8][1:], *lines[9:]], "frame is 3.5; expected a whole number"),
        (lambda lines: [*lines[:8], lines[8].replace("0.04", "0.01"), *lines[9:]], "time is 0.01 s after 0.02 s; expected rising"),
        (lambda lines: [*lines[:8], lines[8].replace("3", "33333", 1), *lines[9:]], "expected frames that rise"),
        (lambda lines: [*lines[:3], "Frame#\tTime", "", *(line.split("\t")[0] + "\t0" for line in lines[6:])], "no markers are named"),
        (lambda lines: [], "the file is empty; expected a TRC"),
        (lambda lines: lines[:7], "a recording of one frame; expected at least two"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(tmp_path, change, message):
    path = write_lines(change(trc_lines(walk(gaps=False))), tmp_path / "a.trc")
    with pytest.raises(RecordingError, match=message) as caught:
        read_trc(path)
    assert "\n" not in str(caught.value)


def test_a_rate_that_nothing_tells(tmp_path):
    lines = trc_lines(walk())
    lines[2] = lines[2].replace("50", "0")
    lines = [*lines[:6], *("\t".join([*line.split("\t")[:1], "", *line.split("\t")[2:]]) for line in lines[6:])]  # fmt: skip
    with pytest.raises(RecordingError, match="the header has 0 frames a second, and no times"):
        read_trc(write_lines(lines, tmp_path / "a.trc"))


def test_a_last_line_that_was_cut(tmp_path):
    written = walk(gaps=False)
    path = write_lines(trc_lines(written), tmp_path / "a.trc")
    whole = path.read_bytes()
    for n_bytes, message in ((3, "the line ends before those above"), (40, "columns, expected 11")):
        path.write_bytes(whole[:-n_bytes])
        with pytest.raises(RecordingError, match=rf"{message}.*is the file cut\? --partial takes"):
            read_trc(path)
        with pytest.warns(RecordingWarning, match="NumFrames is 20 and 19 frames follow"):
            assert len(read_trc(path, partial=True).time) == 19


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(RecordingError, match="cannot be read"):
        read_trc(Path(tmp_path))


@pytest.mark.parametrize("sep", ["\t", ";"])
def test_decimal_commas_in_header_and_rows(tmp_path, sep):
    written = replace(walk(), rate_hz=12.5, time=np.arange(20) / 12.5)
    lines = trc_lines(written, sep, units="m", scale=1.0, digits=9)
    german = [*lines[:2], *(line.replace(".", ",") for line in lines[2:])]
    german[3] = lines[3]
    assert assert_reads(german, written, tmp_path).origin.units_by == "the file"


@pytest.mark.parametrize(
    ("encoding", "end"),
    [("utf-16", "\r\n"), ("utf-16-be", "\n"), ("utf-8", "\r"), ("utf-16", "\r")],
)
def test_as_excel_saves_unicode_text_and_for_old_macs(tmp_path, encoding, end):
    written = walk(("\u00c9paule", "Coude", "Main"))
    path = tmp_path / "a.txt"
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    path.write_bytes((mark + end.join(trc_lines(written)) + end).encode(encoding))
    found = read_trc(path)
    np.testing.assert_allclose(found.positions, y_up(written.positions), atol=2e-6)
    assert found.names == written.names
    assert recognise(path.read_bytes()[:16_384]).name == "TRC"
