"""What a file's coordinates are in: by its own word, as asked for, or by the size of a person."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.io.recordings.format import Units
from besman.io.warning import warn_of_file
from besman.records import FloatArray

UNIT_M = {"m": 1.0, "cm": 0.01, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
"""Metres of each unit that can be asked for."""

_WORDS = (
    ("mm", re.compile(r"mm|mill?(i(m(et(er|re)?s?)?)?)?", re.IGNORECASE)),
    ("cm", re.compile(r"cm|cent(i(m(et(er|re)?s?)?)?)?", re.IGNORECASE)),
    # Where text is four letters long, `mete` and `metr` are what is left of it.
    ("m", re.compile(r"m|met(e|er|r|re)s?", re.IGNORECASE)),
    ("ft", re.compile(r"ft|foot|feet", re.IGNORECASE)),
    ("in", re.compile(r"in|inch(es)?", re.IGNORECASE)),
)
# Points of a person seen together lie this far apart: from a hand with its fingers, in metres, to
# several people in a hall. Where two units would do it is the one that is usual.
# Points of a person are seen so far apart, in metres, if they are as many.
_ANY_M, _MANY_POINTS = (0.02, 60.0), 4
_RANGES = (("mm", 300.0, 100_000.0), ("cm", 15.0, 300.0), ("m", 0.05, 15.0))


_CMU = "1/0.45 in"
# What a person's greatest extent, 0.9 to 2.3 m, is in each unit; where two would do, the usual one.
_HEIGHTS = (
    ("m", 0.8, 2.6),
    ("ft", 3.0, 7.6),
    (_CMU, 16.0, 39.0),
    ("in", 39.0, 80.0),
    ("cm", 80.0, 260.0),
    ("mm", 800.0, 2600.0),
)
_FRAMES = 200
_MANY_FRAMES = 2000


class Length(NamedTuple):
    """The unit of a file's coordinates.

    Attributes
    ----------
    metres : float
        Its length.
    name : str
        As in `UNIT_M`.
    told_by : str
        As `besman.records.Origin.units_by`.
    """

    metres: float
    name: str
    told_by: str


def in_metres(values: npt.NDArray[np.floating], unit_m: float) -> FloatArray:
    """Return lengths in metres, as doubles; what is no number, signalling or not, is NaN."""
    with np.errstate(invalid="ignore"):
        return np.asarray(values, np.float64) * unit_m


def parse_unit(word: str) -> str | None:
    """Return the name of a unit as in `UNIT_M`, None if the word is no unit of length."""
    word = word.strip(" .()[]\0")
    return next((name for name, pattern in _WORDS if pattern.fullmatch(word)), None)


def find_length(
    written: str | None,
    asked: Units | None,
    positions: FloatArray,
    where: str,
    key: str,
) -> Length:
    """Tell what coordinates are in.

    Parameters
    ----------
    written : str or None
        The file's word for its unit; None or empty where it has none.
    asked : "m", "cm", "mm", "in" or None
        What the user says; it counts more than the file.
    positions : array, shape (T, M, 3)
        In the file's units.
    where, key : str
        File and the place of the word, for messages.

    Raises
    ------
    RecordingError
        If there is no word, or one that is no unit, and the points' size is no person's.

    Warns
    -----
    RecordingWarning
        If the size of a person decides, what the user says is not what the file says, or by that
        all points lie within a finger's breadth, or farther apart than a hall is long.
    """
    name = parse_unit(written) if written else None
    file_name = where.rpartition("/")[2]
    if asked is not None:
        if name not in (None, asked):
            warn_of_file(
                f"{file_name}: {key} is {written!r:.60} and the units asked for are {asked}"
            )
        return Length(UNIT_M[asked], asked, "asked for")
    if name is not None:
        _doubt(name, positions, f"{file_name}: {key} is {written!r:.60}")
        return Length(UNIT_M[name], name, "the file")
    said = f"{key} is {written!r:.60}" if written else f"{key} is empty"
    extent = typical_extent(positions)
    found = next((unit for unit, low, high in _RANGES if low <= extent < high), None)
    if found is None:
        raise RecordingError(
            f"{where}: {said} and points seen together lie {extent:.3g} apart, so the units cannot "
            "be told; expected 'mm', 'cm' or 'm' in the file, or --units m"
        )
    warn_of_file(
        f"{file_name}: {said}; points seen together lie {extent:.3g} apart, so the units are taken "
        f"for {found}, by the size of a person (--units says otherwise)"
    )
    return Length(UNIT_M[found], found, "the size of a person")


def _doubt(name: str, positions: FloatArray, said: str) -> None:
    """Warn of a file's unit that makes a person of no size."""
    if positions.shape[1] < _MANY_POINTS:
        return
    extent = typical_extent(positions)
    low, high = _ANY_M
    if extent == 0.0 or low <= UNIT_M[name] * extent < high:
        return
    others = [unit for unit, least, most in _RANGES if least <= extent < most]
    guess = (
        f"; in {others[0]} that would be a person's size (--units {others[0]})" if others else ""
    )
    warn_of_file(f"{said}, so points seen together lie {UNIT_M[name] * extent:.3g} m apart{guess}")


def body_length(positions: FloatArray, asked: Units | None, where: str) -> Length:
    """Tell what the coordinates of a whole body are in, by its height.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Of a body from head to feet, in the file's units.
    asked : str or None
        What the user says.
    where : str
        The file, for messages.

    Raises
    ------
    RecordingError
        If the body is of no person's height in any unit.

    Warns
    -----
    RecordingWarning
        With the unit that was told so.
    """
    if asked is not None:
        return Length(UNIT_M[asked], asked, "asked for")
    file_name = where.rpartition("/")[2]
    few = positions[:: max(1, len(positions) // _FRAMES)]
    # NaN where nothing is seen at all.
    spans = np.fmax.reduce(few, axis=1) - np.fmin.reduce(few, axis=1)
    spans = spans[np.isfinite(spans).all(axis=1)].max(axis=1)
    height = float(np.percentile(spans, 90)) if len(spans) else 0.0
    for name, low, high in _HEIGHTS:
        if low <= height < high:
            warn_of_file(
                f"{file_name}: no units are named; the body is {height:.3g} high, so they are "
                f"taken for {name}, by the size of a person (--units says otherwise)"
            )
            return Length({**UNIT_M, _CMU: 0.0254 / 0.45}[name], name, "the size of a person")
    raise RecordingError(
        f"{where}: no units are named and the body is {height:.3g} high, which is no person's in "
        "any unit; expected --units m, cm, mm, in or ft"
    )


def typical_extent(positions: FloatArray) -> float:
    """Return the median over time of the diagonal of the box around all points seen.

    Of long recordings frames all over them are looked at.

    Parameters
    ----------
    positions : array, shape (T, M, 3)

    Returns
    -------
    float
        0 where nothing is seen.
    """
    few = positions[:: max(1, len(positions) // _MANY_FRAMES)]
    # A coordinate after the other, of points side by side: quicker than three at a time.
    columns = np.ascontiguousarray(few.transpose(2, 0, 1))
    high = np.fmax.reduce(columns, axis=2, initial=-np.inf)
    low = np.fmin.reduce(columns, axis=2, initial=np.inf)
    seen = np.isfinite(high).all(axis=0)
    if not seen.any():
        return 0.0
    # Of what is no place, as the text of another file, squares overflow.
    with np.errstate(over="ignore"):
        return float(np.median(np.linalg.norm((high - low)[:, seen], axis=0)))
