"""C3D: points in float or integer frames, gaps as residual -1."""

from __future__ import annotations

import re
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError, RecordingWarning
from besman.io.atomic_files import written_aside
from besman.io.recordings.c3d_layout import MAX_FRAMES, C3dSections, read_sections
from besman.io.recordings.format import Units
from besman.records import FloatArray, Recording
from besman.records.recordings import RATES_HZ

_UNIT_M = {
    "mm": 1e-3,
    "millimeter": 1e-3,
    "millimeters": 1e-3,
    "millimetre": 1e-3,
    "millimetres": 1e-3,
    "m": 1.0,
    "meter": 1.0,
    "meters": 1.0,
    "metre": 1.0,
    "metres": 1.0,
}
# Points seen together lie this far apart only in millimetres: metres would be a town.
_SURELY_MM = 300.0
# Points that are no positions, by the parameter that lists them.
_NO_POSITIONS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")
_UNNAMED = re.compile(r"\*\d*")


def read_c3d(path: Path, units: Units | None = None, partial: bool = False) -> Recording:
    """Read the points of a C3D file.

    A gap is a point with residual -1 or with coordinates that are no numbers. Unnamed points
    (``*0``, ``*1``, ...) have no name; the prefix of names such as ``subject:LASI`` is left out if
    there is only one. Points that are listed as angles, forces, moments, powers or scalars are
    left out.

    Parameters
    ----------
    path : Path
        The file.
    units : "m" or "mm", optional
        What the coordinates are in, for a file that does not say so.
    partial : bool
        Take the whole frames of a file that was cut.

    Returns
    -------
    Recording
        Positions in metres, time in seconds: ``(frame - 1) / rate``.

    Raises
    ------
    RecordingError
        If the file is missing, cut, damaged, has two points with one name, or if its units
        cannot be told.

    Warns
    -----
    RecordingWarning
        If the file names no units and only millimetres can be meant.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    sections = read_sections(content, path, partial)
    coordinates, residuals = sections.points[..., :3], sections.points[..., 3]
    gaps = (residuals < 0) | ~np.isfinite(coordinates).all(axis=2)
    positions = np.where(gaps[..., None], np.nan, coordinates)
    labels = _values(sections, "LABELS")[: positions.shape[1]]
    labels += [""] * (positions.shape[1] - len(labels))
    others = {name for kind in _NO_POSITIONS for name in _values(sections, kind)}
    kept = [index for index, label in enumerate(labels) if not label or label not in others]
    if not kept:
        raise RecordingError(f"{path}: no points that are positions; expected at least one marker")
    names = _read_names([labels[index] for index in kept], [index + 1 for index in kept], path)
    positions = positions[:, kept]
    rate_hz = _read_rate(sections, path)
    scale = _read_scale(sections, positions, units, path)
    return Recording(
        # Some count frames from 1, as the format says, some from 0.
        time=(max(sections.first_frame - 1, 0) + np.arange(len(positions))) / rate_hz,
        positions=positions * scale,
        names=names,
        rate_hz=rate_hz,
        source=path.name,
        first_frame=sections.first_frame,
    )


def write_c3d(recording: Recording, path: Path) -> None:
    """Write a C3D file in millimetres; the same recording gives the same bytes.

    Parameters
    ----------
    recording : Recording
        What to write, rounded to single precision. Gaps get residual -1; trajectories without a
        name are called ``*0``, ``*1``, ...
    path : Path
        The file; replaced if it exists.

    Raises
    ------
    RecordingError
        If the recording has more frames or points than C3D can count, or the file cannot be
        written.
    """
    import ezc3d

    n_samples, n_points = recording.positions.shape[:2]
    last_frame = max(recording.first_frame, 1) + n_samples - 1
    if last_frame > MAX_FRAMES or n_points > MAX_FRAMES:
        raise RecordingError(
            f"{path}: got {n_points} points and frames up to {last_frame}; C3D counts up to "
            f"{MAX_FRAMES} of both: write .tsv, which has no such limit"
        )
    positions = recording.positions.transpose(2, 1, 0)
    gaps = ~np.isfinite(positions).all(axis=0)
    coordinates = np.ones((4, n_points, n_samples))
    coordinates[:3] = np.where(gaps, 0.0, positions * 1000.0)
    file = ezc3d.c3d()
    file["header"]["points"]["first_frame"] = max(recording.first_frame - 1, 0)
    points = file["parameters"]["POINT"]
    points["RATE"]["value"] = [recording.rate_hz]
    points["UNITS"]["value"] = ["mm"]
    unnamed = iter(range(n_points))
    points["LABELS"]["value"] = [name or f"*{next(unnamed)}" for name in recording.names]
    file["data"]["points"] = coordinates
    file["data"]["meta_points"] = {
        "residuals": np.where(gaps, -1.0, 0.0)[None],
        "camera_masks": np.zeros((7, n_points, n_samples), dtype=bool),
    }
    # The library puts an ending of its own behind others and says nothing if it cannot write.
    with tempfile.TemporaryDirectory() as folder:
        written = Path(folder) / "recording.c3d"
        file.write(str(written))
        content = written.read_bytes() if written.is_file() else b""
    # Word 9 of the header says in which block of 512 bytes the data begin.
    data_start = 512 * (int.from_bytes(content[16:18], "little") - 1)
    if len(content) < data_start + 4 * coordinates.size:
        raise RecordingError(
            f"{path}: cannot be written: {tempfile.gettempdir()}, where it is made, is full or "
            "read-only"
        )
    with written_aside(path, kind=RecordingError) as temporary:
        temporary.write_bytes(content)


def _values(sections: C3dSections, name: str) -> list[str]:
    """Return the texts of a parameter of the points; beyond 255 they go on in NAME2, NAME3, ..."""
    values: list[str] = []
    number = 1
    while (key := f"POINT:{name}{'' if number == 1 else number}") in sections.parameters:
        values += [str(value) for value in sections.parameters[key]]
        number += 1
    return values


def _read_names(
    labels: Sequence[str], numbers: Sequence[int], path: Path
) -> tuple[str | None, ...]:
    """Turn labels into names: None for unnamed points, without a prefix common to all."""
    prefixes = {label.split(":", 1)[0] for label in labels if ":" in label}
    bare = [label.split(":", 1)[-1].strip() if len(prefixes) == 1 else label for label in labels]
    names = [None if not name or _UNNAMED.fullmatch(name) else name for name in bare]
    owners: dict[str, int] = {}
    for index, name in enumerate(names):
        other = owners.setdefault(name, index) if name else index
        if other != index:
            raise RecordingError(
                f"{path}: points {numbers[other]} ({labels[other]!r}) and {numbers[index]} "
                f"({labels[index]!r}) are both named {name!r}; expected each name once"
            )
    return tuple(names)


def _read_rate(sections: C3dSections, path: Path) -> float:
    """Return frames per second."""
    values = sections.parameters.get("POINT:RATE") or [sections.rate_hz]
    # The shortest number that means the same in the file's single precision.
    rate = values[0] if isinstance(values[0], float) else float("nan")
    slowest, fastest = RATES_HZ
    if not slowest <= rate <= fastest:
        raise RecordingError(
            f"{path}: POINT:RATE is {values[0]!r:.60}; expected frames per second, {slowest:g} to "
            f"{fastest:g}"
        )
    return float(str(np.float32(rate)))


def _read_scale(
    sections: C3dSections, positions: FloatArray, units: Units | None, path: Path
) -> float:
    """Return the length of the file's unit in metres."""
    written = sorted(set(_values(sections, "UNITS")) - {""})
    if len(written) > 1 or (written and written[0].lower() not in _UNIT_M):
        raise RecordingError(
            f"{path}: POINT:UNITS is {', '.join(map(repr, written))}; expected 'mm' or 'm'"
        )
    if written:
        return _UNIT_M[written[0].lower()]
    if units is not None:
        return _UNIT_M[units]
    extent = _typical_extent(positions)
    if extent < _SURELY_MM:
        raise RecordingError(
            f"{path}: POINT:UNITS is empty and points seen together lie {extent:.3g} apart, so the "
            "units cannot be told; expected 'mm' or 'm' in the file, or given as units"
        )
    warnings.warn(
        f"{path.name}: POINT:UNITS is empty; points seen together lie {extent:.0f} apart, "
        "so the units are taken for mm",
        RecordingWarning,
        stacklevel=3,
    )
    return _UNIT_M["mm"]


def _typical_extent(positions: FloatArray) -> float:
    """Return the median over time of the diagonal of the box around all points seen."""
    high = np.where(np.isnan(positions), -np.inf, positions).max(axis=1)
    low = np.where(np.isnan(positions), np.inf, positions).min(axis=1)
    seen = np.isfinite(high).all(axis=1)
    if not seen.any():
        return 0.0
    return float(np.median(np.linalg.norm(high[seen] - low[seen], axis=1)))
