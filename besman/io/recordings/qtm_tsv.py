"""Qualisys TSV, old and new: frames by markers, in millimetres."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.foreign.numbers import has_odd_digits, parse_number
from besman.io.atomic_files import written_aside
from besman.io.recordings.format import READING, Columns
from besman.io.recordings.number_cells import parse_cells, parse_table, prepare
from besman.io.recordings.number_rows import ROWS_SEEN, Cells, see_commas
from besman.io.recordings.qtm_bodies import has_bodies, read_bodies
from besman.io.recordings.qtm_header import QtmHeader, read_header
from besman.io.recordings.text_lines import TextLines, count_lines, open_lines
from besman.io.warning import warn_of_file
from besman.records import Origin, Recording
from besman.records.frozen import hand_over
from besman.records.recordings import GREATEST_FRAME, RATES_HZ

FloatArray = npt.NDArray[np.float64]

# Times are rounded in the file; a clock that disagrees more than this runs at another rate.
_CLOCK_TOLERANCE = 0.05
_EMPTY_CELL = re.compile(r"\t *(?=\t)")
_MISSING = re.compile(r"\b(null|NA|N/A)(?=\s)", re.IGNORECASE)
# A step of time may deviate this much from the usual one.
_STEP_TOLERANCE = 0.5
_DECIMAL = re.compile(r"[+-]?[0-9]*\.[0-9]+")
# Lines above the last one that it is compared with.
_ROWS_ABOVE = 100
_TAKE = "--partial takes what is there"
# Rows that are formatted at once; bounds the memory of the format string.
_ROWS_AT_ONCE = 4096


def read_tsv(path: Path, partial: bool = False) -> Recording:
    """Read a Qualisys TSV file.

    Markers are known by name, whatever the order of the columns. Gaps (``nan``, ``null``, ``NA`` or
    empty cells) become NaN. Unidentified trajectories, which exports leave unnamed or number (``New
    0001``), have no name; lines of events and of trajectory types are passed over. 6D exports and
    skeletons are read as `besman.io.recordings.qtm_bodies` says.

    Parameters
    ----------
    path : Path
        The file.
    partial : bool
        Take what is there of a file that was cut.

    Returns
    -------
    Recording
        Positions in metres, time in seconds: ``(frame - 1) / rate``, as Qualisys counts.

    Raises
    ------
    RecordingError
        If the file is missing, empty, cut off or contradicts itself; the message names file and
        line. A file is cut if its last line is, or if it begins with frame 1 and has fewer frames
        than it says: what begins later is a part of a take, of which NO_OF_FRAMES counts all.

    Warns
    -----
    RecordingWarning
        If NO_OF_FRAMES says something else than the lines, or times do not rise evenly.
    """
    lines = open_lines(path, "a Qualisys TSV recording")
    if has_bodies(lines):
        return read_bodies(lines, path, partial)
    header = read_header(lines, path)
    _look_for_cut(lines, header, path, partial)
    clock, positions = _read_numbers(lines, header, path)
    frames = _read_frames(clock, header, path)
    _check_count(frames, header, path, partial)
    rate_hz = _find_rate(clock, header, path)
    positions /= 1000.0
    return Recording(
        time=(frames - 1) / rate_hz,
        positions=hand_over(positions),
        names=header.names,
        rate_hz=rate_hz,
        source=path.name,
        first_frame=int(frames[0]),
        origin=Origin(units="mm", units_by="the format"),
    )


def write_tsv(recording: Recording, path: Path, beside: Columns | None = None) -> None:
    """Write a Qualisys TSV file; the same recording gives the same bytes.

    Parameters
    ----------
    recording : Recording
        What to write; positions are rounded to a micrometre, gaps are written as ``nan``.
    path : Path
        The file; replaced if it exists.
    beside : Columns, optional
        Trajectories of the same frames that are written behind those of the recording.

    Raises
    ------
    RecordingError
        If it cannot be written.
    """
    n_samples = len(recording.time)
    names = [name or "" for name in (*recording.names, *(beside.names if beside else ()))]
    columns = ["Frame", "Time"] + [f"{name} {axis}" for name in names for axis in "XYZ"]
    header = [
        f"NO_OF_FRAMES\t{n_samples}",
        "NO_OF_CAMERAS\t0",
        f"NO_OF_MARKERS\t{len(names)}",
        f"FREQUENCY\t{recording.rate_hz:.12g}",
        "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0",
        "DESCRIPTION\t--",
        "DATA_INCLUDED\t3D",
        "\t".join(["MARKER_NAMES", *names]),
        "\t".join([*columns, ""]),
    ]
    flat = recording.positions.reshape(n_samples, -1)
    line = "\t".join(["%d", "%.5f"] + ["%.3f"] * (3 * len(names))) + "\n"
    with (
        written_aside(path, kind=RecordingError) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as file,
    ):
        file.write("\n".join(header) + "\n")
        for start in range(0, n_samples, _ROWS_AT_ONCE):
            rows = flat[start : start + _ROWS_AT_ONCE]
            if beside is not None:
                more = beside.rows(start, start + len(rows))
                rows = np.concatenate([rows, more.reshape(len(rows), -1)], axis=1)
            frames = recording.first_frame + start + np.arange(len(rows))
            # Adding zero turns a rounded -0.0 into 0.0.
            values = np.round(rows * 1000.0, 3) + 0.0
            block = np.column_stack([frames, (frames - 1) / recording.rate_hz, values])
            file.write(line * len(block) % tuple(block.ravel().tolist()))


def _look_for_cut(lines: TextLines, header: QtmHeader, path: Path, partial: bool) -> None:
    """Refuse a last line that was cut, or take it away."""
    n_rows = len(lines) - header.data_line
    if n_rows < 2:
        return
    *before, last = (line.replace(",", ".") for line in lines.last(min(_ROWS_ABOVE, n_rows)))
    width, n_tabs = header.n_columns, last.count("\t")
    if n_tabs not in (width, width - 1):
        reason = f"got {n_tabs + 1} columns, expected {width}"
    elif not lines.is_ended and _is_shorter(last, before, n_tabs):
        reason = "the line ends before those above it do"
    else:
        return
    if not partial:
        raise RecordingError(f"{path}:{len(lines)}: {reason}; is the file cut? {_TAKE}")
    lines.drop_last()


def _is_shorter(line: str, before: list[str], n_tabs: int) -> bool:
    """Tell whether a line lacks the tab at its end, or digits, that all lines before it have."""
    if all(row.count("\t") > n_tabs for row in before):
        return True
    cells = [row.split("\t")[n_tabs].strip() for row in before if row.count("\t") == n_tabs]
    last = line.split("\t")[-1].strip()
    if not last:
        return bool(cells) and all(cells)
    digits = [len(cell.rpartition(".")[2]) for cell in cells if _DECIMAL.fullmatch(cell)]
    # A number without a point has lost it, too, where all others have one.
    return bool(digits) and len(last.partition(".")[2]) < min(digits)


def _check_count(
    frames: npt.NDArray[np.int64], header: QtmHeader, path: Path, partial: bool
) -> None:
    """Hold the frames against NO_OF_FRAMES, which counts those of the file or of the whole take."""
    declared, found = header.n_frames, len(frames)
    if declared is None or declared == found:
        return
    says = f"NO_OF_FRAMES is {declared} and {found} frames follow"
    is_part = header.frame_column is not None and frames[0] > 1
    if found < declared and is_part and frames[-1] <= declared:
        return
    if found < declared and header.frame_column is not None and not (is_part or partial):
        raise RecordingError(f"{path}: {says}; is the file cut? {_TAKE}")
    warn_of_file(f"{path.name}: {says}")


def _read_numbers(lines: TextLines, header: QtmHeader, path: Path) -> tuple[FloatArray, FloatArray]:
    """Parse the body: the columns before the markers, (T, 0 to 2), and positions (T, M, 3), mm."""
    width, n_markers = header.n_columns, len(header.markers)
    n_rows, n_tabs = len(lines) - header.data_line, None
    if n_rows < 1:
        raise RecordingError(f"{path}:{len(lines)}: no frames after the header; is the file cut?")
    prepare(lines.n_bytes)
    cells = see_commas(Cells(b"\t"), lines[header.data_line : header.data_line + ROWS_SEEN])
    clock = np.empty((n_rows, width - 3 * n_markers))
    positions = np.empty((n_rows, n_markers, 3))
    row = 0
    for block in lines.blocks(header.data_line):
        rows = slice(row, row + count_lines(block))
        if rows.stop > n_rows:
            break
        if cells.has_decimal_commas:
            block = block.replace(b",", b".")
        values = parse_table(block, rows.stop - row, width, b"\t", b".", True)
        if values is None:
            n_tabs = _count_tabs(lines, header, path) if n_tabs is None else n_tabs
            if len(n_tabs) != n_rows:
                break
            values = _parse_block(block, n_tabs[rows], lines, header, path, row)
        clock[rows], places = values[:, : clock.shape[1]], values[:, clock.shape[1] :]
        positions[rows] = places.reshape(-1, n_markers, 3)
        row = rows.stop
    if row != n_rows:
        raise RecordingError(f"{path}: changed while it was read; is it still being written?")
    return clock, positions


def _parse_block(
    block: bytes,
    n_tabs: npt.NDArray[np.int64],
    lines: TextLines,
    header: QtmHeader,
    path: Path,
    first_row: int,
) -> FloatArray:
    """Parse lines whose tabs are counted; refuse cells that are no numbers."""
    text = _drop_last_tabs(block, n_tabs == header.n_columns)
    values = parse_cells(text, len(n_tabs) * header.n_columns)
    if values is None:
        values = _parse_odd_cells(lines.decode(text), header, path, first_row)
    return values.reshape(-1, header.n_columns)


def _count_tabs(lines: TextLines, header: QtmHeader, path: Path) -> npt.NDArray[np.int64]:
    """Count the tabs of every line of numbers; refuse one with more or fewer cells."""
    width, counts = header.n_columns, [np.empty(0, dtype=np.int64)]
    row = 0
    for block in lines.blocks(header.data_line):
        body = block.split(b"\n")
        n_tabs = np.fromiter((line.count(b"\t") for line in body), np.int64, len(body))
        wrong = np.flatnonzero((n_tabs != width) & (n_tabs != width - 1))
        if wrong.size == 0:
            # A tab at the end of a line is punctuation only where all cells stand before it.
            trailing = np.flatnonzero(n_tabs == width)
            bad = [k for k in trailing if body[k].rstrip(b" ")[-1:] != b"\t"]
            wrong = np.array(bad[:1], dtype=np.int64)
        if wrong.size:
            raise RecordingError(
                f"{path}:{header.data_line + row + int(wrong[0]) + 1}: got "
                f"{n_tabs[wrong[0]] + 1} columns, expected {width}; is the file cut?"
            )
        counts.append(n_tabs)
        row += len(body)
    return np.concatenate(counts)


def _drop_last_tabs(block: bytes, trailing: npt.NDArray[np.bool_]) -> bytes:
    """Take the tabs away that some lines end with."""
    if not trailing.any():
        return block
    if trailing.all() and b" \n" not in block and not block.endswith(b" "):
        return (block + b"\n").replace(b"\t\n", b"\n")[:-1]
    rows = zip(block.split(b"\n"), trailing, strict=True)
    return b"\n".join(row.rstrip(b" ")[:-1] if has_one else row for row, has_one in rows)


def _parse_odd_cells(text: str, header: QtmHeader, path: Path, first_row: int) -> FloatArray:
    """Parse cells of which not all are plain; refuse what is no number."""
    is_odd = has_odd_digits(text)
    text = _MISSING.sub("nan", "\t" + text.replace("\n", "\t\n\t") + "\t")
    cells = _EMPTY_CELL.sub("\tnan", text).replace("\t\n", "").strip("\t").split("\t")
    try:
        values = np.fromiter(map(float, cells), np.float64, len(cells))
    except ValueError:
        values = np.array([np.inf])
    if is_odd or np.isinf(values).any():
        _raise_bad_cell(cells, header, path, first_row)
    return values


def _raise_bad_cell(cells: list[str], header: QtmHeader, path: Path, first_row: int) -> None:
    """Name the first cell that is not a number."""
    for index, cell in enumerate(cells):
        try:
            usable = cell.strip().lower() == "nan" or not np.isinf(parse_number(cell))
        except ValueError:
            usable = False
        if not usable:
            row, column = divmod(index, header.n_columns)
            raise RecordingError(
                f"{path}:{header.data_line + first_row + row + 1}: column {column + 1}: got "
                f"{cell.strip()!r:.60}, expected a number, nan, null or nothing"
            )


def _read_frames(values: FloatArray, header: QtmHeader, path: Path) -> npt.NDArray[np.int64]:
    """Return the frame number of every row; they must count up by one."""
    if header.frame_column is None:
        return np.arange(1, len(values) + 1)
    frames = values[:, header.frame_column]
    line = header.data_line + 1
    unclear = np.flatnonzero(
        ~((frames == np.round(frames)) & (frames >= 0) & (frames <= GREATEST_FRAME))
    )
    if unclear.size:
        row = int(unclear[0])
        raise RecordingError(
            f"{path}:{line + row}: frame is {frames[row]:g}; expected a whole number from 0 to "
            f"{GREATEST_FRAME:.0e}"
        )
    jumps = np.flatnonzero(np.diff(frames) != 1)
    if jumps.size:
        row = int(jumps[0]) + 1
        raise RecordingError(
            f"{path}:{line + row}: frame {frames[row]:.0f} follows frame {frames[row - 1]:.0f}; "
            "expected frames that rise by one"
        )
    return frames.astype(np.int64)


def _find_rate(values: FloatArray, header: QtmHeader, path: Path) -> float:
    """Return the declared rate, or the one that the time column shows."""
    _check_times(values, header, path)
    known_hz = READING.get().rate_hz or header.rate_hz
    if known_hz is not None:
        return known_hz
    if header.time_column is None or len(values) < 2:
        raise RecordingError(
            f"{path}: FREQUENCY is not a number and there is no Time column of two frames or more "
            "to tell the rate from"
        )
    time = values[:, header.time_column]
    # Times are rounded in the file, so the whole span tells the rate best, if they rise evenly.
    steps = np.diff(time)
    step_s = float(np.median(steps) if _uneven(steps).size else np.mean(steps))
    slowest, fastest = RATES_HZ
    if not 1.0 / fastest <= step_s <= 1.0 / slowest:
        raise RecordingError(
            f"{path}: FREQUENCY is not a number and the Time column rises by {step_s:g} a frame; "
            f"expected seconds, at {slowest:g} to {fastest:g} frames per second"
        )
    return float(np.round(1.0 / step_s, 3))


def _check_times(values: FloatArray, header: QtmHeader, path: Path) -> None:
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
    steps = np.diff(time)
    if header.rate_hz is not None and len(time) > 1:
        shown_hz = 1.0 / np.mean(steps)
        if abs(shown_hz / header.rate_hz - 1.0) > _CLOCK_TOLERANCE:
            raise RecordingError(
                f"{path}: FREQUENCY is {header.rate_hz:g} but the Time column counts "
                f"{shown_hz:.4g} frames a second; expected the same"
            )
    uneven = _uneven(steps)
    if uneven.size:
        row = int(uneven[0]) + 1
        warn_of_file(
            f"{path.name}: {uneven.size} times do not rise evenly, first in line "
            f"{header.data_line + row + 1}: {time[row]:g} s after {time[row - 1]:g} s; frames are "
            "taken for evenly spaced"
        )


def _uneven(steps: FloatArray) -> npt.NDArray[np.int64]:
    """Return which steps of time are far from the usual one."""
    usual = np.median(steps) if len(steps) else 0.0
    return np.flatnonzero(np.abs(steps - usual) > _STEP_TOLERANCE * usual)
