"""Joint trajectories for the real arm: CSV and ROS 2 ``JointTrajectory`` as JSON and YAML."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import RecordingError, in_one_line
from besman.foreign.json_text import parse_json
from besman.foreign.names import fault_of_name
from besman.foreign.numbers import has_odd_digits
from besman.io.atomic_files import write_text, written_aside
from besman.io.csv_cells import quote_text
from besman.records import FloatArray

# Nothing of an arm is larger, in rad and s.
_GREATEST = 1e6
# A movement at its limit, as 2 pi rad, must not be beyond it by rounding; 1e-9 is, see
# `besman.robot.limits.check_limits`.
_DIGITS = 12


def write_joint_csv(
    path: Path,
    time: FloatArray,
    positions: FloatArray,
    velocities: FloatArray,
    accelerations: FloatArray,
    joint_names: tuple[str, ...],
) -> None:
    """Write a joint trajectory as CSV with one row a sample.

    Parameters
    ----------
    path : Path
        File to write.
    time : array, shape (T,)
        Seconds.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.
    joint_names : tuple of str, length n
        Columns are ``NAME_rad``, ``NAME_rad_per_s`` and ``NAME_rad_per_s2``.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    header = ["time_s"]
    for unit in ("rad", "rad_per_s", "rad_per_s2"):
        header += [quote_text(f"{name}_{unit}") for name in joint_names]
    table = np.column_stack([time, positions, velocities, accelerations])
    with (
        written_aside(path) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        csv.writer(file).writerow(header)
        np.savetxt(file, table, fmt=f"%.{_DIGITS}g", delimiter=",")


def read_joint_csv(path: Path) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Read what `write_joint_csv` wrote: time, positions, velocities, accelerations.

    Raises
    ------
    RecordingError
        If the file cannot be read, or the columns are not those of `write_joint_csv`.
    """
    try:
        text = path.read_text(encoding="utf-8")
        if has_odd_digits(text.partition("\n")[2]):
            raise ValueError("digits that are none")
        table = np.loadtxt(io.StringIO(text), delimiter=",", skiprows=1, ndmin=2)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise RecordingError(f"{path}: expected a table of numbers: {in_one_line(error)}") from None
    _check_numbers(path, table)
    if not len(table) or not np.all(np.diff(table[:, 0]) > 0):
        raise RecordingError(f"{path}: expected rows with times that rise strictly")
    n_joints, rest = divmod(table.shape[1] - 1, 3)
    if rest:
        raise RecordingError(
            f"{path}: expected a time column and three columns a joint, got {table.shape[1]}"
        )
    return (
        table[:, 0],
        table[:, 1 : 1 + n_joints],
        table[:, 1 + n_joints : 1 + 2 * n_joints],
        table[:, 1 + 2 * n_joints :],
    )


def ros_joint_trajectory(
    time: FloatArray,
    positions: FloatArray,
    velocities: FloatArray,
    accelerations: FloatArray,
    joint_names: tuple[str, ...],
) -> dict[str, Any]:
    """Return a ``trajectory_msgs/JointTrajectory`` message as plain data.

    The arguments are those of `write_joint_csv`; ``time_from_start`` counts from the first sample.
    """
    nanoseconds = np.round((time - time[0]) * 1e9).astype(np.int64)
    points = [
        {
            "positions": q.tolist(),
            "velocities": dq.tolist(),
            "accelerations": ddq.tolist(),
            "effort": [],
            "time_from_start": {"sec": int(at // 10**9), "nanosec": int(at % 10**9)},
        }
        for at, q, dq, ddq in zip(nanoseconds, positions, velocities, accelerations, strict=True)
    ]
    stamp = {"sec": 0, "nanosec": 0}
    return {
        "header": {"stamp": stamp, "frame_id": ""},
        "joint_names": list(joint_names),
        "points": points,
    }


def write_ros_joint_trajectory(path: Path, message: dict[str, Any]) -> None:
    """Write a message of `ros_joint_trajectory` as JSON, or as YAML if the path ends in .yaml.

    The YAML has one line a point and nine decimals, so that people can read it and
    ``ros2 topic pub`` too.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    if path.suffix != ".yaml":
        write_text(path, json.dumps(message) + "\n", durable=False)
        return
    head = {key: value for key, value in message.items() if key != "points"}
    lines = [f"{key}: {json.dumps(value)}" for key, value in head.items()]
    lines += ["points:", *_flow(message["points"])]
    write_text(path, "\n".join(lines) + "\n", durable=False)


def _flow(points: list[dict[str, Any]]) -> list[str]:
    """Write points as flow mappings; never with an exponent, which YAML 1.1 takes for text."""
    if not points:
        return []
    # One template for all: they have the same joints.
    parts = [f'"{key}": {_form_of(value)}' for key, value in points[0].items()]
    template = "- {" + ", ".join(parts) + "}"
    return [template % tuple(_values(point)) for point in points]


def _form_of(value: list[float] | dict[str, int]) -> str:
    """Return the form of a list of numbers, or of named whole numbers."""
    if isinstance(value, list):
        return f"[{', '.join(['%.9f'] * len(value))}]"
    return "{" + ", ".join(f'"{key}": %d' for key in value) + "}"


def _values(point: dict[str, Any]) -> Iterator[float]:
    """Yield a point's numbers."""
    for value in point.values():
        yield from value if isinstance(value, list) else value.values()


def read_ros_joint_trajectory(
    path: Path,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, tuple[str, ...]]:
    """Read what `write_ros_joint_trajectory` wrote, as JSON or YAML.

    Returns
    -------
    time, positions, velocities, accelerations, joint_names
        As in `write_joint_csv`; time counts from the start.

    Raises
    ------
    RecordingError
        If the file is no such message, or its times do not rise.
    """
    try:
        text = path.read_text(encoding="utf-8")
        message = _from_yaml(text) if path.suffix == ".yaml" else parse_json(text)
        points = message["points"]
        stamps = [point["time_from_start"] for point in points]
        time = np.array([stamp["sec"] + 1e-9 * stamp["nanosec"] for stamp in stamps], float)
        keys = ("positions", "velocities", "accelerations")
        columns = [np.array([point[key] for point in points], float) for key in keys]
        names = tuple(map(str, message["joint_names"]))
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{path}: expected a JointTrajectory, got {error!r}") from None
    _check_numbers(path, time, *columns)
    for name in names:
        fault = fault_of_name(name)
        if fault is not None:
            raise RecordingError(f"{path}: joint_names: {name!r:.60} {fault}")
    shape = (len(time), len(names))
    if any(column.shape != shape for column in columns):
        raise RecordingError(f"{path}: expected {shape[1]} numbers a point for every joint")
    if not np.all(np.diff(time) > 0):
        raise RecordingError(f"{path}: expected time_from_start to rise strictly")
    return time, columns[0], columns[1], columns[2], names


def _check_numbers(path: Path, *columns: FloatArray) -> None:
    """Refuse numbers that no arm has: NaN, and what is beyond any angle and its derivatives."""
    if any(not np.all(np.abs(column) <= _GREATEST) for column in columns):
        raise RecordingError(f"{path}: expected finite numbers within {_GREATEST:g}")


def _from_yaml(text: str) -> dict[str, Any]:
    """Read the layout of `write_ros_joint_trajectory`, far faster than a reader of all YAML."""
    head, _, points = text.partition("points:\n")
    message = {}
    for line in head.splitlines():
        key, _, value = line.partition(": ")
        message[key] = parse_json(value)
    lines = [line.removeprefix("- ") for line in points.splitlines()]
    message["points"] = parse_json(f"[{','.join(lines)}]")
    return message
