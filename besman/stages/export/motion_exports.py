"""The exports of a run: every refined motion as files for the real arm, and what they ask of it."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from besman.exceptions import PlanError, RunError
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
from besman.stages.export.withheld import LIMITS, exported_or_why
from besman.work.work import Work

if TYPE_CHECKING:
    from besman.motion.joint_move import Movement
    from besman.robot.model import Robot

_ENDINGS = (".csv", ".ros.json", ".ros.yaml", ".script")

# Rounding of what is written: twelve digits, nine decimals, or ten in URScript.
_AGREEMENT_RAD = 1e-9
# The way to the start is written at this many samples a second; between them it is the quintic
# that position, velocity and acceleration define, as controllers interpolate.
_APPROACH_HZ = 25
_APPROACH = ".approach"
# In rad/s and rad/s^2.
_STILL = 1e-6
RATE_HZ = 1000
# Writing holds Python's lock; processes begin in the time of so many motions.
_PROCESSES_FROM = 8


def write_exports(
    motions: tuple[RefinedMotion, ...], robot: Robot, folder: Path, work: Work = Work()
) -> None:
    """Write every refined motion as CSV, ROS 2 message and, for UR arms, URScript; read all back.

    To each belongs a move from the arm's home to its first sample, as ``NAME.approach``, from rest
    to rest and gently, in which the arm touches nothing; the URScript begins with it.
    Beside them ``limits.json`` says what each motion, and the way to it, asks of the arm: samples
    beyond a limit, the greatest shares of the limits, the least distance to itself, its pedestal
    and the floor. A motion that is beyond a limit or touches something is not written: its entry
    says ``exported: false`` and why.

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
        content = {"robot": robot.name, "tool": robot.tool.name, "rate_hz": RATE_HZ}
        write_json(temporary / LIMITS, content | {"motions": dict(reports)})


def export_name(motion: str) -> str:
    """Return a motion's name for files: ``FILE_SEGMENT`` of ``FILE.ENDING:SEGMENT``."""
    source, _, segment = motion.rpartition(":")
    return f"{Path(source).stem}_{segment}"


def is_export(path: Path) -> bool:
    """Tell by its name whether a file is one that `write_exports` writes."""
    return path.name == LIMITS or path.name.endswith(_ENDINGS)


def _export(motion: RefinedMotion, robot: Robot, folder: Path) -> tuple[str, dict[str, Any]]:
    """Write one motion, if the arm can take it; return its name and what it asks of the arm."""
    name = export_name(motion.plan.name)
    movement = motion.time, motion.positions, motion.velocities, motion.accelerations
    asked = write_movement(movement, robot, folder, name)
    if not asked["exported"]:
        for part in (name, f"{name}{_APPROACH}"):
            for ending in _ENDINGS:
                (folder / f"{part}{ending}").unlink(missing_ok=True)
    return name, asked | {"success": motion.success}


def write_movement(movement: Movement, robot: Robot, folder: Path, name: str) -> dict[str, Any]:
    """Write a movement, and the move from home to its start, in every format; read all back.

    Parameters
    ----------
    movement : tuple of four arrays
        Time (T,), positions, velocities, accelerations (T, n): s, rad, rad/s, rad/s^2, at 1 kHz.
    robot : Robot
    folder : Path
        Which is there.
    name : str
        Of the files, without their endings.

    Returns
    -------
    dict
        What it asks of the arm, for ``limits.json``.

    Raises
    ------
    RunError
        If a file does not hold the movement.
    """
    way: FloatArray | None = None
    approach: dict[str, Any] = {}
    try:
        approach["approach"] = _write_approach(movement[1][0], robot, folder, name)
        way = np.stack([robot.home, movement[1][0]])
    except PlanError as error:
        approach |= {"approach": None, "no_approach": f"from home: {error}"}
    time, positions, _, _ = movement
    held, written = _write_tables(folder / name, *movement, robot.joint_names)
    if robot.joint_names == UR_JOINTS:
        path = folder / f"{name}.script"
        write_urscript(path, name, time, positions, way)
        held.append((path, read_urscript(path)[1], round(CYCLE_S / (time[1] - time[0]))))
    for path, found, every in held:
        rows = np.minimum(np.arange(len(found)) * every, len(time) - 1)
        if np.max(np.abs(found - positions[rows])) > _AGREEMENT_RAD:
            raise RunError(f"{path}: does not hold the motion that was to be written")
    return _report(robot, written) | approach


def _write_approach(start: FloatArray, robot: Robot, folder: Path, name: str) -> dict[str, Any]:
    """Write the move from home to a movement's start; return what it asks of the arm."""
    from besman.motion.joint_move import move_straight
    from besman.robot.limits import check_limits

    time, *movement = move_straight(robot, robot.home, start)
    every = round(RATE_HZ / _APPROACH_HZ)
    rows = np.unique(np.append(np.arange(0, len(time), every), len(time) - 1))
    positions, velocities, accelerations = (part[rows] for part in movement)
    place = folder / f"{name}{_APPROACH}"
    _write_tables(place, time[rows], positions, velocities, accelerations, robot.joint_names)
    return {"duration_s": float(time[-1])} | asdict(check_limits(robot, *movement))


def _write_tables(
    place: Path,
    time: FloatArray,
    positions: FloatArray,
    velocities: FloatArray,
    accelerations: FloatArray,
    names: tuple[str, ...],
) -> tuple[list[tuple[Path, FloatArray, int]], Movement]:
    """Write a movement as CSV and ROS messages; return what the files hold, the table in full."""
    trajectory = time, positions, velocities, accelerations, names
    table = place.with_name(f"{place.name}.csv")
    write_joint_csv(table, *trajectory)
    written = read_joint_csv(table)
    held = [(table, written[1], 1)]
    message = ros_joint_trajectory(*trajectory)
    for ending in ("json", "yaml"):
        path = place.with_name(f"{place.name}.ros.{ending}")
        write_ros_joint_trajectory(path, message)
        held.append((path, read_ros_joint_trajectory(path)[1], 1))
    return held, written


def _report(robot: Robot, written: Movement) -> dict[str, Any]:
    """Say what a written motion asks of the arm, and whether it begins and ends at rest."""
    from besman.robot.limits import check_limits

    time, *movement = written
    _, velocities, accelerations = movement
    still = all(
        np.allclose(part[[0, -1]], 0.0, rtol=0.0, atol=_STILL)
        for part in (velocities, accelerations)
    )
    report = check_limits(robot, *movement)
    asked = {"duration_s": float(time[-1])} | asdict(report) | {"rests_at_ends": still}
    return asked | exported_or_why(report)
