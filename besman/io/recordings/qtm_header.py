"""The header of a Qualisys TSV: markers, rate, and where the numbers start."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from besman.exceptions import RecordingError
from besman.foreign.numbers import parse_number, parse_whole_number
from besman.records.recordings import RATES_HZ

_KEY = re.compile(r"[A-Z][A-Z_]+")
# How exports spell a trajectory that nobody has identified.
_UNIDENTIFIED = re.compile(r"\*\d*|New[ _-]*\d+|(Unidentified|Unlabel+ed)[ _-]*\d*", re.IGNORECASE)


@dataclass(frozen=True)
class QtmHeader:
    """What stands above the numbers, and where the numbers start.

    Attributes
    ----------
    markers : tuple of str or None
        Names as written, None where there is none.
    rate_hz : float or None
        Frames per second; None if the clock was an external one.
    n_frames : int or None
        Of the whole take, of which the file may hold a part; None if the file does not say.
    frame_column, time_column : int or None
        Columns that are no positions.
    n_columns : int
    data_line : int
        Index of the first line of numbers.
    """

    markers: tuple[str | None, ...]
    rate_hz: float | None
    n_frames: int | None
    frame_column: int | None
    time_column: int | None
    n_columns: int
    data_line: int

    @property
    def names(self) -> tuple[str | None, ...]:
        """Names of the trajectories; None of those that nobody has identified."""
        return tuple(
            None if name is None or _UNIDENTIFIED.fullmatch(name) else name for name in self.markers
        )


def read_header(lines: Sequence[str], path: Path) -> QtmHeader:
    """Read the lines above the numbers.

    Parameters
    ----------
    lines : sequence of str
        Of the whole file.
    path : Path
        Named in errors.

    Raises
    ------
    RecordingError
        If a line is missing, or contradicts another one.
    """
    keys: dict[str, tuple[int, list[str]]] = {}
    columns: list[str] | None = None
    number = 0
    for number, line in enumerate(lines):
        cells = [cell.strip() for cell in line.split("\t")]
        # Some programs that cut takes write blanks behind a key.
        first, *rest = cells[0].split(None, 1) or [""]
        if _is_column_line(cells):
            columns = cells[:-1] if cells[-1] == "" else cells
        elif _KEY.fullmatch(first) and first not in {"NULL", "NAN"}:
            keys.setdefault(first, (number + 1, [*rest, *cells[1:]]))
        else:
            break
    else:
        number += 1
    if "MARKER_NAMES" not in keys:
        raise RecordingError(
            f"{path}: no line MARKER_NAMES before line {number + 1}; "
            "expected a Qualisys TSV recording of 3D positions"
        )
    # Of every marker three numbers are in the first line that has all columns.
    widest = max(len(columns or ()), lines[number].count("\t") + 1 if number < len(lines) else 0)
    markers = _read_marker_names(keys, widest // 3, path)
    extra, n_columns = _find_time_columns(columns, lines, number, markers, path)
    frame_column, time_column = extra
    rate_hz = _read_rate(keys, path)
    n_frames = _read_count(keys, "NO_OF_FRAMES", path)
    return QtmHeader(markers, rate_hz, n_frames, frame_column, time_column, n_columns, number)


def _is_column_line(cells: list[str]) -> bool:
    """Tell whether a line names the columns: Frame, Time, and an X, Y, Z of each marker."""
    if cells[0].lower() in {"frame", "time"}:
        return True
    # The columns of an unidentified trajectory are called X, Y, Z and nothing else.
    return len(cells) > 2 and [f" {cell}"[-2:].upper() for cell in cells[:3]] == [" X", " Y", " Z"]


def _read_count(keys: dict[str, tuple[int, list[str]]], key: str, path: Path) -> int | None:
    """Return a declared number; None if the file does not say it."""
    line, cells = keys.get(key, (0, []))
    if not cells or not cells[0]:
        return None
    try:
        count = parse_whole_number(cells[0])
    except ValueError:
        count = -1
    if count < 0:
        raise RecordingError(f"{path}:{line}: {key} is {cells[0]!r:.60}; expected a whole number")
    return count


def _read_marker_names(
    keys: dict[str, tuple[int, list[str]]], most: int, path: Path
) -> tuple[str | None, ...]:
    """Return the names of the markers; None where the file has none."""
    line, names = keys["MARKER_NAMES"]
    while names and names[-1] == "":
        names = names[:-1]
    declared = _read_count(keys, "NO_OF_MARKERS", path)
    if declared is not None and len(names) < declared <= most:
        names = names + [""] * (declared - len(names))
    if declared is not None and len(names) != declared:
        raise RecordingError(
            f"{path}:{line}: MARKER_NAMES has {len(names)} names, "
            f"expected NO_OF_MARKERS = {declared}"
        )
    if not names:
        raise RecordingError(f"{path}:{line}: MARKER_NAMES is empty; expected at least one marker")
    seen = set[str]()
    for name in names:
        if name in seen and not _UNIDENTIFIED.fullmatch(name):
            raise RecordingError(
                f"{path}:{line}: {names.count(name)} markers are named {name!r:.60}; "
                "expected each name once"
            )
        seen.update({name} - {""})
    return tuple(name or None for name in names)


def _find_time_columns(
    columns: list[str] | None,
    lines: Sequence[str],
    data_line: int,
    markers: tuple[str | None, ...],
    path: Path,
) -> tuple[tuple[int | None, int | None], int]:
    """Find the columns of frame and time, and how many columns there are."""
    n_positions = 3 * len(markers)
    if columns is not None:
        lowered = [column.lower() for column in columns[:2]]
        frame = lowered.index("frame") if "frame" in lowered else None
        time = lowered.index("time") if "time" in lowered else None
        n_extra = (frame is not None) + (time is not None)
        expected = [f"{name or ''} {axis}".strip() for name in markers for axis in "XYZ"]
        if columns[n_extra:] != expected:
            raise RecordingError(
                f"{path}:{data_line}: the columns do not fit MARKER_NAMES: expected {n_positions} "
                f"({expected[0]!r:.60} to {expected[-1]!r:.60}), got {len(columns) - n_extra}"
            )
        return (frame, time), len(columns)
    if data_line >= len(lines):
        return (None, None), n_positions
    n_cells = lines[data_line].count("\t") + 1
    # A tab at the end may stand for an empty cell or for nothing.
    possible = {n_cells, n_cells - 1} if lines[data_line].endswith("\t") else {n_cells}
    for n_extra, found in ((0, (None, None)), (2, (0, 1))):
        if n_positions + n_extra in possible:
            return found, n_positions + n_extra
    raise RecordingError(
        f"{path}:{data_line + 1}: got {n_cells} columns, expected {n_positions} for "
        f"{len(markers)} markers, or {n_positions + 2} with frame and time"
    )


def _read_rate(keys: dict[str, tuple[int, list[str]]], path: Path) -> float | None:
    """Return frames per second, None if the clock was an external one."""
    line, cells = keys.get("FREQUENCY", (0, []))
    text = cells[0] if cells else ""
    if text.upper() in {"EXT", ""}:
        return None
    try:
        rate_hz = parse_number(text.replace(",", "."))
    except ValueError:
        rate_hz = -1.0
    slowest, fastest = RATES_HZ
    if not slowest <= rate_hz <= fastest:
        raise RecordingError(
            f"{path}:{line}: FREQUENCY is {text!r:.60}; expected {slowest:g} to {fastest:g} frames "
            "per second, or EXT"
        )
    return rate_hz
