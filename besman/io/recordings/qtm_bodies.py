"""Qualisys TSV of bodies: 6D exports of rigid bodies, and skeletons.

Variants seen: the body's name before its X or in a cell of its own, with an empty cell below it or
none; Roll Pitch Yaw or Yaw Pitch Roll; Residual and Rot[0] to Rot[8], column by column; QX QY QZ QW
of skeletons' segments; frame and time first, or neither; empty cells, NaN, NA or zeros where a body
was not seen; no line of columns at all.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError
from besman.foreign.numbers import parse_whole_number
from besman.io.recordings.bodies import (
    from_matrices,
    hold_orientations,
    to_unit,
    warn_of_no_turns,
)
from besman.io.recordings.c3d_names import keep_single_names
from besman.io.recordings.clock import read_rate, settle_clock
from besman.io.recordings.number_rows import ROWS_SEEN, TAKE, Cells, read_rows, see_commas
from besman.io.recordings.text_lines import TextLines
from besman.io.warning import warn_of_file
from besman.records import FloatArray, Origin, Recording
from besman.records.frozen import hand_over

_KEY = re.compile(r"[A-Z][A-Z_]+")
_KEYS = {
    "NO_OF_BODIES",
    "BODY_NAMES",
    "NO_OF_SKELETONS",
    "SKELETON_NAMES",
    "SEGMENT_NAMES",
    "SKELETON",
}
_TABS = Cells(b"\t")
_HEADER_LINES = 40
# Columns of a body where no line names them: place, three angles, residual, matrix.
_PLAIN = ("X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{k}]" for k in range(9)))
_TURNS = ("QW", "QX", "QY", "QZ")


@dataclass(frozen=True)
class _Body:
    """A body and the columns of what is known of it."""

    name: str
    columns: dict[str, int]


def has_bodies(lines: TextLines) -> bool:
    """Tell whether a Qualisys TSV holds bodies, not markers."""
    head = [line.split("\t") for line in lines[:_HEADER_LINES]]
    keys = {row[0].strip() for row in head}
    if "MARKER_NAMES" in keys:
        return False
    said = next((row for row in head if row[0] == "DATA_INCLUDED"), [""])
    return bool(keys & _KEYS) or any("6D" in word.upper() for word in said[1:])


def read_bodies(lines: TextLines, path: Path, partial: bool) -> Recording:
    """Read the bodies of a Qualisys TSV: a trajectory with an orientation for each.

    Parameters
    ----------
    lines : TextLines
        Of the whole file.
    path : Path
        Named in messages.
    partial : bool
        Take what is there of a file that was cut.

    Raises
    ------
    RecordingError
        If the header has no bodies, or contradicts the numbers.
    """
    keys, columns, first = _read_header(lines, path)
    bodies, width = _find_bodies(keys, columns, lines[first] if first < len(lines) else "", path)
    cells = see_commas(_TABS, lines[first : first + ROWS_SEEN])
    values = read_rows(lines, first, width, cells, path, partial=partial)
    _check_count(_count(keys, "NO_OF_FRAMES", path), len(values), path, partial)
    lowered = [column.lower() for column in columns[:2]]
    extra = [values[:, lowered.index(one)] if one in lowered else None for one in ("frame", "time")]
    if not columns and width % len(bodies) == 2:
        extra = [values[:, 0], values[:, 1]]
    if all(one is None for one in extra):
        extra[0] = np.arange(1.0, len(values) + 1)
    rate_hz = read_rate((keys.get("FREQUENCY") or [""])[0])
    clock = settle_clock(extra[0], extra[1], rate_hz, path, first + 1)
    places = np.array([[body.columns[axis] for axis in "XYZ"] for body in bodies])
    positions = values[:, places] / 1000.0
    for index, body in enumerate(bodies):
        if "RESIDUAL" in body.columns:
            positions[values[:, body.columns["RESIDUAL"]] < 0, index] = np.nan
    positions = clock.spread(positions)
    orientations = _read_orientations(values, bodies, path.name)
    return Recording(
        time=clock.time,
        positions=hand_over(positions),
        names=keep_single_names(
            [body.name or None for body in bodies], positions, path.name, "bodies"
        ),
        rate_hz=clock.rate_hz,
        source=path.name,
        first_frame=clock.first_frame,
        orientations=None
        if orientations is None
        else hold_orientations(clock.spread(orientations)),
        origin=Origin(writer="Qualisys Track Manager", units="mm", units_by="the format"),
    )


def _read_header(lines: TextLines, path: Path) -> tuple[dict[str, list[str]], list[str], int]:
    """Return keys, the names of columns (none if there is no such line), and the first row."""
    keys: dict[str, list[str]] = {}
    columns: list[str] = []
    for at, line in enumerate(lines[:_HEADER_LINES]):
        cells = [cell.strip() for cell in line.split("\t")]
        if "X" in {cell[-1:].upper() for cell in cells[:5]} and "Y" in [
            cell[-1:].upper() for cell in cells
        ]:
            columns = cells
        elif _KEY.fullmatch(cells[0]) and cells[0] not in {"NULL", "NAN", "NA"}:
            keys.setdefault(cells[0], cells[1:])
        elif any(cells):
            return keys, columns, at
    raise RecordingError(f"{path}:{len(lines)}: no frames after the header; is the file cut?")


def _check_count(said: int | None, n_rows: int, path: Path, partial: bool) -> None:
    """Hold the frames against NO_OF_FRAMES."""
    if said is None or said == n_rows:
        return
    what = f"NO_OF_FRAMES is {said} and {n_rows} frames follow"
    if n_rows < said and not partial:
        raise RecordingError(f"{path}: {what}; is the file cut? {TAKE}")
    warn_of_file(f"{path.name}: {what}")


def _count(keys: dict[str, list[str]], key: str, path: Path) -> int | None:
    """Return a declared number; None if the file does not say it."""
    text = (keys.get(key) or [""])[0]
    if not text:
        return None
    try:
        count = parse_whole_number(text)
    except ValueError:
        count = -1
    if count < 0:
        raise RecordingError(f"{path}: {key} is {text!r:.60}; expected a whole number")
    return count


def _find_bodies(
    keys: dict[str, list[str]], columns: Sequence[str], row: str, path: Path
) -> tuple[list[_Body], int]:
    """Return the bodies, and how many columns there are."""
    named = next((keys[key] for key in ("BODY_NAMES", "SEGMENT_NAMES") if key in keys), [])
    named = [name for name in named if name]
    n_cells = len(row.split("\t"))
    if columns:
        labels = list(columns)
        owners = [at for at, label in enumerate(labels) if _is_name(labels, at)]
        names = [labels[at] for at in owners]
        # A cell with a body's name has no numbers below it in some exports.
        if owners and n_cells <= len(labels) - len(owners):
            labels = [label for at, label in enumerate(labels) if at not in owners]
        bodies = _from_labels(labels, names or named)
        width = max(len(labels), 1)
    else:
        bodies, width = _plain_bodies(keys, named, n_cells, path)
    if not bodies:
        raise RecordingError(
            f"{path}: no bodies with X, Y and Z in the header; expected at least one"
        )
    return bodies, width


def _plain_bodies(
    keys: dict[str, list[str]], named: Sequence[str], n_cells: int, path: Path
) -> tuple[list[_Body], int]:
    """Return the bodies of a file without a line of columns, and how many columns there are."""
    n_bodies = len(named) or min(_count(keys, "NO_OF_BODIES", path) or 0, n_cells)
    n_extra = 2 if n_bodies and (n_cells - 2) // len(_PLAIN) == n_bodies else 0
    bodies = []
    for k, name in enumerate(named or [""] * n_bodies):
        first = n_extra + len(_PLAIN) * k
        columns = {label.upper(): first + j for j, label in enumerate(_PLAIN)}
        bodies.append(_Body(name, columns))
    return bodies, n_extra + len(_PLAIN) * n_bodies


def _is_name(labels: Sequence[str], at: int) -> bool:
    """Tell whether a cell of the line of columns is the name of the body whose X comes next."""
    following = labels[at + 1] if at + 1 < len(labels) else ""
    return following == "X" and labels[at].lower() not in ("time", "frame", "") and not (
        labels[at].upper() in _TURNS or labels[at].startswith(("Rot[", "Residual"))
    )  # fmt: skip


def _from_labels(labels: Sequence[str], names: Sequence[str]) -> list[_Body]:
    """Return the bodies whose columns have these labels."""
    bodies: list[_Body] = []
    for at, label in enumerate(labels):
        before, _, last = label.rpartition(" ")
        following = [one.rpartition(" ")[2].upper() for one in labels[at + 1 : at + 3]]
        if last.upper() == "X" and following == ["Y", "Z"]:
            name = before or (names[len(bodies)] if len(bodies) < len(names) else "")
            bodies.append(_Body(name, {}))
        if bodies and last:
            bodies[-1].columns.setdefault(last.upper(), at)
    return bodies


def _read_orientations(
    values: FloatArray, bodies: Sequence[_Body], source: str
) -> FloatArray | None:
    """Return quaternions (T, M, 4), w first, NaN where unknown; None if no body has any."""
    found = np.full((len(values), len(bodies), 4), np.nan)
    for index, body in enumerate(bodies):
        if all(f"ROT[{k}]" in body.columns for k in range(9)):
            flat = values[:, [body.columns[f"ROT[{k}]"] for k in range(9)]]
            # The matrix is written column by column.
            matrices = flat.reshape(-1, 3, 3).transpose(0, 2, 1)
            found[:, index] = from_matrices(matrices)
            warn_of_no_turns(flat, found[:, index], body.name, source)
        elif all(key in body.columns for key in _TURNS):
            quaternions = values[:, [body.columns[key] for key in _TURNS]]
            found[:, index] = to_unit(quaternions)
            warn_of_no_turns(quaternions, found[:, index], body.name, source)
    return None if np.isnan(found).all() else found
