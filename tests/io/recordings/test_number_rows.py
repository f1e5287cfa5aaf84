"""Cells beside a plain split and float."""

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.number_rows import Cells, find_cells, read_rows
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
