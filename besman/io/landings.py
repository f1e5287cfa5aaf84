"""Landing files: where throws came down, measured beside the recordings.

YAML or JSON: ``units``, ``landings`` (a recording's name to ``[x, y]`` or ``[x, y, z]``, or to a
list of these, a throw each), and for places that are measured on a hoop or another plane
``origin_m``, ``x_axis`` and ``y_axis`` of it in the recordings' frame. CSV: ``recording``, ``x_m``,
``y_m`` and maybe ``z_m`` and ``throw``; the ending of the columns says the unit (``x_in``,
``x_ft``, ``x_mm``, ``x_cm``).
"""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from besman.config.stage import Config
from besman.config.yaml_file import parse_config, read_yaml
from besman.exceptions import ConfigError
from besman.foreign.names import fault_of_name
from besman.foreign.numbers import parse_number, parse_whole_number
from besman.io.recordings.format import Units
from besman.io.recordings.lengths import UNIT_M
from besman.records import FloatArray, Landing
from besman.records.recordings import FARTHEST_M

Place = Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
Axis3 = tuple[float, float, float]


class _LandingFile(Config):
    """What a YAML or JSON file says."""

    units: Units
    origin_m: Axis3 = (0.0, 0.0, 0.0)
    x_axis: Axis3 = (1.0, 0.0, 0.0)
    y_axis: Axis3 = (0.0, 1.0, 0.0)
    landings: dict[str, Place | Annotated[tuple[Place, ...], Field(min_length=1)]]

    @field_validator("landings")
    @classmethod
    def _check_number(cls, landings: dict[str, Any]) -> dict[str, Any]:
        if not landings:
            raise ValueError("expected a place [x, y] or [x, y, z] for at least one recording")
        return landings

    @field_validator("x_axis", "y_axis")
    @classmethod
    def _check_axis(cls, axis: Axis3) -> Axis3:
        if not abs(np.linalg.norm(axis) - 1.0) <= 1e-3:
            raise ValueError("expected a direction of length 1")
        return axis


def read_landings(path: Path) -> tuple[Landing, ...]:
    """Read a landing file.

    Parameters
    ----------
    path : Path
        CSV, YAML or JSON, see above.

    Returns
    -------
    tuple of Landing
        Metres in the recordings' laboratory frame (z up).

    Raises
    ------
    ConfigError
        If the file is missing, or does not say recording, place and unit of every landing.
    """
    if path.suffix.lower() == ".csv":
        return _read_csv(path)
    content, lines = read_yaml(path)
    file = parse_config(content, _LandingFile, path, lines)
    x, y = np.array(file.x_axis), np.array(file.y_axis)
    axes = np.column_stack([x, y, np.cross(x, y)])
    found = []
    for recording, said in file.landings.items():
        places = said if isinstance(said[0], tuple) else (said,)
        for throw, place in enumerate(places, start=1):
            flat = np.array([*place, 0.0][:3], dtype=float) * UNIT_M[file.units]
            where = np.array(file.origin_m) + axes @ flat
            found.append(_land(recording, throw, where, str(path)))
    return tuple(found)


def _read_csv(path: Path) -> tuple[Landing, ...]:
    """Read a table."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read as text: {error}") from None
    rows = csv.DictReader(text.splitlines())
    columns = [name.strip() for name in rows.fieldnames or ()]
    unit = next((one for one in UNIT_M if {f"x_{one}", f"y_{one}"} <= set(columns)), None)
    if unit is None or "recording" not in columns:
        raise ConfigError(
            f"{path}: columns {', '.join(columns) or 'none'}; expected recording, x_m, y_m and "
            f"maybe z_m and throw, with the unit as ending: {', '.join(UNIT_M)}"
        )
    found = []
    try:
        for row in rows:
            cells = {str(key).strip(): str(value or "").strip() for key, value in row.items()}
            where = f"{path}:{rows.line_num}"
            place = np.array([_read_cell(cells, axis, unit, where) for axis in "xyz"])
            throw = _read_throw(cells.get("throw") or "1", where)
            found.append(_land(cells["recording"], throw, place * UNIT_M[unit], where))
    except csv.Error as error:
        raise ConfigError(f"{path}:{rows.line_num}: {error}; is this a table?") from None
    if not found:
        raise ConfigError(f"{path}: no landings below the header; expected a row for each throw")
    return _check_twins(found, path)


def _read_cell(cells: dict[str, str], axis: str, unit: str, where: str) -> float:
    """Return a coordinate; z need not be there."""
    key = f"{axis}_{unit}"
    text = cells.get(key, "")
    if axis == "z" and not text:
        return 0.0
    try:
        return parse_number(text)
    except ValueError:
        raise ConfigError(f"{where}: {key}: got {text!r:.60}; expected a number") from None


def _read_throw(text: str, where: str) -> int:
    """Return the number of a throw."""
    try:
        throw = parse_whole_number(text)
    except ValueError:
        throw = 0
    if throw < 1:
        raise ConfigError(f"{where}: throw: got {text!r:.60}; expected a whole number from 1")
    return throw


def _land(recording: str, throw: int, place: FloatArray, where: str) -> Landing:
    """Make a landing of what makes sense."""
    fault = fault_of_name(recording) if recording.strip() else "is empty"
    if fault is not None:
        raise ConfigError(f"{where}: recording {recording!r:.60} {fault}")
    if not np.all(np.abs(place) <= FARTHEST_M):
        raise ConfigError(
            f"{where}: {recording} comes down at {place.tolist()} m; expected a place within "
            f"{FARTHEST_M:g} m"
        )
    return Landing(recording, throw, place)


def _check_twins(found: list[Landing], path: Path) -> tuple[Landing, ...]:
    """Refuse two places for one throw."""
    counts = Counter((one.recording, one.throw) for one in found)
    twice = [which for which, count in counts.items() if count > 1]
    if twice:
        recording, throw = twice[0]
        raise ConfigError(
            f"{path}: throw {throw} of {recording} comes down {counts[twice[0]]} times; expected "
            "one row for each throw"
        )
    return tuple(found)
