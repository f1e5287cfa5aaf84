from pathlib import Path

import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.qtm_header import read_header

PATH = Path("a.tsv")
HEAD = ["NO_OF_FRAMES\t2", "NO_OF_MARKERS\t3", "FREQUENCY\t250", "MARKER_NAMES\tHand\tNew 1\t"]
ROW = "\t".join("123456789")


def read(*lines):
    return read_header(list(lines), PATH)


def test_markers_rate_and_where_the_numbers_start():
    found = read(*HEAD, ROW, ROW)
    assert found.markers == ("Hand", "New 1", None)
    assert found.names == ("Hand", None, None)
    assert (found.rate_hz, found.n_frames, found.data_line) == (250.0, 2, 4)
    assert (found.frame_column, found.time_column, found.n_columns) == (None, None, 9)


def test_columns_of_frame_and_time_are_found_with_and_without_their_names():
    axes = [f"{name} {axis}".strip() for name in ("Hand", "New 1", "") for axis in "XYZ"]
    named = read(*HEAD, "\t".join(["Frame", "Time", *axes]), "1\t0\t" + ROW)
    plain = read(*HEAD, "1\t0\t" + ROW)
    for found in (named, plain):
        assert (found.frame_column, found.time_column, found.n_columns) == (0, 1, 11)
    assert (named.data_line, plain.data_line) == (5, 4)


@pytest.mark.parametrize("text", ["EXT", ""])
def test_an_external_clock_has_no_rate(text):
    assert read(*HEAD[:2], f"FREQUENCY\t{text}", HEAD[3], ROW).rate_hz is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({3: "DATA_INCLUDED\t3D"}, "no line MARKER_NAMES before line 5"),
        ({2: "FREQUENCY\t1_0"}, "a.tsv:3: FREQUENCY is '1_0'; expected"),
        ({1: "NO_OF_MARKERS\t2.5"}, "a.tsv:2: NO_OF_MARKERS is '2.5'; expected a whole number"),
        ({1: "NO_OF_MARKERS\t5"}, "MARKER_NAMES has 2 names, expected NO_OF_MARKERS = 5"),
        ({3: "MARKER_NAMES\tHand\tHand\tB"}, "2 markers are named 'Hand'; expected each name once"),
        ({1: "", 3: "MARKER_NAMES\t"}, "no line MARKER_NAMES|MARKER_NAMES is empty"),
        ({4: "1\t2\t3\t4"}, "got 4 columns, expected|NO_OF_MARKERS"),
    ],
)
def test_lines_that_contradict_each_other_are_refused(change, message):
    lines = [*HEAD, ROW]
    for at, line in change.items():
        lines[at] = line
    with pytest.raises(RecordingError, match=message):
        read(*lines)
