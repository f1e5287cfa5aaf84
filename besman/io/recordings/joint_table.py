"""Tables of joint angles over time as text: their lines, columns, numbers and times."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError
from besman.foreign.numbers import has_odd_digits
from besman.io.recordings.plausibility import check_rate
from besman.records import FloatArray
from besman.records.recordings import GREATEST_FRAME

TIME_COLUMN = "time_s"
"""Name of the first column."""

ANGLE_UNITS = {"_rad": 1.0, "_deg": np.pi / 180.0}
"""Endings of columns, and what one of them is in rad."""

# A step may deviate this much from the usual one; beyond it samples were lost.
_STEP_TOLERANCE = 0.5
# Rows above the last one that it is compared with.
_ROWS_ABOVE = 100


def table_lines(path: Path) -> tuple[list[str], bool]:
    """Return the lines of a text file, and whether the last one ended.

    Raises
    ------
    RecordingError
        If it is not there, or no text.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text: {error}") from None
    return text.rstrip().split("\n") if text.strip() else [], text.endswith("\n")


def is_last_row_cut(rows: list[str], columns: list[str]) -> bool:
    """Tell whether the last row has fewer cells or digits than all rows before it."""
    if len(rows) < 3:
        return False
    before, last = (
        [len(row.rpartition(",")[2].partition(".")[2]) for row in part]
        for part in (rows[-_ROWS_ABOVE:-1], rows[-1:])
    )
    return rows[-1].count(",") < len(columns) - 1 or last[0] < min(before)


def table_head(lines: list[str], path: Path) -> tuple[dict[str, str], list[str], int]:
    """Return the comments by key, the columns, and the index of the first row of numbers.

    Raises
    ------
    RecordingError
        If there is no line of columns, or it does not begin with the time.
    """
    comments: dict[str, str] = {}
    for number, line in enumerate(lines):
        if not line.startswith("#"):
            columns = [cell.strip() for cell in next(csv.reader(io.StringIO(line)), [])]
            twice = sorted({name for name in columns if columns.count(name) > 1})
            if columns[:1] != [TIME_COLUMN] or len(columns) < 2 or twice:
                raise RecordingError(
                    f"{path}:{number + 1}: columns {', '.join(columns)!r:.80}; expected "
                    f"{TIME_COLUMN} and one column a joint, each once"
                )
            return comments, columns, number + 1
        key, _, value = line[1:].partition(":")
        comments[key.strip().lower()] = value.strip()
    raise RecordingError(f"{path}:{len(lines)}: no line of columns; is the file cut?")


def table_values(rows: list[str], columns: list[str], data_line: int, path: Path) -> FloatArray:
    """Parse the numbers, shape (T, columns).

    Raises
    ------
    RecordingError
        If a row has fewer, or one that is none.
    """
    if not rows:
        raise RecordingError(f"{path}:{data_line}: no rows after the columns; is the file cut?")
    table = np.empty((len(rows), len(columns)))
    for row, line in enumerate(rows):
        cells = line.split(",")
        try:
            table[row] = np.array(cells, dtype=np.float64)
            usable = len(cells) == len(columns) and not has_odd_digits(line)
            usable = usable and bool(np.isfinite(table[row]).all())
        except ValueError:
            usable = False
        if not usable:
            raise RecordingError(
                f"{path}:{data_line + row + 1}: got {line.strip()!r:.80}; expected "
                f"{len(columns)} numbers; is the file cut?"
            )
    return table


def rate_of_times(time: FloatArray, data_line: int, path: Path) -> float:
    """Return samples per second of times (T,), s, that rise evenly.

    Raises
    ------
    RecordingError
        If they do not, or lie too far apart.
    """
    if len(time) < 2:
        raise RecordingError(f"{path}: one row; expected at least two, to tell the rate from")
    steps = np.diff(time)
    usual = float(np.median(steps))
    wrong = np.flatnonzero(steps <= 0)
    if wrong.size == 0:
        wrong = np.flatnonzero(np.abs(steps - usual) > _STEP_TOLERANCE * usual)
    if wrong.size:
        row = int(wrong[0]) + 1
        raise RecordingError(
            f"{path}:{data_line + row + 1}: time is {time[row]:g} s after {time[row - 1]:g} s; "
            "expected times that rise evenly"
        )
    if np.abs(time).max() > GREATEST_FRAME:
        raise RecordingError(
            f"{path}: times up to {time[-1]:g} s; expected up to {GREATEST_FRAME:.0e}"
        )
    rate_hz = float(np.round(1.0 / np.mean(steps), 3))
    check_rate(rate_hz, f"{path}: {TIME_COLUMN}")
    return rate_hz
