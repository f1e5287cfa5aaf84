"""Lines, columns, numbers and times of a table of joint angles."""

from pathlib import Path

import numpy as np
import pytest

from besman.exceptions import RecordingError
from besman.io.recordings.joint_table import (
    is_last_row_cut,
    rate_of_times,
    table_head,
    table_lines,
    table_values,
)

PLACE = Path("a.csv")


def test_a_table_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# urdf: arm\n# Frames: a=b\ntime_s,a\n0,1.5\n0.5,-2\n")
    lines, is_ended = table_lines(path)
    assert is_ended
    comments, columns, first = table_head(lines, path)
    assert comments == {"urdf": "arm", "frames": "a=b"}
    assert (columns, first) == (["time_s", "a"], 3)
    values = table_values(lines[first:], columns, first, path)
    np.testing.assert_array_equal(values, [[0, 1.5], [0.5, -2]])
    assert rate_of_times(values[:, 0], first, path) == 2.0


def test_a_last_row_with_fewer_cells_or_digits_was_cut():
    rows = ["0.00,1.25", "0.10,1.50", "0.20,1.75"]
    assert not is_last_row_cut(rows, ["time_s", "a"])
    assert is_last_row_cut([*rows, "0.30,1."], ["time_s", "a"])
    assert is_last_row_cut([*rows, "0.30"], ["time_s", "a"])


def test_what_is_no_table():
    with pytest.raises(RecordingError, match=r"a.csv:1: columns 'x, y'; expected time_s and one"):
        table_head(["x,y"], PLACE)
    with pytest.raises(RecordingError, match=r"a.csv:1: no line of columns; is the file cut?"):
        table_head(["# x"], PLACE)
    with pytest.raises(RecordingError, match=r"a.csv:4: got '1,x'; expected 2 numbers"):
        table_values(["0,1", "1,x"], ["time_s", "a"], 2, PLACE)
    with pytest.raises(RecordingError, match=r"a.csv:5: time is 0\.1 s after 0\.2 s"):
        rate_of_times(np.array([0.0, 0.1, 0.2, 0.1]), 1, PLACE)
