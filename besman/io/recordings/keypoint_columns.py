"""Which columns of a table are coordinates of keypoints, in whatever way they are called.

Understood: ``nose_x`` (or ``.``, ``:``, a blank, nothing before a capital X, ``nose (X)``,
``nose.PosX``) and ``x_nose``, each maybe with its unit behind (``nose_x (mm)``); and names that
stand once above x, y, z (tables with two lines of header, DeepLabCut's three, Visual3D's five).
Lines of ``# key: value`` may stand above, or of ``key: value`` and ``key=value`` (BTS' EMT).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from besman.io.recordings.keypoint_rows import find_row_columns

_UNIT = r"(?:\s*[(\[]\s*(m|cm|mm|in|ft)\s*[)\]])?"
_BEHIND = re.compile(r"(.+?)(?:[ _.:]+(?i:pos(?:ition)?[ _.]?)?\(?|\()([xyzXYZ])\)?" + _UNIT)
_GLUED = re.compile(r"(.+?)([XYZ])" + _UNIT)
_BEFORE = re.compile(r"([xyzXYZ])[_.:]([^\s()\[\]]+)" + _UNIT)
# What has three axes and is no place.
_NO_PLACE = re.compile(
    r"(?i)(.*[ _.:])?(acc|accel\w*|gyr\w*|mag\w*|vel\w*|omega|quat\w*|euler|angles?|rot\w*|"
    r"forces?|moments?|torques?)([ _.:].*)?"
)
_AXES = "xyz"
HEADER_LINES = 6
"""How many lines a header may have, and one row below it."""

ABOVE_LINES = 40
"""Lines above a header that are looked at."""

# ``# fps: 30``, ``# fps, 30``; ``Frequency:\t100 Hz``, ``Units=m``.
_ABOUT = re.compile(r"#\s*([A-Za-z][A-Za-z _]*?)\s*[:=,]\s*([^\s,;]+).*")
_ABOUT_BARE = re.compile(r"([A-Za-z][A-Za-z _]*?)\s*[:=]\s*([^\s,;]+).*")
# Patterns take the square of a label's length: a longer one names nothing.
_LONGEST_LABEL = 200
_FIRST_CELLS = 6  # of frames and times, before x, y and z stand for the first time


class KeypointColumns(NamedTuple):
    """Keypoints of a table.

    Attributes
    ----------
    names : list of str, length M
    places : list of (list of int), shape (M, 3)
        Columns of x, y and z.
    unit : str
        What the columns say that they are in; empty if they do not, or disagree.
    """

    names: list[str]
    places: list[list[int]]
    unit: str


def join_header(rows: Sequence[Sequence[str]]) -> tuple[list[str], int]:
    """Make one label of each column where names stand above x, y and z.

    Parameters
    ----------
    rows : sequence of (sequence of str)
        Cells of the first lines.

    Returns
    -------
    labels : list of str
        Of each column; those of the first line, if that is the whole header.
    n_lines : int
        How many lines the header has.
    """
    first = rows[0]
    for at in range(1, min(HEADER_LINES, len(rows))):
        axes = [cell.lower() for cell in rows[at]]
        start = axes.index("x") if "x" in axes[:_FIRST_CELLS] else None
        if start is None or axes[start : start + 3] != ["x", "y", "z"]:
            continue
        # Of files, types and scorers the same word stands over all columns.
        above = max(
            reversed(rows[:at]), key=lambda row: len({cell for cell in row[start:] if cell})
        )
        labels, name = [], ""
        for k, axis in enumerate(axes):
            name = (above[k] if k < len(above) else "") or name
            labels.append(f"{name}_{axis}" if axis in _AXES and axis and name else rows[at][k])
        # DeepLabCut calls the column of frames "coords".
        return ["frame" if one.lower() == "coords" else one for one in labels], at + 1
    return list(first), 1


def find_columns(labels: Sequence[str]) -> KeypointColumns:
    """Find the keypoints that have a column each for x, y and z.

    Parameters
    ----------
    labels : sequence of str
        Of the columns.
    """
    for pattern, name_at, axis_at in ((_BEHIND, 1, 2), (_GLUED, 1, 2), (_BEFORE, 2, 1)):
        found: dict[str, dict[str, int]] = {}
        units = set()
        for at, label in enumerate(labels):
            match = pattern.fullmatch(label) if len(label) <= _LONGEST_LABEL else None
            if match and not _NO_PLACE.fullmatch(match[name_at]):
                found.setdefault(match[name_at], {}).setdefault(match[axis_at].lower(), at)
                units.add(match[3] or "")
        whole = {name: places for name, places in found.items() if len(places) == len(_AXES)}
        if whole:
            unit = units.pop() if len(units) == 1 else ""
            places = [[each[axis] for axis in _AXES] for each in whole.values()]
            return KeypointColumns(list(whole), places, unit)
    return KeypointColumns([], [], "")


def find_header(lines: Sequence[str]) -> tuple[int, dict[str, str]]:
    """Find where the header of a table of keypoints begins, and what the lines above it say.

    Parameters
    ----------
    lines : sequence of str
        The first lines of a file.

    Returns
    -------
    at : int
        Index of the header's first line; that of the first line that is no comment, if none of
        those that may be a header has columns of keypoints.
    about : dict of str
        By the key, in small letters with ``_`` for blanks.
    """
    about: dict[str, str] = {}
    first = None
    for at, line in enumerate(lines[:ABOVE_LINES]):
        bare = line.strip(" \t\r\n,;")
        is_comment = bare.startswith("#")
        said = (_ABOUT if is_comment else _ABOUT_BARE).fullmatch(bare)
        if bare and not is_comment:
            first = at if first is None else first
            if has_keypoints(lines[at : at + HEADER_LINES]):
                return at, about
        if said:
            about.setdefault(re.sub(r"\W+", "_", said[1].lower()), said[2])
        elif bare and not is_comment and (first != at or any(mark in bare for mark in "\t;,")):
            # Of lines that say nothing only a title may stand above.
            break
    return first or 0, about


def has_keypoints(lines: Sequence[str]) -> bool:
    """Tell whether the first of some lines begins the header of a table of keypoints."""
    if len(lines[0]) < 8:
        return False
    separator = max("\t;,", key=lines[0].count)
    rows = [[cell.strip().strip('"').strip() for cell in line.split(separator)] for line in lines]
    if len(rows[0]) <= 2:
        return False
    return bool(find_columns(join_header(rows)[0]).names or find_row_columns(rows[0]))


def is_keypoint_table(text: str) -> bool:
    """Tell a table of keypoints by its first lines, whatever `find_header` finds above it.

    Parameters
    ----------
    text : str
        The beginning of a file, without blank lines before it.
    """
    lines = text.splitlines()[: ABOVE_LINES + HEADER_LINES]
    at, _ = find_header(lines)
    return bool(lines) and has_keypoints(lines[at : at + HEADER_LINES])
