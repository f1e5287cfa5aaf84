"""Cells of text that a spreadsheet program must not compute."""

import csv

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from besman.io.csv_cells import quote_text, unquote_text
from besman.io.exports import read_joint_csv, write_joint_csv
from besman.transfer.results_table import add_row, read_results


@given(st.text(max_size=8))
@example("=1+1")
@example("'=1")
def test_a_text_is_no_formula_and_comes_back(text):
    cell = quote_text(text)
    assert not cell.startswith(("=", "+", "-", "@", "\t", "\r"))
    assert unquote_text(cell) == text


def test_a_motion_named_like_a_formula_is_written_as_text_and_found_again(tmp_path):
    path, name = tmp_path / "results.csv", "=1+1.tsv:2"
    add_row(path, name, 1)
    add_row(path, name, 1)
    header, *rows = path.read_text().splitlines()
    assert len(rows) == 1
    assert rows[0].startswith("'=1+1.tsv:2,1,")
    path.write_text(f"{header}\n'{name},1,1.5,0.25,yes,\n")
    (found,) = read_results(path, {name: 1})
    assert (found.motion, found.outcome) == (name, (1.5, 0.25))


def test_joints_named_like_a_formula_head_their_columns_as_text(tmp_path):
    path, table = tmp_path / "a.csv", np.ones((2, 1))
    write_joint_csv(path, np.arange(2.0), table, table, table, ("@sum",))
    with path.open(newline="") as file:
        header = next(csv.reader(file))
    assert header[1:] == ["'@sum_rad", "'@sum_rad_per_s", "'@sum_rad_per_s2"]
    np.testing.assert_array_equal(read_joint_csv(path)[1], table)
