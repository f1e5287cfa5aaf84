"""Motive CSV: OptiTrack's rigid bodies, skeletons and markers, frames by columns.

Variants seen: format versions 1.21 to 1.25; a blank second line, one of commas, or none; the column
``Time`` or ``Time (Seconds)``, with a ``TimeCode`` behind it or not; rows Type, Name, ID, Parent
in any choice, or without these words; rigid bodies with and without rotations and errors; columns
without an axis (Mean Marker Error, Marker Quality); one name for a rigid body's marker and a
marker; metres, centimetres, millimetres, inches; an export rate other than the capture rate; frames
from 0; saved again by Excel, with commas or semicolons. Motive is y-up unless told otherwise at
export, which the file does not say.

References
----------
OptiTrack documentation, "Data Export: CSV".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from besman.exceptions import RecordingError
from besman.foreign.numbers import parse_number
from besman.io.recordings.bodies import gather_turns, hold_orientations, read_orientations
from besman.io.recordings.c3d_names import keep_single_names
from besman.io.recordings.clock import read_rate, settle_clock
from besman.io.recordings.conventions import BY_HABIT
from besman.io.recordings.format import Units
from besman.io.recordings.lengths import find_length
from besman.io.recordings.number_rows import ROWS_SEEN, Cells, find_cells, read_tracks, see_commas
from besman.io.recordings.text_lines import TextLines, open_lines
from besman.io.warning import warn_of_file
from besman.records import FloatArray, Origin, Recording
from besman.records.frozen import hand_over

_HEADER_LINES = 16
_TIME = re.compile(r"time( \(.*\))?")
_LABELS = {"type", "name", "id", "parent"}
_UNLABELLED = re.compile(r"(Unlabel+ed|Active)?[ _:-]*\d*", re.IGNORECASE)
_FITTED = {"rigid body marker", "bone marker"}
_MEASURED = "marker"


@dataclass(frozen=True)
class _Track:
    """Something with a position: where its columns are."""

    kind: str
    name: str
    position: int
    rotation: int | None


@dataclass(frozen=True)
class _Header:
    """What stands above the numbers."""

    values: dict[str, str]
    tracks: tuple[_Track, ...]
    time_column: int | None
    width: int
    texts: tuple[int, ...]
    cells: Cells
    data_line: int

    def number(self, key: str) -> float | None:
        """Return a number of the first line, None if it does not have it."""
        try:
            return parse_number(self.values.get(key, "").replace(",", "."))
        except ValueError:
            return None


def read_motive_csv(path: Path, units: Units | None = None, partial: bool = False) -> Recording:
    """Read a Motive CSV.

    Rigid bodies and bones are trajectories with an orientation, markers are trajectories without
    one; those that Motive calls unlabelled have no name. The markers that Motive computes from a
    rigid body's pose are left out where the measured ones of the same name are there.

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
        Positions in metres and in the file's frame; the times of the file.

    Raises
    ------
    RecordingError
        If the file is missing, empty, cut off, contradicts itself or has no positions in one frame
        for all; the message names file and line.

    Warns
    -----
    RecordingWarning
        For frames that the first line counts otherwise, and what was concluded.
    """
    lines = open_lines(path, "a Motive CSV")
    header = _read_header(lines, path)
    tracks, notes = _choose_tracks(header.tracks)
    turned, turns = gather_turns([track.rotation for track in tracks], 2)
    values, positions = read_tracks(
        lines, header.data_line, header.width, header.cells, path,
        (0, header.time_column or 0, *turned), [track.position for track in tracks],
        partial=partial, texts=header.texts,
    )  # fmt: skip
    said = (header.values.get(f"{key} frame rate", "") for key in ("export", "capture"))
    rate_hz = read_rate(next(filter(None, said), ""))
    times = None if header.time_column is None else values[:, 1]
    clock = settle_clock(values[:, 0], times, rate_hz, path, header.data_line + 1)
    _check_count(header, len(values), path)
    positions = clock.spread(positions)
    word = header.values.get("length units")
    length = find_length(word, units, positions, str(path), "Length Units")
    positions *= length.metres
    orientations = read_orientations(values, turns, [track.name for track in tracks], path.name)
    return Recording(
        time=clock.time,
        positions=hand_over(positions),
        names=_name(tracks, positions, path.name),
        rate_hz=clock.rate_hz,
        source=path.name,
        first_frame=clock.first_frame,
        orientations=None
        if orientations is None
        else hold_orientations(clock.spread(orientations)),
        origin=Origin(
            writer=f"Motive, format {header.values.get('format version', '')[:20]}",
            units=length.name,
            units_by=length.told_by,
            up="y",
            up_by=BY_HABIT,
            notes=notes,
        ),
    )


def _read_header(lines: TextLines, path: Path) -> _Header:
    """Read the lines above the numbers."""
    head = lines[:_HEADER_LINES]
    cells = find_cells(head[0])
    words = cells.split(head[0])
    # A name with a comma in it shifts what comes behind, so that every word may be a key.
    values = {key.lower(): value for key, value in pairwise(words)}
    if values.get("coordinate space", "global").lower() not in ("global", ""):
        raise RecordingError(
            f"{path}:1: Coordinate Space is {values['coordinate space']!r:.40}; expected Global: "
            "positions relative to others are no recording"
        )
    rows = [cells.split(line) for line in head]
    at = next((at for at, row in enumerate(rows) if at and row[0].lower() == "frame"), None)
    if at is None:
        raise RecordingError(
            f"{path}: no line of columns that begins with Frame among the first {_HEADER_LINES}; "
            "is the file cut?"
        )
    axes, *above = _align([rows[at], *rows[1:at]])
    width = len(axes)
    lowered = [axis.lower() for axis in axes]
    time = next((k for k, axis in enumerate(lowered) if _TIME.fullmatch(axis)), None)
    texts = tuple(k for k, axis in enumerate(lowered) if axis.startswith("timecode"))
    tracks = _find_tracks(axes, above)
    cells = see_commas(cells, lines[at + 1 : at + 1 + ROWS_SEEN])
    if not tracks:
        raise RecordingError(
            f"{path}:{at + 1}: no columns of positions; expected at least one X, Y, Z"
        )
    return _Header(values, tracks, time, width, texts, cells, at + 1)


def _align(rows: list[list[str]]) -> list[list[str]]:
    """Return the rows that have words, as wide as the last column with one.

    Columns of errors have no axis, those that a spreadsheet adds have nothing.
    """
    width = max(k + 1 for row in rows for k, cell in enumerate(row) if cell)
    return [row[:width] + [""] * (width - len(row)) for row in rows if any(row)]


def _find_tracks(axes: Sequence[str], above: Sequence[list[str]]) -> tuple[_Track, ...]:
    """Find the columns of everything that has a position."""
    kinds = _row(
        above, "type", {"marker", "rigid body", "rigid body marker", "bone", "bone marker"}
    )
    names = _row(above, "name", set()) or [""] * len(axes)
    ids = _row(above, "id", set()) or [""] * len(axes)
    what = _row(above, "", {"position", "rotation"})
    kinds = kinds or [""] * len(axes)
    found: list[_Track] = []
    rotation: tuple[int, tuple[str, str, str]] | None = None
    column = 0
    while column + 2 < len(axes):
        owner = (kinds[column].lower(), names[column], ids[column])
        letters = "".join(axes[column : column + 4]).upper()
        is_turn = what[column].lower() == "rotation" if what else letters == "XYZW"
        if letters.startswith("XYZ") and len(axes[column]) == 1:
            if is_turn:
                if letters == "XYZW":
                    rotation = (column, owner)
                column += 4 if letters == "XYZW" else 3
                continue
            turned = rotation[0] if rotation is not None and rotation[1] == owner else None
            found.append(_Track(owner[0], owner[1], column, turned))
            column += 3
            continue
        column += 1
    return tuple(found)


def _row(above: Sequence[list[str]], label: str, known: set[str]) -> list[str]:
    """Find a row of the header by its label, or by the words in it."""
    for row in above:
        if label and row[1].lower() == label:
            return row
    for row in above:
        if known and {cell.lower() for cell in row[2:]} & known:
            return row
    unlabelled = [row for row in above if row[1].lower() not in _LABELS]
    # Without labels the rows are type, name, identity, property.
    if label == "name" and len(unlabelled) == len(above) and len(above) > 1:
        return above[1]
    return []


def _choose_tracks(tracks: tuple[_Track, ...]) -> tuple[list[_Track], tuple[str, ...]]:
    """Leave out the markers computed from poses where measured ones have their names."""
    measured = {track.name for track in tracks if track.kind == _MEASURED}
    kept = [track for track in tracks if not (track.kind in _FITTED and track.name in measured)]
    n_left_out = len(tracks) - len(kept)
    if not n_left_out:
        return kept, ()
    return kept, (
        f"{n_left_out} markers that Motive computes from poses are left out: the measured ones of "
        "the same names are there",
    )


def _name(tracks: Sequence[_Track], positions: FloatArray, source: str) -> tuple[str | None, ...]:
    """Return the names of trajectories, None of those that are unlabelled."""
    names = [None if _UNLABELLED.fullmatch(track.name) else track.name for track in tracks]
    return keep_single_names(names, positions, source, "trajectories")


def _check_count(header: _Header, n_rows: int, path: Path) -> None:
    """Say where the first line counts other frames than there are."""
    said = header.number("total exported frames")
    if said is not None and said != n_rows:
        warn_of_file(f"{path.name}: Total Exported Frames is {said:g} and {n_rows} frames follow")
