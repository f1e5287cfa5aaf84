"""Landing files: where throws came down, measured beside the recordings.

YAML or JSON: ``units``, ``landings`` (a recording's name to ``[x, y]`` or ``[x, y, z]``, or to a
list of these, a throw each), and for places that are measured on a hoop or another plane
``origin_m``, ``x_axis`` and ``y_axis`` of it in the recordings' frame. CSV: ``recording``, ``x_m``,
``y_m`` and maybe ``z_m`` and ``throw``; the ending of the columns says the unit (``x_in``,
``x_ft``, ``x_mm``, ``x_cm``).
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator

from besman.config.stage import Config
from besman.config.yaml_file import parse_config, read_yaml
from besman.exceptions import ConfigError
from besman.io.recordings.format import Units
from besman.io.recordings.lengths import UNIT_M
from besman.records import Landing

Place = Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
Axis3 = tuple[float, float, float]


class _LandingFile(Config):
    """What a YAML or JSON file says."""

    units: Units
    origin_m: Axis3 = (0.0, 0.0, 0.0)
    x_axis: Axis3 = (1.0, 0.0, 0.0)
    y_axis: Axis3 = (0.0, 1.0, 0.0)
    landings: dict[str, Place | tuple[Place, ...]]

    @field_validator("landings")
    @classmethod
    def _check_number(cls, landings: dict[str, Any]) -> dict[str, Any]:
        if not landings:
            raise ValueError("expected a place [x, y] or [x, y, z] for at least one recording")
        return landings

    @field_validator("x_axis", "y_axis")
    @classmethod
    def _check_axis(cls, axis: Axis3) -> Axis3:
        if abs(np.linalg.norm(axis) - 1.0) > 1e-3:
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
            found.append(Landing(recording, throw, np.array(file.origin_m) + axes @ flat))
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
    for row in rows:
        cells = {str(key).strip(): str(value or "").strip() for key, value in row.items()}
        try:
            place = [float(cells.get(f"{axis}_{unit}") or 0.0) for axis in "xyz"]
            throw = int(cells.get("throw") or 1)
        except ValueError as error:
            raise ConfigError(f"{path}:{rows.line_num}: {error}; expected numbers") from None
        if not np.isfinite(place).all():
            raise ConfigError(f"{path}:{rows.line_num}: got {place}, expected finite numbers")
        found.append(Landing(cells["recording"], throw, np.array(place) * UNIT_M[unit]))
    if not found:
        raise ConfigError(f"{path}: no landings below the header; expected a row for each throw")
    return tuple(found)
