"""The compiled way to read numbers beside Python's own."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.io.recordings import number_cells
from besman.io.recordings.number_cells import parse_table, prepare
from besman.io.recordings.number_kernel import read_table
from besman.io.recordings.number_rows import Cells, read_rows
from besman.io.recordings.text_lines import TextLines

NUMBERS = st.one_of(
    st.decimals(-99_999, 99_999, places=3).map(str),
    st.decimals(-1, 1, places=12).map("{:f}".format),
    st.integers(-(2**53), 2**53).map(str),
    st.tuples(st.integers(0, 10**15), st.integers(-22, 5)).map("{0[0]}e{0[1]}".format),
    st.sampled_from(["+2.", ".25", "-0.0", "-.5", "-1.5E-3", "1e+2", "007", " 1.5  "]),
)
CELLS = st.one_of(NUMBERS, st.sampled_from(["", " ", "nan", "NaN", "null", "NULL", "NA", "na "]))


def as_float(cell):
    stripped = cell.strip().lower()
    return np.nan if stripped in ("", "null", "na") else float(stripped)


def read(text, n_rows, n_columns, is_strict=True, separator=b"\t", point=b"."):
    codes = np.frombuffer((text + "\n").encode(), np.uint8)
    values = np.full((n_rows, n_columns), 7.0)
    return read_table(codes, separator[0], point[0], is_strict, values), values


@settings(deadline=None)
@given(st.lists(st.tuples(NUMBERS, CELLS, CELLS), min_size=1, max_size=12), st.booleans())
def test_values_are_those_of_float_to_the_last_bit(rows, ended):
    text = "\n".join("\t".join(row) + "\t" * ended for row in rows)
    n_read, values = read(text, len(rows), 3)
    expected = np.array([[as_float(cell) for cell in row] for row in rows])
    assert n_read == len(rows)
    assert values.tobytes() == np.where(np.isnan(expected), np.nan, expected).tobytes()


@pytest.mark.parametrize(
    "cell",
    ["x", "inf", "1e400", "nanx", "nul", "n", "nu", "1.2.3", "1 2", "--1", "-", "+", "1-2", ".",
     "1,5", "\u00b2", "1_0", "0x1", "nan(1)", "5null", "nullnull", "e5", "1e", "1\r", "\x0b",
     "-nan", "1e-30", "9007199254740993", "1234567890123456789", "9" * 400, "0." + "1" * 30],
)  # fmt: skip
@pytest.mark.parametrize("row", ["{}\t1", "1\t{}"])
def test_what_is_not_exact_or_not_plain_is_left_to_others(cell, row):
    text = "1\t2\n" + row.format(cell) + "\n3\t4"
    assert read(text, 3, 2)[0] == 1
    # The last cell of all, too.
    assert read("1\t2\n" + row.format(cell), 2, 2)[0] == 1


@pytest.mark.parametrize(
    ("row", "strict", "loose"),
    [("1\t2", 1, 1), ("1\t2\t", 1, 1), ("1\t2\t ", 1, 1), ("1\t2\t\t", 0, 1), ("1", 0, 1),
     ("1\t2\t3", 0, 0), ("\t", 0, 0), ("", 0, 0), (" \t ", 0, 0), ("\t2", 1, 1)],
)  # fmt: skip
def test_how_many_cells_a_line_may_have(row, strict, loose):
    assert read(row, 1, 2, True)[0] == strict
    n_read, values = read(row, 1, 2, False)
    assert n_read == loose
    if row == "1":
        np.testing.assert_array_equal(values, [[1.0, np.nan]])


def test_commas_for_points():
    n_read, values = read("1,5;-2\n;3,25", 2, 2, separator=b";", point=b",")
    assert n_read == 2
    np.testing.assert_array_equal(values, [[1.5, -2.0], [np.nan, 3.25]])


@pytest.mark.parametrize("separator", [b"\t", b",", b";"])
def test_rows_are_the_same_with_and_without(separator, tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    cells = rng.normal(size=(200, 5)).round(3).astype("U9")
    cells[rng.random(cells.shape) < 0.1] = ""
    cells[:, 0] = np.arange(200)
    rows = [separator.decode().join(row) + separator.decode() * (k % 3) for k, row in
            enumerate(cells)]  # fmt: skip
    # One that the kernel leaves to others.
    rows[100] = rows[100].replace("100", "100.00000000000000000001", 1)
    content = "\n".join(rows).encode()
    lines = TextLines(lambda first: [content[first:]])
    found = read_rows(lines, 0, 5, Cells(separator), tmp_path)
    monkeypatch.setattr(number_cells, "_KERNEL", "not there")
    assert read_rows(lines, 0, 5, Cells(separator), tmp_path).tobytes() == found.tobytes()


def test_the_kernel_is_loaded_where_there_is_much_to_read(monkeypatch):
    loaded = []
    monkeypatch.setattr(number_cells, "_KERNEL", "not there")
    monkeypatch.setattr(number_cells, "import_module", loaded.append)
    monkeypatch.setattr(number_cells._Work, "n_bytes", 0)
    monkeypatch.setattr(number_cells, "_WORTH_KERNEL", 9)
    assert "numba" in sys.modules
    for _ in range(2):
        prepare(4)
    assert loaded == []
    assert parse_table(b"1\t2", 1, 2, b"\t", b".", True) is None
    prepare(1)
    assert loaded == ["not there"]
    monkeypatch.undo()
    np.testing.assert_array_equal(parse_table(b"1\t2", 1, 2, b"\t", b".", True), [[1.0, 2.0]])
