"""Cells beside a plain split and float."""

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.recordings import text_lines
from besman.io.recordings.number_rows import Cells, find_cells, read_rows, read_tracks, see_commas
from besman.io.recordings.text_lines import TextLines

RNG = np.random.default_rng(0)


def lines_of(text):
    return TextLines(lambda first: [text.encode()[first:]])


@pytest.mark.parametrize(("sep", "cells"), [("\t", b"\t"), (",", b","), (";", b";"), ("  ", b" ")])
@pytest.mark.parametrize("gaps", [False, True])
def test_values_are_those_of_float(tmp_path, sep, cells, gaps):
    values = RNG.normal(size=(300, 6)).round(4)
    if gaps and sep != "  ":
        values[RNG.random(values.shape) < 0.3] = np.nan
        values[:, 0] = 1.0
    rows = [sep.join("" if np.isnan(one) else str(one) for one in row) for row in values]
    found = read_rows(lines_of("head\n" + "\n".join(rows) + "\n"), 1, 6, Cells(cells), tmp_path)
    np.testing.assert_array_equal(found, values)


def test_a_blank_line_ends_the_rows(tmp_path):
    for blank in ("", ",,", "  "):
        text = f"1,2,3\n4,5,6\n{blank}\nMore\n7,8,9\n"
        found = read_rows(lines_of(text), 0, 3, Cells(b","), tmp_path)
        np.testing.assert_array_equal(found, [[1, 2, 3], [4, 5, 6]])


def test_columns_that_are_no_numbers(tmp_path):
    found = read_rows(lines_of("1,a:b,3\n4,c,6\n"), 0, 3, Cells(b","), tmp_path, texts=(1,))
    np.testing.assert_array_equal(found, [[1, np.nan, 3], [4, np.nan, 6]])


def test_separators_are_told():
    assert find_cells("1\t2,5") == Cells(b"\t")
    assert find_cells("1;2,5") == Cells(b";", has_decimal_commas=True)
    assert find_cells("1;2.5") == Cells(b";")
    assert find_cells("1,2") == Cells(b",")
    assert find_cells("1 2") == Cells(b" ")


@pytest.mark.parametrize("cell", ["1_0", "٣", "inf", "1e999", "0x1"])
def test_what_is_no_number(tmp_path, cell):
    with pytest.raises(RecordingError, match=r":2: column 2: got .*, expected a number or nothing"):
        read_rows(lines_of(f"1,2\n3,{cell}\n5,6\n"), 0, 2, Cells(b","), tmp_path)


@pytest.mark.parametrize("places", [(2, 5), (5, 2), (4,)])
@pytest.mark.parametrize("gap_at", [None, 3, 40])
def test_tracks_are_columns_of_the_rows_however_the_file_is_cut(
    tmp_path, monkeypatch, places, gap_at
):
    # Rows become longer, so that the room for them has to grow.
    values = np.arange(8.0 * 60).reshape(60, 8) ** 3
    rows = [",".join(f"{one:g}" for one in row) for row in np.round(values)]
    values = np.array([[float(one) for one in row.split(",")] for row in rows])
    if gap_at is not None:
        values[gap_at, 3] = np.nan
        rows[gap_at] = ",".join("nan" if np.isnan(one) else f"{one:g}" for one in values[gap_at])
    monkeypatch.setattr(text_lines, "_AT_ONCE", 200)
    monkeypatch.setattr(text_lines, "_FIRST", 30)
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n\nMore\n1,2\n")
    lines = TextLines.of(tmp_path / "a.csv")
    lead, tracks = read_tracks(lines, 0, 8, Cells(b","), tmp_path, (1, 0), places)
    np.testing.assert_array_equal(read_rows(lines, 0, 8, Cells(b","), tmp_path), values)
    np.testing.assert_array_equal(lead, values[:, [1, 0]])
    for which, place in enumerate(places):
        np.testing.assert_array_equal(tracks[:, which], values[:, place : place + 3])


@pytest.mark.parametrize(
    ("rows", "has_commas"),
    [
        (["1\t2\t3", "2\t-,5\t3", "2\t2,5e-3\t"], True),
        (["1\t2,5\t3.5"], False),
        (["1\tHand, left\t3"], False),
        (["1\t2\t3"], False),
    ],
)
def test_commas_between_tabs_are_told_by_the_first_rows(rows, has_commas):
    assert see_commas(Cells(b"\t"), rows) == Cells(b"\t", has_decimal_commas=has_commas)
    assert see_commas(Cells(b","), rows) == Cells(b",")


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ('Frame,"Hand, left","b",c', ["Frame", "Hand, left", "b", "c"]),
        ('"a, b, c" ,"","d"', ["a, b, c", "", "d"]),
        ('a,"b,c', ["a", "b", "c"]),
        ('5" rod,6" rod,x', ['5" rod', '6" rod', "x"]),
        ("a,b", ["a", "b"]),
    ],
)
def test_a_separator_between_quotes_is_part_of_a_name(line, expected):
    assert [one.replace('"', "") for one in Cells(b",").split(line)] == [
        one.replace('"', "") for one in expected
    ]
