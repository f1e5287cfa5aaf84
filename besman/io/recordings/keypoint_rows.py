"""Keypoints in a table with a row for each keypoint of each frame: ``frame, keypoint, x, y, z``.

As data frames are written, and MediaPipe's landmarks: a column of names (``keypoint``, ``marker``,
``landmark``, ``body_part``, ...), of frames or times or both, x, y and z (``x_mm``, ``x (mm)``,
``pos_x``), maybe one that tells people apart, and further columns; in any order of rows.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from besman.exceptions import RecordingError
from besman.io.recordings.number_rows import Cells, read_rows
from besman.io.recordings.text_lines import TextLines
from besman.records import FloatArray

_NAMES = ("keypoint", "marker", "landmark", "body_part", "bodypart", "part", "point", "joint",
          "name", "label", "keypoint_name", "marker_name", "landmark_name",
          "joint_name")  # fmt: skip
_PEOPLE = ("person", "person_id", "subject", "track_id", "individual", "animal")
_AXIS = re.compile(
    r"(?:pos(?:ition)?[ _.]?)?([xyz])(?:[ _]?(m|cm|mm|in|ft)|\s*[(\[]\s*(m|cm|mm|in|ft)\s*[)\]])?"
)
_LONGEST_LABEL = 40
# Of a table of frames and keypoints so many cells may stay empty for each row that there is.
_MOST_EMPTY, _FEW = 20, 10_000


class RowColumns(NamedTuple):
    """Columns of a table with a row a keypoint.

    Attributes
    ----------
    name : int
        Of the keypoint's name.
    places : tuple of int
        Of x, y and z.
    person : int or None
        Of whose it is.
    unit : str
        What the columns say that they are in; empty if they do not, or disagree.
    """

    name: int
    places: tuple[int, int, int]
    person: int | None
    unit: str


class KeypointRows(NamedTuple):
    """Keypoints of all frames.

    Attributes
    ----------
    names : list of str, length M
    positions : array, shape (T, M, 3)
        As in the file; NaN where there is no row.
    frames, times : array, shape (T,), or None
        Of the columns that were asked for.
    """

    names: list[str]
    positions: FloatArray
    frames: FloatArray | None
    times: FloatArray | None


def find_row_columns(labels: Sequence[str]) -> RowColumns | None:
    """Find names and coordinates in a header; None if it is not one of rows of keypoints."""
    lowered = [label.lower() if len(label) <= _LONGEST_LABEL else "" for label in labels]
    name = next((lowered.index(one) for one in _NAMES if one in lowered), None)
    axes: dict[str, int] = {}
    units = set()
    for at, label in enumerate(lowered):
        match = _AXIS.fullmatch(label)
        if match:
            axes.setdefault(match[1], at)
            units.add(match[2] or match[3] or "")
    if name is None or len(axes) < 3:
        return None
    person = next((lowered.index(one) for one in _PEOPLE if one in lowered), None)
    unit = units.pop() if len(units) == 1 else ""
    return RowColumns(name, (axes["x"], axes["y"], axes["z"]), person, unit)


def read_keypoint_rows(
    lines: TextLines,
    first: int,
    labels: Sequence[str],
    columns: RowColumns,
    clock: tuple[int | None, int | None],
    cells: Cells,
    path: Path,
    partial: bool,
) -> KeypointRows:
    """Read a table with a row a keypoint.

    Parameters
    ----------
    lines, first, cells, path, partial
        As of `besman.io.recordings.number_rows.read_rows`.
    labels : sequence of str
        Of the columns.
    columns : RowColumns
    clock : pair of int or None
        Columns of frames and of times.

    Returns
    -------
    KeypointRows

    Raises
    ------
    RecordingError
        As of `read_rows`; if nothing tells which frame a row is of, a keypoint is there twice in
        one, or most rows are missing.
    """
    key = clock[0] if clock[0] is not None else clock[1]
    if key is None:
        raise RecordingError(
            f"{path}:{first}: a row a keypoint, and no column that tells the frame; expected frame "
            "or time"
        )
    read = {*columns.places, *(one for one in clock if one is not None)}
    texts = tuple(at for at in range(len(labels)) if at not in read)
    values = read_rows(lines, first, len(labels), cells, path, partial=partial, texts=texts)
    keys, names = values[:, key], _names(lines, first, len(values), columns, cells, path)
    unknown = np.flatnonzero(np.isnan(keys))
    if unknown.size:
        raise RecordingError(
            f"{path}:{first + int(unknown[0]) + 1}: got nothing in column {labels[key]!r:.40}; "
            "expected the frame or time of the row"
        )
    _, starts, rows = np.unique(keys, return_index=True, return_inverse=True)
    places = {name: place for place, name in enumerate(dict.fromkeys(names))}
    if len(starts) * len(places) > _FEW + _MOST_EMPTY * len(values):
        raise RecordingError(
            f"{path}: {len(values)} rows of {len(places)} keypoints in {len(starts)} frames; "
            "expected a row of most keypoints in most frames"
        )
    which = np.array([places[name] for name in names])
    _refuse_twice(rows * len(places) + which, names, keys, path, first)
    positions = np.full((len(starts), len(places), 3), np.nan)
    positions[rows, which] = values[:, list(columns.places)]
    frames, times = (None if one is None else values[starts, one] for one in clock)
    return KeypointRows(list(places), positions, frames, times)


def _names(
    lines: TextLines, first: int, n_rows: int, columns: RowColumns, cells: Cells, path: Path
) -> list[str]:
    """Return the keypoint of each row; with the person before it where there are several."""
    names, people = [], []
    for at, line in enumerate(islice(lines, first, first + n_rows)):
        found = cells.split(line)
        name, person = (
            found[one] if one is not None and one < len(found) else ""
            for one in (columns.name, columns.person)
        )
        if not name:
            raise RecordingError(f"{path}:{first + at + 1}: got no name of a keypoint")
        names.append(name)
        people.append(person)
    if len(set(people)) < 2:
        return names
    return [f"{person}:{name}" for person, name in zip(people, names, strict=True)]


def _refuse_twice(
    codes: np.ndarray, names: Sequence[str], keys: FloatArray, path: Path, first: int
) -> None:
    """Refuse a keypoint that is there twice in a frame."""
    order = np.argsort(codes, kind="stable")
    again = np.flatnonzero(np.diff(codes[order]) == 0)
    if again.size:
        row = int(order[again + 1].min())
        raise RecordingError(
            f"{path}:{first + row + 1}: {names[row]!r:.60} is there twice in frame {keys[row]:g}; "
            "two people without a column person?"
        )
