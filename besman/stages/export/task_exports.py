"""The exports of whole tasks: all of each as one movement, its blocks, and the gripper."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from besman.exceptions import RunError
from besman.io.atomic_files import folder_aside, write_json, write_text
from besman.io.exports import (
    read_joint_csv,
    ros_joint_trajectory,
    write_joint_csv,
    write_ros_joint_trajectory,
)
from besman.io.task_exports import ros_task, with_gripper, write_gripper_csv, write_ros_task
from besman.io.urscript import UR_JOINTS, write_urscript
from besman.motion.task_rollout import sample_task
from besman.records import FloatArray, TaskPlan
from besman.robot.limits import check_limits
from besman.robot.model import Robot
from besman.stages.export.motion_exports import export_name, is_export
from besman.stages.export.withheld import LIMITS, exported_or_why, withheld_because
from besman.work.work import Work

_AGREEMENT_RAD = 1e-6
# Goals of ROS 2 controllers need no more: they interpolate by quintics.
_GOAL_EVERY = 10


def write_task_exports(
    plans: tuple[TaskPlan, ...], robot: Robot, folder: Path, work: Work = Work()
) -> None:
    """Write every task for the real arm.

    Of each: ``NAME.csv``, ``NAME.ros.json`` and ``.ros.yaml`` with all of it at 1 kHz;
    ``NAME.K.LABEL.csv`` of each block, on the clock of the task; ``NAME.gripper.csv``;
    ``NAME.task.ros.json`` and ``.task.ros.yaml`` with a goal of ``FollowJointTrajectory`` a block,
    at 100 Hz, and the gripper's commands between them; for UR arms ``NAME.script``. ``limits.json``
    says what each asks of the arm; one that is beyond a limit or touches something is not written,
    and its entry says ``exported: false`` and why.

    Parameters
    ----------
    plans : tuple of TaskPlan
    robot : Robot
    folder : Path
        Made if need be; the folder above is there.
    work : Work

    Raises
    ------
    RunError
        If a file that was written does not hold the movement.
    FileError
        If a file cannot be written.
    """
    with folder_aside(folder, keep=lambda name: not is_export(Path(name))) as temporary:
        reports = {}
        for done, plan in enumerate(plans, 1):
            name = export_name(plan.name)
            moved = sample_task(plan)
            report = check_limits(robot, *moved[1:])
            if withheld_because(report) is None:
                _write_whole(plan, moved, temporary, name)
                _write_blocks(plan, moved, temporary, name)
                report = check_limits(robot, *read_joint_csv(temporary / f"{name}.csv")[1:])
            reports[name] = {"duration_s": float(moved[0][-1])} | asdict(report)
            reports[name] |= exported_or_why(report)
            work.progress(done / len(plans))
        content = {"robot": robot.name, "tool": robot.tool.name, "rate_hz": 1000}
        write_json(temporary / LIMITS, content | {"motions": reports})


Movement = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def _write_whole(plan: TaskPlan, moved: Movement, folder: Path, name: str) -> None:
    """Write all of a task as one movement, and the gripper's commands."""
    table = folder / f"{name}.csv"
    write_joint_csv(table, *moved, plan.joint_names)
    if np.max(np.abs(read_joint_csv(table)[1] - moved[1])) > _AGREEMENT_RAD:
        raise RunError(f"{table}: does not hold the task that was to be written")
    message = ros_joint_trajectory(*moved, plan.joint_names)
    for ending in ("json", "yaml"):
        write_ros_joint_trajectory(folder / f"{name}.ros.{ending}", message)
    write_gripper_csv(folder / f"{name}.gripper.csv", plan.events_s, plan.events)
    if plan.joint_names == UR_JOINTS:
        path = folder / f"{name}.script"
        write_urscript(path, name, moved[0], moved[1])
        text = with_gripper(path.read_text(encoding="utf-8"), plan.events_s, plan.events)
        write_text(path, text, durable=False)


def _write_blocks(plan: TaskPlan, moved: Movement, folder: Path, name: str) -> None:
    """Write each block of a task, and all of them as goals."""
    time = moved[0]
    rows = np.clip(np.round(plan.starts_s * 1000.0).astype(int), 0, len(time) - 1)
    rows[-1] = len(time) - 1
    goals = []
    for k, (block, start, end) in enumerate(zip(plan.blocks, rows, rows[1:], strict=False), 1):
        own = slice(start, end + 1)
        q, v, acc = (part[own] for part in moved[1:])
        path = folder / f"{name}.{k}.{_file_part(block.label)}.csv"
        write_joint_csv(path, time[own], q, v, acc, plan.joint_names)
        kept = np.unique(np.append(np.arange(0, end - start, _GOAL_EVERY), end - start))
        message = ros_joint_trajectory(
            time[own][kept], q[kept], v[kept], acc[kept], plan.joint_names
        )
        goals.append((block.label, float(time[start]), message))
    task = ros_task(goals, plan.events_s, plan.events, plan.opening_m)
    for ending in ("json", "yaml"):
        write_ros_task(folder / f"{name}.task.ros.{ending}", task)


def _file_part(label: str) -> str:
    """Return a label as part of a file's name."""
    return "".join(one if one.isalnum() or one in "_-" else "_" for one in label)
