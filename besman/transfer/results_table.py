"""What was measured on the real arm: a CSV that a person fills in.

Columns: ``motion`` and ``try`` as suggested; ``x_m`` and ``y_m``, where what was thrown came down,
metres ahead of the robot's base and to its left, on the floor; ``success``, yes or no, may stay
empty; further columns are left alone. No place and ``no`` is a try that failed: nothing was thrown,
or the arm stopped. A row without place and success is still to be done.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import TransferError, nearest
from besman.foreign.numbers import parse_number, parse_whole_number
from besman.io.atomic_files import write_text
from besman.io.csv_cells import quote_text, unquote_text

FloatArray = npt.NDArray[np.float64]

COLUMNS = ("motion", "try", "x_m", "y_m", "success")
_NOTE = "note"
# Nobody throws farther here: a number beyond it is in another unit.
_FARTHEST_M = 20.0


@dataclass(frozen=True)
class MeasuredTry:
    """One row.

    Attributes
    ----------
    motion : str
    number : int
        Of the try, from 1.
    outcome : tuple of two floats
        Where it came down, metres; NaN if the try failed.
    """

    motion: str
    number: int
    outcome: tuple[float, float]


def add_row(path: Path, motion: str, number: int) -> None:
    """Add a row to be filled in; a table that has it stays as it is.

    Raises
    ------
    TransferError
        If the file is no such table.
    """
    text = ",".join((*COLUMNS, _NOTE)) + "\n"
    if path.exists():
        header, rows = _read(path)
        if any((row["motion"], row["try"].strip()) == (motion, str(number)) for _, row in rows):
            return
        text = path.read_text(encoding="utf-8-sig")
        text += "" if text.endswith("\n") else "\n"
    else:
        header = [*COLUMNS, _NOTE]
    buffer = io.StringIO()
    new = {"motion": quote_text(motion), "try": str(number)}
    csv.writer(buffer, lineterminator="\n").writerow([new.get(name, "") for name in header])
    write_text(path, text + buffer.getvalue())


def read_results(path: Path, tries: Mapping[str, int]) -> list[MeasuredTry]:
    """Read what was measured.

    Parameters
    ----------
    path : Path
        The table.
    tries : mapping of str to int
        How many tries of each motion were suggested.

    Returns
    -------
    list of MeasuredTry
        Rows that are filled in.

    Raises
    ------
    TransferError
        If a column is missing, a motion or try was never suggested, a value is none, or nothing
        is filled in.
    """
    found: dict[tuple[str, int], MeasuredTry] = {}
    for line, row in _read(path)[1]:
        where = f"{path}:{line}"
        number = _try_number(where, row, tries)
        outcome = _outcome(where, row)
        if outcome is None:
            continue
        if (row["motion"], number) in found:
            raise TransferError(f"{where}: try {number} of {row['motion']} stands there twice")
        found[row["motion"], number] = MeasuredTry(row["motion"], number, outcome)
    if not found:
        raise TransferError(
            f"{path}: no row is filled in; expected x_m and y_m in metres, or success no"
        )
    return list(found.values())


def _read(path: Path) -> tuple[list[str], list[tuple[int, dict[str, str]]]]:
    """Read header and rows with their lines."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not text"
        raise TransferError(f"{path}: cannot be read: {reason}") from None
    reader = csv.DictReader(io.StringIO(text), restval="")
    header = [name.strip() for name in reader.fieldnames or ()]
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise TransferError(
            f"{path}:1: column {missing[0]!r} is missing; got {', '.join(header) or 'nothing'}, "
            f"expected {', '.join(COLUMNS)}"
        )
    reader.fieldnames = header
    rows = [(reader.line_num, row | {"motion": unquote_text(row["motion"])}) for row in reader]
    return header, rows


def _try_number(where: str, row: dict[str, str], tries: Mapping[str, int]) -> int:
    """Return the number of a row's try, if it was suggested."""
    motion = row["motion"]
    if motion not in tries:
        raise TransferError(f"{where}: motion: got {motion!r:.80}; {nearest(motion, tries)}")
    text, n = row["try"].strip(), tries[motion]
    try:
        number = parse_whole_number(text)
    except ValueError:
        number = 0
    if not 1 <= number <= n:
        were = "was" if n == 1 else "were"
        raise TransferError(
            f"{where}: try: got {text!r:.60}; of {motion} {n} {were} suggested, 1 to {n}"
        )
    return number


def _outcome(where: str, row: dict[str, str]) -> tuple[float, float] | None:
    """Return where a row's try came down; None if it is not filled in."""
    success = row["success"].strip().lower()
    if success not in ("yes", "no", ""):
        raise TransferError(f"{where}: success: got {success!r:.60}; allowed: yes, no, or nothing")
    texts = {name: row[name].strip() for name in ("x_m", "y_m")}
    empty = [name for name, text in texts.items() if not text]
    if len(empty) == 1:
        raise TransferError(f"{where}: {empty[0]}: got nothing, expected metres, as the other has")
    if empty:
        if success == "yes":
            raise TransferError(f"{where}: success is yes; expected x_m and y_m in metres")
        return (math.nan, math.nan) if success == "no" else None
    x, y = (_metres(f"{where}: {name}", text) for name, text in texts.items())
    return x, y


def _metres(where: str, text: str) -> float:
    """Return a place's coordinate."""
    try:
        value = parse_number(text)
    except ValueError:
        raise TransferError(f"{where}: got {text!r:.60}, expected metres") from None
    if not abs(value) <= _FARTHEST_M:
        raise TransferError(
            f"{where}: got {text!r:.60}, expected metres within {_FARTHEST_M:g} of the robot"
        )
    return value
