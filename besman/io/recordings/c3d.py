"""C3D: points in float or integer frames, gaps as residual -1."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import cast

import numpy as np

from besman.exceptions import RecordingError
from besman.geometry.gaps import find_seen
from besman.io.atomic_files import written_aside
from besman.io.recordings.bodies import from_matrices, hold_orientations
from besman.io.recordings.c3d_counts import MAX_FRAMES
from besman.io.recordings.c3d_layout import C3dSections, read_sections
from besman.io.recordings.c3d_names import find_names
from besman.io.recordings.format import READING, Units
from besman.io.recordings.lengths import find_length, parse_unit
from besman.records import Axis, FloatArray, Origin, Recording
from besman.records.frozen import hand_over
from besman.records.recordings import RATES_HZ

# Points that are no positions, by the parameter that lists them.
_NO_POSITIONS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
# What a user's model gives; each has a parameter that says of what kind its three numbers are, as
# ``Modeled Angles:x:Angle``.
_OF_USERS = "USERMOS"
_PLACES = ("length", "position", "distance")
_EVENTS_NAMED = 8
_OF_BODIES = re.compile(r"_4X4$", re.IGNORECASE)
_SCREEN_AXES = {
    sign + axis: cast(Axis, sign.replace("+", "") + axis)
    for axis in "xyz"
    for sign in ("", "+", "-")
}


def read_c3d(path: Path, units: Units | None = None, partial: bool = False) -> Recording:
    """Read the points of a C3D file.

    A gap is a point with residual -1 or with coordinates that are no numbers. Names are found as
    `besman.io.recordings.c3d_names` says. Points that are listed as angles, forces, moments,
    powers, scalars, reactions or outputs of a user's model (USERMOS) are left out. X_SCREEN and
    Y_SCREEN tell which way is up. Events become notes.

    Variants seen: Intel, DEC and SGI/MIPS; floats and integers; frames from 0 and from 1; LABELS2
    and on; labels of four letters with whole names as descriptions; parameters without the byte of
    their description; no units, or ``mete``; analog words counted wrong (`c3d_layout`); more than
    65,535 frames with TRIAL:ACTUAL_END_FIELD; segments in place of points (ROTATION, Theia3D).

    Parameters
    ----------
    path : Path
        The file.
    units : "m", "cm", "mm" or "in", optional
        What the coordinates are in, whatever the file says.
    partial : bool
        Take the whole frames of a file that was cut.

    Returns
    -------
    Recording
        Positions in metres and in the file's frame, time in seconds: ``(frame - 1) / rate``.

    Raises
    ------
    RecordingError
        If the file is missing, cut, damaged, or if its units cannot be told.

    Warns
    -----
    RecordingWarning
        If the size of a person tells the units, and for names that several points have.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    sections = read_sections(content, path, partial)
    if sections.bodies is not None:
        return _make_of_bodies(sections, sections.bodies, units, path)
    coordinates, residuals = sections.points[..., :3], sections.points[..., 3]
    n_points = coordinates.shape[1]
    labels = _values(sections, "LABELS")[:n_points]
    labels += [""] * (n_points - len(labels))
    others = _find_outputs(sections)
    kept = [index for index, label in enumerate(labels) if not label or label not in others]
    if not kept:
        raise RecordingError(f"{path}: no points that are positions; expected at least one marker")
    about = _values(sections, "DESCRIPTIONS")[: len(labels)]
    about += [""] * (len(labels) - len(about))
    positions = np.take(coordinates, kept, axis=1)
    positions[(residuals[:, kept] < 0) | ~find_seen(positions)] = np.nan
    names = find_names(
        [labels[index] for index in kept], [about[index] for index in kept], positions, path.name
    )
    rate_hz = _read_rate(sections, path)
    length = find_length(_unit_word(sections), units, positions, str(path), "POINT:UNITS")
    positions *= length.metres
    up = _read_up(sections)
    return Recording(
        # Some count frames from 1, as the format says, some from 0.
        time=(max(sections.first_frame - 1, 0) + np.arange(len(positions))) / rate_hz,
        positions=hand_over(positions),
        names=names,
        rate_hz=rate_hz,
        source=path.name,
        first_frame=sections.first_frame,
        origin=Origin(
            writer=_text(sections, "MANUFACTURER:SOFTWARE", "MANUFACTURER:COMPANY"),
            units=length.name,
            units_by=length.told_by,
            up=up or "z",
            up_by="POINT:X_SCREEN and Y_SCREEN" if up else "",
            notes=(
                *sections.notes,
                *_tell_outputs(len(labels) - len(kept)),
                *_read_events(sections),
            ),
        ),
    )


def _make_of_bodies(
    sections: C3dSections, bodies: FloatArray, units: Units | None, path: Path
) -> Recording:
    """Return the segments of a markerless system, with their orientations."""
    matrices = bodies[..., :16].reshape(*bodies.shape[:2], 4, 4)
    positions = np.array(matrices[..., 3, :3])
    positions[(bodies[..., 16] < 0) | ~find_seen(positions)] = np.nan
    # Columns stand one behind the other, so that rows of what was read are the body's axes.
    turns = from_matrices(matrices[..., :3, :3].swapaxes(-1, -2))
    labels = _values(sections, "LABELS", "ROTATION")[: positions.shape[1]]
    labels = [_OF_BODIES.sub("", label) for label in labels]
    labels += [""] * (positions.shape[1] - len(labels))
    rate_hz = _read_rate(sections, path, "ROTATION:RATE")
    words = [one for one in _values(sections, "UNITS", "ROTATION") if parse_unit(one)]
    length = find_length(next(iter(words), None), units, positions, str(path), "ROTATION:UNITS")
    positions *= length.metres
    return Recording(
        time=(sections.first_frame - 1 + np.arange(len(positions))) / rate_hz,
        positions=hand_over(positions),
        names=find_names(labels, [""] * len(labels), positions, path.name),
        rate_hz=rate_hz,
        source=path.name,
        first_frame=sections.first_frame,
        orientations=hold_orientations(turns),
        origin=Origin(
            writer=_text(sections, "MANUFACTURER:SOFTWARE", "MANUFACTURER:COMPANY"),
            units=length.name,
            units_by=length.told_by,
            notes=_read_events(sections),
        ),
    )


def _find_outputs(sections: C3dSections) -> set[str]:
    """Return the labels of points that are angles, forces or what else a model gives."""
    outputs = {name for kind in _NO_POSITIONS for name in _values(sections, kind)}
    for name in _values(sections, _OF_USERS):
        about = map(str, sections.parameters.get(f"POINT:{name.upper()}", []))
        kinds = [one.rpartition(":")[2].strip().lower() for one in about]
        if any(kind and kind not in _PLACES for kind in kinds):
            outputs.add(name)
    return outputs


def _tell_outputs(count: int) -> tuple[str, ...]:
    """Say how many points are no positions."""
    if not count:
        return ()
    what = "point is no position" if count == 1 else "points are no positions"
    return (f"{count} {what} but angles, forces or other outputs of a model, and left out",)


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


def _values(sections: C3dSections, name: str, group: str = "POINT") -> list[str]:
    """Return the texts of a parameter of a group; beyond 255 they go on in NAME2, NAME3, ..."""
    values: list[str] = []
    number = 1
    while (key := f"{group}:{name}{'' if number == 1 else number}") in sections.parameters:
        values += [str(value) for value in sections.parameters[key]]
        number += 1
    return values


def _read_rate(sections: C3dSections, path: Path, key: str = "POINT:RATE") -> float:
    """Return frames per second."""
    asked_hz = READING.get().rate_hz
    if asked_hz is not None:
        return asked_hz
    values = sections.parameters.get(key) or [sections.rate_hz]
    if values == [0.0]:
        values = [sections.rate_hz]
    # The shortest number that means the same in the file's single precision.
    rate = values[0] if isinstance(values[0], float) else float("nan")
    slowest, fastest = RATES_HZ
    if not slowest <= rate <= fastest:
        raise RecordingError(
            f"{path}: {key} is {values[0]!r:.60}; expected frames per second, {slowest:g} to "
            f"{fastest:g}"
        )
    return float(str(np.float32(rate)))


def _unit_word(sections: C3dSections) -> str | None:
    """Return the file's word for its unit of length; None if it has none, or several."""
    written = sorted(set(_values(sections, "UNITS")) - {""})
    # Some list the units of angles and forces beside that of the positions.
    lengths = [word for word in written if parse_unit(word) is not None]
    if len({parse_unit(word) for word in lengths}) == 1:
        return lengths[0]
    return ", ".join(written) or None


def _text(sections: C3dSections, *keys: str) -> str:
    """Return texts of the file in one line, of the parameters that it has."""
    words = (" ".join(str(one) for one in sections.parameters.get(key, ())[:1]) for key in keys)
    return "".join(one for one in ", ".join(filter(None, words)) if one.isprintable())[:80]


def _read_up(sections: C3dSections) -> Axis | None:
    """Return the axis of the file that points up, as the screen's axes say; None if they do not."""
    screen = [
        _SCREEN_AXES.get(str((_values(sections, key) or [""])[0]).lower())
        for key in ("X_SCREEN", "Y_SCREEN")
    ]
    across, upwards = screen
    if across is None or upwards is None or across[-1] == upwards[-1]:
        return None
    return upwards


def _read_events(sections: C3dSections) -> tuple[str, ...]:
    """Say what events the file has; a recording has none."""
    labels = [str(one) for one in sections.parameters.get("EVENT:LABELS", ())]
    sides = [str(one) for one in sections.parameters.get("EVENT:CONTEXTS", ())]
    # Minutes and seconds of each.
    times = sections.parameters.get("EVENT:TIMES", ())
    n_events = min(len(labels), len(times) // 2)
    found = []
    for at in range(n_events):
        minutes, seconds = times[2 * at : 2 * at + 2]
        if isinstance(minutes, float) and isinstance(seconds, float):
            side = sides[at] if at < len(sides) else ""
            found.append(f"{side} {labels[at]} {60 * minutes + seconds:.3f} s".strip())
    if not found:
        return ()
    more = f" and {len(found) - _EVENTS_NAMED} more" if len(found) > _EVENTS_NAMED else ""
    said = f"events: {', '.join(found[:_EVENTS_NAMED])}{more}"
    return ("".join(one for one in said if one.isprintable()),)
