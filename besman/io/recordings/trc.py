"""TRC: frames by markers, as OpenSim, EVaRT, Cortex, Pose2Sim and OpenCap write it.

Variants seen: tabs, commas, semicolons or blanks between cells; decimal commas, also between tabs;
cells padded with blanks, tabs doubled (EVaRT); millimetres, centimetres and metres, or another word
there; frames from 0 and from 1; blank cells and lines cut short at gaps; names with blanks, or
none; no blank line, or one of separators, below the header; counts of markers and frames in the
header that are not those of the columns and rows. Path file type 3 and 4. The format does not say
which way is up: OpenSim's files are y-up, those exported from a laboratory often z-up.

References
----------
OpenSim documentation, "Marker (.trc) Files".
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from besman.exceptions import RecordingError
from besman.foreign.numbers import parse_number
from besman.io.recordings.c3d_names import find_names
from besman.io.recordings.clock import read_rate, settle_clock
from besman.io.recordings.format import Units
from besman.io.recordings.lengths import find_length
from besman.io.recordings.number_cells import is_number_cell
from besman.io.recordings.number_rows import (
    ROWS_SEEN,
    Cells,
    find_cells,
    is_blank,
    read_tracks,
    see_commas,
)
from besman.io.recordings.text_lines import TextLines, open_lines
from besman.io.warning import warn_of_file
from besman.records import FloatArray, Origin, Recording
from besman.records.frozen import hand_over

_AXIS = re.compile(r"[XYZxyz]\d*")
# Lines from the first one in which the names must stand.
_HEADER_LINES = 12


@dataclass(frozen=True)
class _Header:
    """What stands above the numbers."""

    values: dict[str, str]
    names: tuple[str, ...]
    cells: Cells
    data_line: int

    def number(self, key: str) -> float | None:
        """Return a number of the header, None if there is none."""
        try:
            return parse_number(self.values.get(key.lower(), "").replace(",", "."))
        except ValueError:
            return None


def read_trc(path: Path, units: Units | None = None, partial: bool = False) -> Recording:
    """Read a TRC file.

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
        If the file is missing, empty, cut off or contradicts itself; the message names file and
        line.

    Warns
    -----
    RecordingWarning
        If the header's counts are wrong, and for what was concluded of units, rate and names.
    """
    lines = open_lines(path, "a TRC recording")
    header = _read_header(lines, path)
    n_markers = len(header.names)
    values, positions = read_tracks(
        lines, header.data_line, 2 + 3 * n_markers, header.cells, path, (0, 1),
        range(2, 2 + 3 * n_markers, 3), partial=partial,
    )  # fmt: skip
    rate_hz = read_rate(header.values.get("datarate", ""))
    clock = settle_clock(values[:, 0], values[:, 1], rate_hz, path, header.data_line + 1)
    positions = clock.spread(positions)
    _check_counts(header, values, path)
    length = find_length(header.values.get("units"), units, positions, str(path), "Units")
    positions *= length.metres
    return Recording(
        time=clock.time,
        positions=hand_over(positions),
        names=find_names(header.names, [""] * n_markers, positions, path.name),
        rate_hz=clock.rate_hz,
        source=path.name,
        first_frame=clock.first_frame,
        origin=Origin(units=length.name, units_by=length.told_by, up="y"),
    )


def _read_header(lines: TextLines, path: Path) -> _Header:
    """Read the lines above the numbers."""
    head = lines[: _HEADER_LINES + 2]
    keys = next((at for at, line in enumerate(head) if re.match(r'\s*"?DataRate', line)), None)
    names = next((at for at, line in enumerate(head) if re.match(r'\s*"?Frame', line)), None)
    if names is None or len(head) <= names + 1:
        raise RecordingError(
            f"{path}: no line of names that begins with Frame# among the first {_HEADER_LINES}; is "
            "the file cut?"
        )
    values: dict[str, str] = {}
    if keys is not None and keys + 1 < names:
        values = dict(zip(_words(head[keys].lower()), _words(head[keys + 1]), strict=False))
    first = next((at for at in range(names + 1, len(head)) if _is_row(head[at])), None)
    if first is None:
        raise RecordingError(f"{path}:{len(head)}: no frames after the header; is the file cut?")
    cells = find_cells(head[first])
    labelled = _read_names(head[names], find_cells(head[names]))
    n_labels = sum(
        bool(_AXIS.fullmatch(word)) for line in head[names + 1 : first] for word in _words(line)
    )
    n_markers = max(len(labelled), n_labels // 3)
    if _is_doubled(cells.split(head[first]), 2 + 3 * n_markers):
        cells = Cells(cells.separator, cells.has_decimal_commas, is_doubled=True)
    cells = see_commas(cells, lines[first : first + ROWS_SEEN])
    if not n_markers:
        raise RecordingError(f"{path}:{names + 1}: no markers are named; expected at least one")
    labelled += [""] * (n_markers - len(labelled))
    return _Header(values, tuple(labelled), cells, first)


def _words(line: str) -> list[str]:
    """Return the words of a line, whatever separates them; a comma may stand in a number."""
    has_others = "\t" in line or ";" in line
    return re.split(r'[\s;"]+' if has_others else r'[\s,;"]+', line.strip(" \t,;"))


def _is_row(line: str) -> bool:
    """Tell whether a line begins with the number of a frame."""
    if is_blank(line):
        return False
    return is_number_cell(find_cells(line).split(line.strip(" "))[0])


def _read_names(line: str, cells: Cells) -> list[str]:
    """Return the names of the markers; they stand over the first of three columns, if anywhere."""
    words = cells.split(line.rstrip("\r\n"))[2:]
    while words and not words[-1]:
        words.pop()
    placed = [at for at, word in enumerate(words) if word]
    if all(at % 3 == 0 for at in placed):
        return words[::3]
    # Some programs separate names by another number of tabs.
    return [words[at] for at in placed]


def _is_doubled(row: list[str], width: int) -> bool:
    """Tell whether every second cell of a row stands between two separators."""
    return len(row) >= 2 * width - 1 and not any(row[1::2]) and any(row[2::2])


def _check_counts(header: _Header, values: FloatArray, path: Path) -> None:
    """Say where the header counts otherwise than its columns and rows."""
    n_markers, n_frames = header.number("NumMarkers"), header.number("NumFrames")
    said = []
    if n_markers is not None and n_markers != len(header.names):
        said.append(f"NumMarkers is {n_markers:g} and {len(header.names)} have columns")
    if n_frames is not None and n_frames != len(values):
        said.append(f"NumFrames is {n_frames:g} and {len(values)} frames follow")
    if said:
        warn_of_file(f"{path.name}: {'; '.join(said)}")
