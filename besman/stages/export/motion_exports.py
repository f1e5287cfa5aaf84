"""The exports of a run: every refined motion as files for the real arm, and what they ask of it."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from besman.exceptions import RunError
from besman.io.atomic_files import folder_aside, write_json
from besman.io.exports import (
    read_joint_csv,
    read_ros_joint_trajectory,
    ros_joint_trajectory,
    write_joint_csv,
    write_ros_joint_trajectory,
)
from besman.io.urscript import CYCLE_S, UR_JOINTS, read_urscript, write_urscript
from besman.records import FloatArray, RefinedMotion
from besman.work.work import Work

if TYPE_CHECKING:
    from besman.robot.model import Robot

_LIMITS = "limits.json"
_ENDINGS = (".csv", ".ros.json", ".ros.yaml", ".script")

# Rounding of what is written: twelve digits, nine decimals, or six in URScript.
_AGREEMENT_RAD = 1e-6
# Writing holds Python's lock; processes are started in the time of so many motions.
_PROCESSES_FROM = 40


def write_exports(
    motions: tuple[RefinedMotion, ...], robot: Robot, folder: Path, work: Work = Work()
) -> None:
    """Write every refined motion as CSV, ROS 2 message and, for UR arms, URScript; read all back.

    Beside them ``limits.json`` says what each motion asks of the arm: samples beyond a limit, the
    greatest shares of the limits, the least distance to itself, its pedestal and the floor.

    The folder then holds these motions and no others; what is no export stays in it.

    Parameters
    ----------
    motions : tuple of RefinedMotion
    robot : Robot
        With the tool that the motions were refined with.
    folder : Path
        Made if need be; the folder above is there.
    work : Work
        Threads, processes and progress.

    Raises
    ------
    RunError
        If a file that was written does not hold the motion, or two motions have one name.
    FileError
        If a file cannot be written.
    """
    names = Counter(export_name(motion.plan.name) for motion in motions)
    for name in (name for name, n in names.items() if n > 1):
        twice = [one.plan.name for one in motions if export_name(one.plan.name) == name]
        raise RunError(f"{folder}: {' and '.join(twice)} would both be written as {name}")
    with folder_aside(folder, keep=lambda name: not is_export(Path(name))) as temporary:
        export = partial(_export, robot=robot, folder=temporary)
        reports = work.map(
            export,
            motions,
            name=lambda motion: motion.plan.name,
            processes=_PROCESSES_FROM,
            local=True,
        )
        content = {"robot": robot.name, "tool": robot.tool.name, "rate_hz": 1000}
        write_json(temporary / _LIMITS, content | {"motions": dict(reports)})


def export_name(motion: str) -> str:
    """Return a motion's name for files: ``FILE_SEGMENT`` of ``FILE.ENDING:SEGMENT``."""
    source, _, segment = motion.rpartition(":")
    return f"{Path(source).stem}_{segment}"


def is_export(path: Path) -> bool:
    """Tell by its name whether a file is one that `write_exports` writes."""
    return path.name == _LIMITS or path.name.endswith(_ENDINGS)


def _export(motion: RefinedMotion, robot: Robot, folder: Path) -> tuple[str, dict[str, Any]]:
    """Write one motion and read it back; return its name and what it asks of the arm."""
    name = export_name(motion.plan.name)
    for path, held, every in _write_motion(motion, folder, name):
        rows = np.minimum(np.arange(len(held)) * every, len(motion.time) - 1)
        if np.max(np.abs(held - motion.positions[rows])) > _AGREEMENT_RAD:
            raise RunError(f"{path}: does not hold the motion that was to be written")
    return name, _report(robot, folder / f"{name}.csv") | {"success": motion.success}


def _write_motion(
    motion: RefinedMotion, folder: Path, name: str
) -> list[tuple[Path, FloatArray, int]]:
    """Write one motion in every format; return what positions the files hold, every how many."""
    names = motion.plan.joint_names
    trajectory = motion.time, motion.positions, motion.velocities, motion.accelerations, names
    table = folder / f"{name}.csv"
    write_joint_csv(table, *trajectory)
    held = [(table, read_joint_csv(table)[1], 1)]
    message = ros_joint_trajectory(*trajectory)
    for ending in ("json", "yaml"):
        path = folder / f"{name}.ros.{ending}"
        write_ros_joint_trajectory(path, message)
        held.append((path, read_ros_joint_trajectory(path)[1], 1))
    if names == UR_JOINTS:
        path = folder / f"{name}.script"
        write_urscript(path, name, motion.time, motion.positions)
        _, positions = read_urscript(path)
        held.append((path, positions, round(CYCLE_S / (motion.time[1] - motion.time[0]))))
    return held


def _report(robot: Robot, table: Path) -> dict[str, Any]:
    """Say what a written motion asks of the arm."""
    from besman.robot.limits import check_limits

    time, *movement = read_joint_csv(table)
    return {"duration_s": float(time[-1])} | asdict(check_limits(robot, *movement))
