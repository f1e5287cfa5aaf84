"""What an arm did, as its controller logged it: joint angles over time, as CSV or in a bag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError, one_of
from besman.io.recordings.joint_table import (
    ANGLE_UNITS,
    rate_of_times,
    table_head,
    table_lines,
    table_values,
)
from besman.io.ros_messages import MCAP, ROS_1, SQLITE
from besman.records import FloatArray

ENDINGS = (".csv", ".mcap", ".db3", ".bag")
"""Of the files in a folder that are taken for logs."""

# No joint turns farther.
_GREATEST_RAD = 1000.0
# What counts from 1970 is that late since 1973; nobody waits as long for a motion.
_DATE_S = 1e8


@dataclass(frozen=True, eq=False)
class Execution:
    """One movement of an arm.

    Attributes
    ----------
    source : Path
        The file.
    time : array, shape (T,)
        Seconds, rising evenly.
    positions : array, shape (T, n)
        rad.
    is_aligned : bool
        Whether time counts from the moment at which the motion was sent off, as far as the file can
        tell: that of a bag counts from its first message, and dates from the first of them.
    """

    source: Path
    time: FloatArray
    positions: FloatArray
    is_aligned: bool


def read_execution(path: Path, joint_names: Sequence[str]) -> Execution:
    """Read the log of one movement; its content tells whether it is a bag.

    Parameters
    ----------
    path : Path
        A CSV file with the columns ``time_s`` and one a joint, in radians, or with ``_deg`` in
        degrees (with ``_rad`` in radians), comments with ``#`` above them; or a bag with
        ``sensor_msgs/JointState`` (extra ``ros``). Other columns and joints are left alone.
    joint_names : sequence of str, length n
        Of the arm.

    Raises
    ------
    RecordingError
        If it cannot be read, does not have all the joints, has gaps or times that do not rise.
    """
    try:
        with path.open("rb") as file:
            head = file.read(16)
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    if head.startswith((MCAP, ROS_1, SQLITE)):
        return _read_bag(path, joint_names)
    return _read_table(path, joint_names)


def _read_table(path: Path, joint_names: Sequence[str]) -> Execution:
    """Read a CSV file."""
    lines = table_lines(path)[0]
    _, columns, first = table_head(lines, path)
    values = table_values(lines[first:], columns, first, path)
    time = values[:, 0]
    is_date = bool(time[0] >= _DATE_S)
    if is_date:
        time = time - time[0]
    rate_of_times(time, first, path)
    angles = {}
    for name, series in zip(columns[1:], values[:, 1:].T, strict=True):
        stem, factor = name, 1.0
        if name not in joint_names and name[-4:] in ANGLE_UNITS:
            stem, factor = name[:-4], ANGLE_UNITS[name[-4:]]
        if stem in joint_names and stem in angles:
            raise RecordingError(f"{path}: two columns for joint {stem!r}; expected one")
        angles[stem] = factor * series
    positions = _of_arm(angles, joint_names, path)
    beyond = np.flatnonzero(np.abs(positions).max(axis=1) > _GREATEST_RAD)
    if beyond.size:
        raise RecordingError(
            f"{path}:{first + int(beyond[0]) + 1}: got {np.abs(positions[beyond[0]]).max():g}; "
            f"expected joint angles of at most {_GREATEST_RAD:g} rad"
        )
    return Execution(path, time, positions, is_aligned=not is_date)


def _read_bag(path: Path, joint_names: Sequence[str]) -> Execution:
    """Read the joint states of a bag."""
    from besman.io.recordings.ros_bag import read_joint_states
    from besman.io.recordings.ros_tracks import find_grid, sample_values

    tracks = read_joint_states(path)
    _of_arm({name: np.empty(0) for name in tracks}, joint_names, path)
    mine = {name: tracks[name] for name in joint_names}
    for name, track in mine.items():
        back = np.flatnonzero(np.diff(track.stamps) < 0)
        if back.size:
            raise RecordingError(
                f"{path}: joint {name!r}: the time of message {int(back[0]) + 2} is before that of "
                "the one before it; expected times that rise"
            )
    grid = find_grid(mine.values(), str(path))
    positions = np.column_stack([sample_values(track, grid) for track in mine.values()])
    unknown = np.flatnonzero(np.isnan(positions).any(axis=1))
    if unknown.size:
        raise RecordingError(
            f"{path}: no joint states about {grid.time[unknown[0]]:.3f} s after the first; "
            "expected a log without gaps"
        )
    greatest = np.abs(positions).max()
    if greatest > _GREATEST_RAD:
        raise RecordingError(
            f"{path}: got {greatest:g}; expected joint angles of at most {_GREATEST_RAD:g} rad"
        )
    return Execution(path, grid.time, positions, is_aligned=False)


def _of_arm(angles: dict[str, FloatArray], joint_names: Sequence[str], path: Path) -> FloatArray:
    """Return the angles (T, n) of the arm's joints."""
    without = [name for name in joint_names if name not in angles]
    if without:
        got = one_of(list(angles)) if angles else "none"
        raise RecordingError(
            f"{path}: a log of another arm: no joint {', '.join(without)}; got {got:.200}"
        )
    return np.column_stack([angles[name] for name in joint_names])
