"""Keypoints in a table: a column for each coordinate, ``nose_x, nose_y, nose_z``, and the time.

Variants seen: coordinates called as `besman.io.recordings.keypoint_columns` says; commas, tabs or
semicolons (then with points or commas in numbers); frames, times in seconds or milliseconds, both
or, with a rate in the first lines (``# fps: 30``), neither; further columns; BTS' EMT, Visual3D's
ASCII. Also a row a keypoint, `besman.io.recordings.keypoint_rows`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError
from besman.io.recordings.c3d_names import keep_single_names
from besman.io.recordings.clock import TIME_NAMES, in_seconds, read_rate, settle_clock
from besman.io.recordings.format import Units
from besman.io.recordings.keypoint_columns import (
    ABOVE_LINES,
    HEADER_LINES,
    find_columns,
    find_header,
    join_header,
)
from besman.io.recordings.keypoint_rows import (
    KeypointRows,
    find_row_columns,
    read_keypoint_rows,
)
from besman.io.recordings.keypoints import find_keypoint_length
from besman.io.recordings.number_rows import (
    ROWS_SEEN,
    Cells,
    find_cells,
    is_word,
    read_rows,
    see_commas,
)
from besman.io.recordings.text_lines import TextLines, open_lines
from besman.records import FloatArray, Origin, Recording
from besman.records.frozen import hand_over

_FRAMES = {
    "frame",
    "frame#",
    "frame_number",
    "framenumber",
    "frame_id",
    "fnum",
    "index",
    "item",
    "",
}
_RATES = ("rate_hz", "fps", "frame_rate", "rate", "frequency", "sampling_frequency", "datarate")
# ``Time(s)``, ``time [ms]``
_UNIT_BEHIND = re.compile(r"\s*[\[(]\s*([a-z]+)\s*[\])]$")
_UNITS = ("units", "unit", "measure_unit")


def read_keypoints_csv(path: Path, units: Units | None = None, partial: bool = False) -> Recording:
    """Read keypoints from a table.

    Parameters
    ----------
    path : Path
        The file.
    units : "m", "cm", "mm", "in" or "ft", optional
        What the coordinates are in; without it ``# units: mm`` above the table, or the height of
        the body.
    partial : bool
        Take what is there of a file that was cut.

    Returns
    -------
    Recording
        Positions in metres and in the file's frame.

    Raises
    ------
    RecordingError
        If the file is missing, cut off, or has no positions or no rate.

    Warns
    -----
    RecordingWarning
        For what was concluded of units and rate.
    """
    lines = open_lines(path, "keypoints in a table")
    at, about = find_header([lines[k] for k in range(min(ABOVE_LINES + HEADER_LINES, len(lines)))])
    cells = find_cells(lines[at])
    head = [cells.split(lines[k]) for k in range(at, min(at + HEADER_LINES, len(lines)))]
    labels, n_header = join_header(head)
    while labels and not labels[-1]:
        labels.pop()
    at += n_header
    cells = see_commas(cells, lines[at : at + ROWS_SEEN])
    found, unit = _read_table(lines, at, labels, cells, path, partial)
    names: list[str | None] = list(found.names)
    clock = settle_clock(found.frames, found.times, _rate(about), path, at + 1)
    positions = clock.spread(found.positions)
    word = next((about[key] for key in _UNITS if about.get(key)), unit or None)
    length = find_keypoint_length(word, names, positions, units, path)
    positions *= length.metres
    return Recording(
        time=clock.time,
        positions=hand_over(positions),
        names=keep_single_names(names, positions, path.name, "keypoints"),
        rate_hz=clock.rate_hz,
        source=path.name,
        first_frame=clock.first_frame,
        origin=Origin(units=length.name, units_by=length.told_by),
    )


def _read_table(
    lines: TextLines, at: int, labels: Sequence[str], cells: Cells, path: Path, partial: bool
) -> tuple[KeypointRows, str]:
    """Read what stands below a header, and the unit that it says: a row a frame, or a keypoint."""
    lowered = [label.lower() for label in labels]
    frame = next((k for k, one in enumerate(lowered) if one in _FRAMES), None)
    lowered = [_UNIT_BEHIND.sub(r" (\1)", one) for one in lowered]
    time = next((k for k, one in enumerate(lowered) if one in TIME_NAMES), None)
    # ``x_mm`` of a row is no keypoint called mm.
    in_rows = find_row_columns(labels)
    if in_rows is not None:
        found = read_keypoint_rows(lines, at, labels, in_rows, (frame, time), cells, path, partial)
        unit = in_rows.unit
    else:
        names, columns, unit = find_columns(labels)
        if not names:
            raise RecordingError(f"{path}:{at}: no keypoint with three columns, x, y and z")
        used = {column for place in columns for column in place} | {frame, time}
        texts = _find_texts(lines[at : at + ROWS_SEEN], len(labels), used, cells)
        values = read_rows(lines, at, len(labels), cells, path, partial=partial, texts=texts)
        found = KeypointRows(
            names,
            np.take(values, np.array(columns), axis=1),
            np.arange(1.0, len(values) + 1) if frame is None else values[:, frame],
            None if time is None else values[:, time],
        )
        if frame is not None and time is None and not labels[frame] and _are_times(found.frames):
            # An index of times, as pandas writes it.
            return found._replace(frames=None, times=found.frames), unit
    if found.times is None or time is None:
        return found, unit
    return found._replace(times=in_seconds(found.times, lowered[time])), unit


def _are_times(values: FloatArray | None) -> bool:
    """Tell times by their parts of seconds."""
    return values is not None and bool((values != np.round(values)).any())


def _find_texts(
    rows: Sequence[str], width: int, used: set[int | None], cells: Cells
) -> tuple[int, ...]:
    """Return the columns that nothing is taken from and that hold words, as of a trial's result."""
    split = [cells.split(row) for row in rows]
    return tuple(
        column
        for column in range(width)
        if column not in used and any(is_word(row[column]) for row in split if column < len(row))
    )


def _rate(about: dict[str, str]) -> float | None:
    """Return the rate that the lines above the table say."""
    for key in _RATES:
        if key in about:
            return read_rate(re.sub(r"(?i)\s*(hz|fps)$", "", about[key]))
    return None
