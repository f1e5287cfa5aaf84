"""Qualisys TSV, old and new: frames by markers, in millimetres."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.records import Recording

FloatArray = npt.NDArray[np.float64]

_KEY = re.compile(r"[A-Z][A-Z_]+")
# How exports spell a trajectory that nobody has identified.
_UNIDENTIFIED = re.compile(r"\*\d*|New[ _-]*\d+|(Unidentified|Unlabel+ed)[ _-]*\d*", re.IGNORECASE)
# Times are rounded in the file; a clock that disagrees more than this runs at another rate.
_CLOCK_TOLERANCE = 0.05
_EMPTY_CELL = re.compile(r"\t *(?=\t)")
_MISSING = re.compile(r"\bnull\b", re.IGNORECASE)
# Characters from which on compiled code pays, although it has to be loaded.
_LONG_TEXT = 8_000_000
# Rows that are formatted at once; bounds the memory of the format string.
_ROWS_AT_ONCE = 4096


@dataclass(frozen=True)
class _Header:
    """What stands above the numbers, and where the numbers start."""

    markers: tuple[str | None, ...]
    rate_hz: float | None
    frame_column: int | None
    time_column: int | None
    n_columns: int
    data_line: int


def read_tsv(path: Path) -> Recording:
    """Read a Qualisys TSV file.

    Markers are known by name, whatever the order of the columns. Gaps (``nan``, ``null`` or empty
    cells) become NaN. Unidentified trajectories, which exports leave unnamed or number (``New
    0001``), have no name; lines of events and of trajectory types are passed over.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Recording
        Positions in metres, time in seconds: ``(frame - 1) / rate``, as Qualisys counts.

    Raises
    ------
    RecordingError
        If the file is missing, empty, cut off or contradicts itself; the message names file and
        line.
    """
    lines = _read_lines(path)
    header = _read_header(lines, path)
    values = _read_numbers(lines, header, path)
    frames = _read_frames(values, header, path)
    rate_hz = _find_rate(values, header, path)
    columns = [
        column
        for column in range(header.n_columns)
        if column not in (header.frame_column, header.time_column)
    ]
    positions = values[:, columns].reshape(len(values), len(header.markers), 3) / 1000.0
    return Recording(
        time=(frames - 1) / rate_hz,
        positions=positions,
        names=tuple(
            None if name is None or _UNIDENTIFIED.fullmatch(name) else name
            for name in header.markers
        ),
        rate_hz=rate_hz,
        source=path.name,
        first_frame=int(frames[0]),
    )


def write_tsv(recording: Recording, path: Path) -> None:
    """Write a Qualisys TSV file; the same recording gives the same bytes.

    Parameters
    ----------
    recording : Recording
        What to write; positions are rounded to a micrometre, gaps are written as ``nan``.
    path : Path
        The file; replaced if it exists.
    """
    n_samples, n_markers = recording.positions.shape[:2]
    names = [name or "" for name in recording.names]
    columns = ["Frame", "Time"] + [f"{name} {axis}" for name in names for axis in "XYZ"]
    header = [
        f"NO_OF_FRAMES\t{n_samples}",
        "NO_OF_CAMERAS\t0",
        f"NO_OF_MARKERS\t{n_markers}",
        f"FREQUENCY\t{recording.rate_hz:.12g}",
        "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0",
        "DESCRIPTION\t--",
        "DATA_INCLUDED\t3D",
        "\t".join(["MARKER_NAMES", *names]),
        "\t".join([*columns, ""]),
    ]
    frames = recording.first_frame + np.arange(n_samples)
    # Adding zero turns a rounded -0.0 into 0.0.
    flat = np.round(recording.positions.reshape(n_samples, -1) * 1000.0, 3) + 0.0
    rows = np.column_stack([frames, (frames - 1) / recording.rate_hz, flat])
    line = "\t".join(["%d", "%.5f"] + ["%.3f"] * (3 * n_markers)) + "\n"
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join(header) + "\n")
        for start in range(0, n_samples, _ROWS_AT_ONCE):
            block = rows[start : start + _ROWS_AT_ONCE]
            file.write(line * len(block) % tuple(block.ravel().tolist()))


def _read_lines(path: Path) -> list[str]:
    """Read a text file into lines without line ends; blank lines at the end are left out."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Older exports are written in the code page of the recording computer.
        text = content.decode("latin-1")
    # Tabs at the end of the last line may be gaps, so only blanks and line ends go.
    lines = text.replace("\r\n", "\n").rstrip(" \n").split("\n")
    if not any(line.strip() for line in lines):
        raise RecordingError(f"{path}: the file is empty; expected a Qualisys TSV recording")
    return lines


def _read_header(lines: list[str], path: Path) -> _Header:
    """Read the lines above the numbers."""
    keys: dict[str, list[str]] = {}
    columns: list[str] | None = None
    number = 0
    for number, line in enumerate(lines):
        cells = [cell.strip() for cell in line.split("\t")]
        first = cells[0]
        if _is_column_line(cells):
            columns = cells[:-1] if cells[-1] == "" else cells
        elif _KEY.fullmatch(first) and first not in {"NULL", "NAN"}:
            keys.setdefault(first, cells[1:])
            if first == "MARKER_NAMES":
                marker_line = number + 1
        else:
            break
    else:
        number += 1
    if "MARKER_NAMES" not in keys:
        raise RecordingError(
            f"{path}: no line MARKER_NAMES before line {number + 1}; "
            "expected a Qualisys TSV recording of 3D positions"
        )
    markers = _read_marker_names(keys, marker_line, path)
    extra, n_columns = _find_time_columns(columns, lines, number, markers, path)
    frame_column, time_column = extra
    rate_hz = _read_rate(keys, path)
    return _Header(markers, rate_hz, frame_column, time_column, n_columns, number)


def _is_column_line(cells: list[str]) -> bool:
    """Tell whether a line names the columns: Frame, Time, and an X, Y, Z of each marker."""
    if cells[0].lower() in {"frame", "time"}:
        return True
    # The columns of an unidentified trajectory are called X, Y, Z and nothing else.
    return len(cells) > 2 and [f" {cell}"[-2:].upper() for cell in cells[:3]] == [" X", " Y", " Z"]


def _read_marker_names(keys: dict[str, list[str]], line: int, path: Path) -> tuple[str | None, ...]:
    """Return the names of the markers; None where the file has none."""
    names = keys["MARKER_NAMES"]
    while names and names[-1] == "":
        names = names[:-1]
    declared = keys.get("NO_OF_MARKERS", [""])[0]
    if declared.isdigit():
        names = names + [""] * (int(declared) - len(names))
        if len(names) != int(declared):
            raise RecordingError(
                f"{path}:{line}: MARKER_NAMES has {len(names)} names, "
                f"expected NO_OF_MARKERS = {declared}"
            )
    if not names:
        raise RecordingError(f"{path}:{line}: MARKER_NAMES is empty; expected at least one marker")
    named = [name for name in names if name and not _UNIDENTIFIED.fullmatch(name)]
    twice = sorted({name for name in named if named.count(name) > 1})
    if twice:
        raise RecordingError(
            f"{path}:{line}: {named.count(twice[0])} markers are named {twice[0]!r}; "
            "expected each name once"
        )
    return tuple(name or None for name in names)


def _find_time_columns(
    columns: list[str] | None,
    lines: list[str],
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
                f"({expected[0]!r} to {expected[-1]!r}), got {len(columns) - n_extra}"
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


def _read_rate(keys: dict[str, list[str]], path: Path) -> float | None:
    """Return frames per second, None if the clock was an external one."""
    text = (keys.get("FREQUENCY") or [""])[0]
    if text.upper() in {"EXT", ""}:
        return None
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = float("nan")
    if not (np.isfinite(rate_hz) and rate_hz > 0):
        raise RecordingError(f"{path}: FREQUENCY is {text!r}; expected frames per second or EXT")
    return rate_hz


def _read_numbers(lines: list[str], header: _Header, path: Path) -> FloatArray:
    """Parse the body, shape (T, columns), in the file's units."""
    body = lines[header.data_line :]
    if not body:
        raise RecordingError(f"{path}:{len(lines)}: no frames after the header; is the file cut?")
    width = header.n_columns
    n_tabs = np.fromiter(map(str.count, body, ["\t"] * len(body)), np.int64, len(body))
    wrong = np.flatnonzero((n_tabs != width) & (n_tabs != width - 1))
    if wrong.size == 0:
        # A tab at the end of a line is punctuation only where all cells stand before it.
        trailing = np.flatnonzero(n_tabs == width)
        bad = [row for row in trailing if body[row][-1:].strip()]
        wrong = np.array(bad[:1], dtype=np.int64)
    if wrong.size:
        row = int(wrong[0])
        raise RecordingError(
            f"{path}:{header.data_line + row + 1}: got {n_tabs[row] + 1} columns, "
            f"expected {width}; is the file cut?"
        )
    text = "\n".join(
        line[:-1] if tabs == width else line for line, tabs in zip(body, n_tabs, strict=True)
    )
    if len(text) > _LONG_TEXT:
        from besman.io.recordings.number_kernel import parse_numbers

        found = parse_numbers(text, len(body) * width)
        if found is not None:
            return found.reshape(len(body), width)
    text = _MISSING.sub("nan", "\t" + text.replace("\n", "\t\n\t") + "\t")
    cells = _EMPTY_CELL.sub("\tnan", text).replace("\t\n", "").strip("\t").split("\t")
    try:
        values = np.fromiter(map(float, cells), np.float64, len(cells))
    except ValueError:
        values = np.array([np.inf])
    if np.isinf(values).any():
        _raise_bad_cell(cells, header, path)
    return values.reshape(len(body), width)


def _raise_bad_cell(cells: list[str], header: _Header, path: Path) -> None:
    """Name the first cell that is not a number."""
    for index, cell in enumerate(cells):
        try:
            usable = not np.isinf(float(cell))
        except ValueError:
            usable = False
        if not usable:
            row, column = divmod(index, header.n_columns)
            raise RecordingError(
                f"{path}:{header.data_line + row + 1}: column {column + 1}: got {cell.strip()!r}, "
                "expected a number, nan, null or nothing"
            )


def _read_frames(values: FloatArray, header: _Header, path: Path) -> npt.NDArray[np.int64]:
    """Return the frame number of every row; they must count up by one."""
    if header.frame_column is None:
        return np.arange(1, len(values) + 1)
    frames = values[:, header.frame_column]
    line = header.data_line + 1
    unclear = np.flatnonzero(~(frames == np.round(frames)))
    if unclear.size:
        row = int(unclear[0])
        raise RecordingError(
            f"{path}:{line + row}: frame is {frames[row]:g}; expected a whole number"
        )
    jumps = np.flatnonzero(np.diff(frames) != 1)
    if jumps.size:
        row = int(jumps[0]) + 1
        raise RecordingError(
            f"{path}:{line + row}: frame {frames[row]:.0f} follows frame {frames[row - 1]:.0f}; "
            "expected frames that rise by one"
        )
    return frames.astype(np.int64)


def _find_rate(values: FloatArray, header: _Header, path: Path) -> float:
    """Return the declared rate, or the one that the time column shows."""
    _check_times(values, header, path)
    if header.rate_hz is not None:
        return header.rate_hz
    if header.time_column is None or len(values) < 2:
        raise RecordingError(
            f"{path}: FREQUENCY is not a number and there is no Time column of two frames or more "
            "to tell the rate from"
        )
    time = values[:, header.time_column]
    # Times are rounded in the file, so the whole span tells the rate best.
    return float(np.round((len(values) - 1) / (time[-1] - time[0]), 3))


def _check_times(values: FloatArray, header: _Header, path: Path) -> None:
    """Refuse times that are missing or do not rise."""
    if header.time_column is None:
        return
    time = values[:, header.time_column]
    wrong = np.flatnonzero(~(np.diff(time, prepend=-np.inf) > 0))
    if wrong.size:
        row = int(wrong[0])
        before = f" after {time[row - 1]:g} s" if row else ""
        raise RecordingError(
            f"{path}:{header.data_line + row + 1}: time is {time[row]:g} s{before}; "
            "expected rising times"
        )
    if header.rate_hz is not None and len(time) > 1:
        shown_hz = (len(time) - 1) / (time[-1] - time[0])
        if abs(shown_hz / header.rate_hz - 1.0) > _CLOCK_TOLERANCE:
            raise RecordingError(
                f"{path}: FREQUENCY is {header.rate_hz:g} but the Time column counts "
                f"{shown_hz:.4g} frames a second; expected the same"
            )
