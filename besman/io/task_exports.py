"""Whole tasks for the real arm: gripper commands, goals block by block, and URScript with both."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from besman.exceptions import RecordingError
from besman.io.atomic_files import write_text, written_aside
from besman.io.csv_cells import quote_text
from besman.io.urscript import CYCLE_S
from besman.records import FloatArray

DIGITAL_OUTPUT = 0
"""The standard digital output that closes the gripper in URScript."""


def write_gripper_csv(path: Path, events_s: FloatArray, events: Sequence[str]) -> None:
    """Write gripper commands as CSV: time_s from the start of the task, and command.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    with (
        written_aside(path) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file)
        writer.writerow(["time_s", "command"])
        for at, event in zip(events_s, events, strict=True):
            writer.writerow([f"{at:.9g}", quote_text(event)])


def read_gripper_csv(path: Path) -> tuple[FloatArray, tuple[str, ...]]:
    """Read what `write_gripper_csv` wrote.

    Raises
    ------
    RecordingError
        If the file is no such table.
    """
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    if not rows or rows[0] != ["time_s", "command"] or any(len(row) != 2 for row in rows):
        raise RecordingError(f"{path}: expected the columns time_s and command")
    return np.array([float(at) for at, _ in rows[1:]]), tuple(event for _, event in rows[1:])


def ros_task(
    blocks: Sequence[tuple[str, float, dict[str, Any]]],
    events_s: FloatArray,
    events: Sequence[str],
    opening_m: float,
) -> dict[str, Any]:
    """Return a task as goals of ROS 2 actions, in the order of time, as plain data.

    Parameters
    ----------
    blocks : sequence of (str, float, dict)
        Label, start (s) and ``trajectory_msgs/JointTrajectory`` of each block.
    events_s, events
        Gripper commands on the same clock.
    opening_m : float
        Between the fingers of an open gripper.

    Returns
    -------
    dict
        ``steps``: each has ``start_s`` and either ``block`` with the goal of
        ``control_msgs/action/FollowJointTrajectory``, or ``gripper`` with that of
        ``control_msgs/action/GripperCommand``.
    """
    steps = [
        {"start_s": start, "block": label, "goal": {"trajectory": message}}
        for label, start, message in blocks
    ]
    for at, event in zip(events_s, events, strict=True):
        position = 0.0 if event == "close" else opening_m
        steps.append(
            {"start_s": float(at), "gripper": event, "goal": {"command": {"position": position}}}
        )
    return {"steps": sorted(steps, key=lambda step: float(step["start_s"]))}


def write_ros_task(path: Path, task: dict[str, Any]) -> None:
    """Write the goals of `ros_task` as JSON, or as YAML if the path ends in .yaml.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    if path.suffix == ".yaml":
        # libyaml writes the same bytes in a third of the time, where PyYAML was built with it.
        dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
        text = yaml.dump(task, Dumper=dumper, sort_keys=False, default_flow_style=None, width=10**6)
    else:
        text = json.dumps(task) + "\n"
    write_text(path, text, durable=False)


def with_gripper(script: str, events_s: FloatArray, events: Sequence[str]) -> str:
    """Return a URScript program that also sets the gripper's digital output on time.

    Parameters
    ----------
    script : str
        Of `besman.io.urscript.write_urscript`: one ``servoj`` a cycle.
    events_s, events
        Gripper commands, seconds from the program's first set-point.
    """
    due = sorted(zip(events_s.tolist(), events, strict=True))
    lines, cycle = [], 0
    for line in script.splitlines():
        if line.lstrip().startswith("servoj("):
            while due and due[0][0] <= cycle * CYCLE_S + 1e-9:
                lines.append(_set_output(due.pop(0)[1]))
            cycle += 1
        elif line.lstrip().startswith("stopj("):
            lines += [_set_output(event) for _, event in due]
            due = []
        lines.append(line)
    return "\n".join(lines) + "\n"


def _set_output(event: str) -> str:
    return f"  set_standard_digital_out({DIGITAL_OUTPUT}, {event == 'close'})  # {event}"
