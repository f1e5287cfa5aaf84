"""Joint logs of an exoskeleton: CSV of joint angles and a URDF, to positions of the arm."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from besman.config.resources import find_resource
from besman.exceptions import ConfigError, RecordingError, nearest
from besman.foreign.names import fault_of_name
from besman.foreign.paths import is_file
from besman.geometry.frames import rotation_to_quaternion
from besman.io.atomic_files import written_aside
from besman.io.recordings.exoskeleton_kinematics import (
    frame_id,
    link_poses,
    load_exoskeleton_model,
)
from besman.io.recordings.joint_table import (
    ANGLE_UNITS,
    TIME_COLUMN,
    is_last_row_cut,
    rate_of_times,
    table_head,
    table_lines,
    table_values,
)
from besman.records import FloatArray, Recording

_BODY = re.compile(r"(?:(?:left|right)_)?(?:shoulder|elbow|wrist)")
_EXAMPLE = "'# frames: shoulder=LINK elbow=LINK wrist=LINK'"
# No joint turns farther, in rad, or slides, in m.
_GREATEST_ANGLE = 1000.0
_ROTATION_TOLERANCE = 1e-6


def read_joint_log(path: Path, partial: bool = False) -> Recording:
    """Read a joint log and compute where shoulder, elbow and wrist were.

    Two comments head the file: ``# urdf: NAME``, a file beside it or the name of one of
    ``configs/exoskeleton``, and ``# frames: shoulder=LINK elbow=LINK wrist=LINK``, for two arms
    with ``right_`` and ``left_``. The columns are ``time_s`` and one a joint: its name, in
    radians, or with ``_deg`` in degrees (with ``_rad`` in radians). A sliding joint is in metres.

    Parameters
    ----------
    path : Path
        The file.
    partial : bool
        Take the rows before the last one of a file that was cut.

    Returns
    -------
    Recording
        One trajectory a link in the order of ``# frames``, with orientations, in the frame of the
        URDF's root (metres, z up); time as logged.

    Raises
    ------
    RecordingError
        If the file is missing or cut, its times do not rise evenly, a joint or link is not in the
        URDF or not in the log, or a joint's value is none.
    """
    lines, is_ended = table_lines(path)
    comments, columns, data_line = table_head(lines, path)
    bodies = _read_bodies(comments, path)
    model = load_exoskeleton_model(_find_urdf(comments, path), path)
    if not is_ended and is_last_row_cut(lines[data_line:], columns):
        is_short = lines[-1].count(",") < len(columns) - 1
        if partial:
            lines.pop()
        elif not is_short:
            raise RecordingError(
                f"{path}:{len(lines)}: the line ends before those above it do; is the file cut? "
                "--partial takes what is there"
            )
    values = table_values(lines[data_line:], columns, data_line, path)
    rate_hz = rate_of_times(values[:, 0], data_line, path)
    angles = _assign_joints(columns[1:], values[:, 1:], model, bodies, (path, data_line))
    rotations, origins = link_poses(model, angles, tuple(bodies.values()))
    _check_rotations(rotations, tuple(bodies), (path, data_line))
    return Recording(
        time=values[:, 0],
        positions=origins,
        names=tuple(bodies),
        rate_hz=rate_hz,
        source=path.name,
        orientations=rotation_to_quaternion(rotations),
    )


def find_log_files(path: Path) -> tuple[Path, ...]:
    """Return the files that a joint log is read with: its URDF.

    Raises
    ------
    RecordingError
        If the log cannot be read, or names no URDF that is there.
    """
    return (_find_urdf(table_head(table_lines(path)[0], path)[0], path),)


def write_joint_log(
    path: Path,
    time: FloatArray,
    angles: FloatArray,
    joint_names: Sequence[str],
    urdf: str,
    bodies: Mapping[str, str],
) -> None:
    """Write a joint log; the same values give the same bytes.

    Parameters
    ----------
    path : Path
        The file; replaced if it exists.
    time : array, shape (T,)
        Seconds, rising evenly.
    angles : array, shape (T, n)
        Joint angles, rad; rounded to 1e-6.
    joint_names : sequence of str, length n
        Names of the joints in the URDF.
    urdf : str
        What ``# urdf`` names: a file in the folder of `path` or one of ``configs/exoskeleton``.
    bodies : mapping of str to str
        Link of each of shoulder, elbow, wrist, with ``right_`` or ``left_`` for two arms.
    """
    frames = " ".join(f"{body}={link}" for body, link in bodies.items())
    table = np.round(np.column_stack([time, angles]), 6) + 0.0
    with (
        written_aside(path, kind=RecordingError) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as file,
    ):
        file.write(f"# urdf: {urdf}\n# frames: {frames}\n")
        file.write(",".join([TIME_COLUMN, *joint_names]) + "\n")
        np.savetxt(file, table, fmt="%.6f", delimiter=",")


def _read_bodies(comments: dict[str, str], path: Path) -> dict[str, str]:
    """Return the link of each body part."""
    bodies: dict[str, str] = {}
    for entry in comments.get("frames", "").replace(",", " ").split():
        body, _, link = entry.partition("=")
        if not (_BODY.fullmatch(body) and link) or body in bodies:
            raise RecordingError(
                f"{path}: # frames: got {entry!r}; expected {_EXAMPLE}, each once, with right_ or "
                "left_ for two arms"
            )
        bodies[body] = link
    if not bodies:
        raise RecordingError(f"{path}: no comment '# frames'; expected {_EXAMPLE}")
    return bodies


def _find_urdf(comments: dict[str, str], path: Path) -> Path:
    """Return the URDF that the log names; a file must lie in the folder of the log."""
    name = comments.get("urdf", "")
    if not name:
        raise RecordingError(f"{path}: no comment '# urdf'; expected '# urdf: NAME.urdf'")
    if not name.endswith(".urdf"):
        try:
            return find_resource("configs/exoskeleton", name, ".urdf")
        except ConfigError as error:
            raise RecordingError(f"{path}: # urdf: {error}") from None
    fault = fault_of_name(name)
    if fault is not None:
        raise RecordingError(f"{path}: # urdf: the name {name!r:.60} {fault}")
    folder = path.parent.resolve()
    urdf = (folder / name).resolve()
    if not urdf.is_relative_to(folder):
        raise RecordingError(f"{path}: # urdf: {name!r} lies outside the folder of the log")
    if not is_file(urdf):
        raise RecordingError(f"{path}: # urdf: no file {name!r} in the folder of the log")
    return urdf


def _assign_joints(
    columns: list[str],
    values: FloatArray,
    model: Any,
    bodies: dict[str, str],
    place: tuple[Path, int],
) -> dict[str, FloatArray]:
    """Return the values of every joint by its name, in rad or m."""
    path, data_line = place
    joints = list(model.names)[1:]
    angles: dict[str, FloatArray] = {}
    for column, series in zip(columns, values.T, strict=True):
        factor = 1.0
        name = column
        if column not in joints and column[-4:] in ANGLE_UNITS:
            name, factor = column[:-4], ANGLE_UNITS[column[-4:]]
        if name not in joints:
            raise RecordingError(
                f"{path}: column {column!r}: no such joint in the URDF; {nearest(name, joints)}"
            )
        if name in angles:
            raise RecordingError(f"{path}: two columns for joint {name!r}; expected one")
        angles[name] = series * factor
        wrong = np.flatnonzero(np.abs(angles[name]) > _GREATEST_ANGLE)
        if wrong.size:
            row = int(wrong[0])
            raise RecordingError(
                f"{path}:{data_line + row + 1}: joint {name!r}: got {series[row]:g}; expected at "
                f"most {_GREATEST_ANGLE:g} rad (or m)"
            )
    _check_links(model, bodies, angles, path)
    return angles


def _check_rotations(rotations: FloatArray, bodies: Sequence[str], place: tuple[Path, int]) -> None:
    """Refuse rotations (T, M, 3, 3) that are none: joints of a URDF may have axes that are none."""
    path, data_line = place
    apart = np.abs(rotations @ np.swapaxes(rotations, -1, -2) - np.eye(3)).max(axis=(2, 3))
    wrong = np.argwhere(~(apart <= _ROTATION_TOLERANCE))
    if wrong.size:
        row, column = (int(index) for index in wrong[0])
        raise RecordingError(
            f"{path}:{data_line + row + 1}: {bodies[column]}: the joints of the URDF and their "
            "values give no rotation; are the joints' axes and angles right?"
        )


def _check_links(
    model: Any, bodies: dict[str, str], angles: dict[str, FloatArray], path: Path
) -> None:
    """Refuse a link that is not there, or that moves by a joint which was not logged."""
    import pinocchio

    links = [frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY]
    for body, link in bodies.items():
        if link not in links:
            raise RecordingError(
                f"{path}: # frames: {body}={link}: no such link in the URDF; {nearest(link, links)}"
            )
        for joint in model.supports[model.frames[frame_id(model, link)].parentJoint]:
            if joint == 0:
                continue
            name = model.names[joint]
            if model.joints[joint].nv != 1:
                raise RecordingError(f"{path}: joint {name!r} of the URDF has more than one axis")
            if name not in angles:
                raise RecordingError(
                    f"{path}: no column for joint {name!r}, which moves {body} ({link})"
                )
