"""Nexus CSV: Vicon's trajectories and model outputs, frames by columns.

Variants seen: ``Trajectories`` first, or behind ``Devices`` and ``Model Outputs``; model outputs
with angles, forces and positions in one table, of bodies RX to SZ; several subjects before a colon;
sub frames; objects with quaternions before or behind their places;
events first; Workstation and Tracker with ``Field #``, a rate such as ``120,Hz`` and no line of
units; commas, semicolons or tabs; commas to the end of every line; blank cells at gaps.

References
----------
Vicon Nexus user guide, "Export ASCII pipeline operation".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError
from besman.io.recordings.bodies import gather_turns, hold_orientations, read_orientations
from besman.io.recordings.c3d_names import find_names
from besman.io.recordings.clock import RowClock, read_rate, settle_clock
from besman.io.recordings.format import Units
from besman.io.recordings.lengths import find_length, parse_unit
from besman.io.recordings.number_cells import is_number_cell
from besman.io.recordings.number_rows import (
    ROWS_SEEN,
    Cells,
    find_cells,
    read_tracks,
    see_commas,
)
from besman.io.recordings.text_lines import TextLines, open_lines
from besman.records import FloatArray, Origin, Recording
from besman.records.frozen import hand_over

_TITLE = re.compile(
    rb'"?(Trajectories|Model Outputs|Devices|Joints|Segments|Objects|Events|Global Angles|Analog)'
    rb"\b",
    re.IGNORECASE,
)
# What positions are taken from, the best first.
_TITLES = ("trajectories", "objects", "model outputs", "segments")
# Tracker's word before an object, which says how its turns are written.
_TURNS = re.compile(r"Global Angle \([^)]*\) *", re.IGNORECASE)
_FIRST = {"frame", "field #", "field", "frame#"}


@dataclass(frozen=True)
class _Section:
    """The table that positions are taken from."""

    title: str
    rate_hz: float | None
    labels: tuple[str, ...]
    columns: tuple[int, ...]
    turns: tuple[int | None, ...]
    unit: str | None
    sub_column: int | None
    width: int
    cells: Cells
    data_line: int


def read_nexus_csv(path: Path, units: Units | None = None, partial: bool = False) -> Recording:
    """Read a CSV of Vicon Nexus, Workstation or Tracker.

    Trajectories are taken; where there are none, objects, or the positions among model outputs,
    which are columns X, Y, Z in a unit of length, and TX, TY, TZ of bodies. Columns RX, RY, RZ, RW
    of a body are a quaternion, w last.

    Parameters
    ----------
    path : Path
        The file.
    units : "m", "cm", "mm", "in" or "ft", optional
        What the coordinates are in, whatever the file says.
    partial : bool
        Take what is there of a file that was cut.

    Returns
    -------
    Recording
        Positions in metres and in the file's frame, time in seconds: ``(frame - 1) / rate``.

    Raises
    ------
    RecordingError
        If the file is missing, empty, cut off or has no table of positions; the message names file
        and line.

    Warns
    -----
    RecordingWarning
        For what was concluded of units, rate and names.
    """
    lines = open_lines(path, "a Nexus CSV")
    titles = _find_titles(lines, 0, _TITLES[0])
    chosen = next((name for name in _TITLES if name in titles), None)
    if chosen is None:
        raise RecordingError(
            f"{path}: no table of trajectories or model outputs; got {', '.join(titles) or 'none'}"
        )
    section = _read_header(lines, titles[chosen], chosen, path)
    # Frames and their parts, and what turns bodies.
    turned, turns = gather_turns(section.turns, 2)
    values, positions = read_tracks(
        lines, section.data_line, section.width, section.cells, path,
        (0, section.sub_column or 0, *turned), section.columns, partial=partial,
    )  # fmt: skip
    if chosen == _TITLES[0]:
        titles |= _find_titles(lines, section.data_line + len(values))
    clock = _settle(section, values, path)
    positions = clock.spread(positions)
    length = find_length(section.unit, units, positions, str(path), "the line of units")
    positions *= length.metres
    orientations = read_orientations(values, turns, section.labels, path.name)
    others = [title for title in titles if title != chosen]
    return Recording(
        time=clock.time,
        positions=hand_over(positions),
        names=find_names(section.labels, [""] * len(section.labels), positions, path.name),
        rate_hz=clock.rate_hz,
        source=path.name,
        first_frame=clock.first_frame,
        orientations=None
        if orientations is None
        else hold_orientations(clock.spread(orientations)),
        origin=Origin(
            units=length.name,
            units_by=length.told_by,
            notes=(f"taken from {chosen}; not looked at: {', '.join(others)}",) if others else (),
        ),
    )


def _find_titles(lines: TextLines, at: int, last: str = "") -> dict[str, int]:
    """Return the index of the line of every table's title, from a line on and up to a title."""
    found: dict[str, int] = {}
    for block in lines.blocks(at):
        if last in found:
            break
        codes = np.frombuffer(block + b"\n", np.uint8)
        ends = np.flatnonzero(codes == ord("\n"))
        starts = np.append(0, ends[:-1] + 1)
        # Most lines begin with a number.
        first = codes[starts]
        for row in np.flatnonzero((first > ord("9")) | (first == ord('"'))).tolist():
            title = _TITLE.match(block, int(starts[row]))
            if title:
                found.setdefault(title[1].decode().lower(), at + row)
        at += len(ends)
    return found


def _read_header(lines: TextLines, at: int, title: str, path: Path) -> _Section:
    """Read the lines of a table above its numbers."""
    head = lines[at : at + 7]
    table = next((k for k, line in enumerate(head) if k and _is_columns(line)), None)
    if table is None or table < 2:
        raise RecordingError(
            f"{path}:{at + 1}: no line of columns that begins with Frame below {title!r}; is the "
            "file cut?"
        )
    cells = find_cells(head[table])
    axes, names = cells.split(head[table]), cells.split(head[table - 1])
    names += [""] * (len(axes) - len(names))
    rate = cells.split(head[1])[0]
    row = cells.split(head[table + 1]) if table + 1 < len(head) else []
    units = row + [""] * (len(axes) - len(row)) if row and not is_number_cell(row[0]) else None
    n_ends = next((k for k in range(len(axes), 0, -1) if axes[k - 1]), 0)
    columns, labels, words = _find_positions(axes[:n_ends], names, units)
    turns = _find_turns(axes[:n_ends], columns, labels, names)
    if not columns:
        raise RecordingError(
            f"{path}:{at + table + 1}: no columns of positions in {title!r}; expected X, Y, Z in a "
            "unit of length"
        )
    sub = 1 if "".join(axes[1:2]).lower().startswith("sub") else None
    data_line = at + table + (1 if units is None else 2)
    cells = see_commas(cells, lines[data_line : data_line + ROWS_SEEN])
    rate_hz = read_rate(rate)
    return _Section(
        title,
        rate_hz,
        labels,
        columns,
        turns,
        min(words, default=None),
        sub,
        n_ends,
        cells,
        data_line,
    )


def _is_columns(line: str) -> bool:
    return find_cells(line).split(line)[0].lower() in _FIRST


def _find_positions(
    axes: Sequence[str], names: Sequence[str], units: Sequence[str] | None
) -> tuple[tuple[int, ...], tuple[str, ...], set[str]]:
    """Return the first column of every position, its label, and the words for their unit."""
    columns, labels, words = [], [], set()
    owner = ""
    for at in range(len(axes)):
        owner = names[at] or owner
        letters = _letters(axes, at, 3)
        is_body = letters == "TXTYTZ"
        if letters != "XYZ" and not is_body:
            continue
        word = "" if units is None else units[at]
        if units is not None and parse_unit(word) is None:
            continue
        columns.append(at)
        # A trajectory without a name stands beside one that has one.
        labels.append(_call_body(owner) if is_body else names[at])
        words.update({word} - {""})
    return tuple(columns), tuple(labels), words


def _call_body(owner: str) -> str:
    """Return the name of a body; Tracker repeats that of an object, ``hand:hand``."""
    name = _TURNS.sub("", owner)
    before, _, after = name.partition(":")
    return before if before == after else name


def _find_turns(
    axes: Sequence[str], columns: Sequence[int], labels: Sequence[str], names: Sequence[str]
) -> tuple[int | None, ...]:
    """Return where the quaternion of every position begins, before it or behind it, if anywhere."""
    found: list[int | None] = []
    for label, column in zip(labels, columns, strict=True):
        near = (column - 4, column + 3)
        turns = (at for at in near if at >= 0 and _letters(axes, at, 4) == "RXRYRZRW")
        found.append(next((at for at in turns if _call_body(names[at]) in (label, "")), None))
    return tuple(found)


def _letters(axes: Sequence[str], at: int, count: int) -> str:
    return "".join(axes[at : at + count]).upper()


def _settle(section: _Section, values: FloatArray, path: Path) -> RowClock:
    """Settle frames and rate; where there are sub frames the rate counts these."""
    frames = values[:, 0]
    if section.sub_column is not None:
        subs = np.nan_to_num(values[:, section.sub_column])
        n_subs = int(min(subs.max(), 10_000.0)) + 1 if len(subs) else 1
        if n_subs > 1:
            frames = (frames - 1.0) * n_subs + subs + 1.0
    return settle_clock(frames, None, section.rate_hz, path, section.data_line + 1)
