"""Which log is of which motion, and whether it can be."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from besman.exceptions import RecordingError, TransferError, nearest
from besman.io.executions import ENDINGS, Execution, read_execution
from besman.records import FloatArray, RefinedMotion
from besman.robot.model import Robot
from besman.stages.export.motion_exports import export_name
from besman.transfer.identification.fit import ArmLog, AskedMovement, find_start

# A log of the motion begins this near to its start, and no joint is farther off than that, however
# late it is.
_AT_START_RAD, _ON_THE_WAY_RAD = 0.1, 0.5
_LATEST_S, _STEP_S = 0.6, 0.01
# No arm is where it was told to be as exactly as that.
_NO_ARM_RAD = 1e-5
# A log begins no later than this, and shows this share of the motion.
_FIRST_S, _ENOUGH = 0.05, 0.8
# No log begins earlier before the motion, where it says when that was sent off.
_LONG_BEFORE_S = 600.0


def find_executions(paths: Sequence[Path]) -> tuple[Path, ...]:
    """Return the logs among files and in folders, in the order of their names.

    Raises
    ------
    TransferError
        If there is none, or a path is not there.
    """
    found: list[Path] = []
    for path in paths:
        if not path.exists():
            raise TransferError(f"{path}: no such file or folder")
        inside = sorted(one for one in path.glob("*") if one.suffix.lower() in ENDINGS)
        if path.is_dir() and not inside:
            raise TransferError(f"{path}: no logs here; expected files {', '.join(ENDINGS)}")
        found += inside if path.is_dir() else [path]
    return tuple(found)


def read_logs(
    paths: Sequence[Path],
    motions: Sequence[RefinedMotion],
    robot: Robot,
    motion: str | None = None,
    fit_start: bool = False,
) -> tuple[ArmLog, ...]:
    """Read the logs of motions' executions, each held against the motion that it is of.

    Parameters
    ----------
    paths : sequence of Path
        Called like the motions' exports, ``NAME.csv`` or ``NAME`` with something after it.
    motions : sequence of RefinedMotion
    robot : Robot
        The arm.
    motion : str, optional
        Name of the motion that all of them are of, whatever they are called.
    fit_start : bool
        Whether their times count from somewhere else than the moment at which the motion was sent
        off.

    Raises
    ------
    RecordingError, TransferError
        If one cannot be read, belongs to no motion, or is not of the motion that it is called by.
    """
    if motion is not None and motion not in [one.plan.name for one in motions]:
        names = [one.plan.name for one in motions]
        raise TransferError(f"--motion: got {motion!r}; {nearest(motion, names)}")
    logs = []
    for path in paths:
        at = _motion_of(path, motions, motion)
        execution = read_execution(path, robot.joint_names)
        is_aligned = execution.is_aligned and not fit_start
        log = ArmLog(at, execution.time, execution.positions, is_aligned)
        _refuse_other(log, execution, motions[at], robot)
        logs.append(log)
    return tuple(logs)


def _motion_of(path: Path, motions: Sequence[RefinedMotion], motion: str | None) -> int:
    """Return which motion a log is of, by its name."""
    if motion is not None:
        return [one.plan.name for one in motions].index(motion)
    names = [export_name(one.plan.name) for one in motions]
    fitting = [
        at
        for at, name in enumerate(names)
        if path.stem.startswith(name) and not path.stem[len(name) : len(name) + 1].isalnum()
    ]
    if not fitting:
        raise TransferError(
            f"{path}: called like no motion of the run; {nearest(path.stem, names)}; --motion says "
            "which motion logs are of that are called otherwise"
        )
    return max(fitting, key=lambda at: len(names[at]))


def as_movement(motion: RefinedMotion) -> AskedMovement:
    """Return what a refined motion asks of the arm."""
    return AskedMovement(motion.time, motion.positions, motion.velocities, motion.accelerations)


def _refuse_other(log: ArmLog, execution: Execution, motion: RefinedMotion, robot: Robot) -> None:
    """Refuse a log that cannot be of a motion."""
    path, asked, name = execution.source, as_movement(motion), motion.plan.name
    lasts, time = float(asked.time[-1]), log.time
    if log.is_aligned and not -_LONG_BEFORE_S <= time[0] <= _FIRST_S:
        raise RecordingError(
            f"{path}: begins at {time[0]:g} s; expected 0 where motion {name} was sent off; "
            "--fit-start if times count from elsewhere"
        )
    start = 0.0 if log.is_aligned else find_start(log, asked)
    if time[-1] - start < _ENOUGH * lasts:
        raise RecordingError(
            f"{path}: ends {max(time[-1] - start, 0.0):.2f} s after motion {name} was sent off, "
            f"which lasts {lasts:.2f} s; expected a log of all of it"
        )
    inside = (time >= start) & (time <= start + lasts)
    found, time = log.positions[inside], time[inside] - start
    if not len(time):
        raise RecordingError(f"{path}: no sample while motion {name} goes on")
    _refuse_asked(path, np.abs(_asked_at(asked, time) - found).max(), name)
    beside = np.abs(found[0] - asked.positions[0])
    if beside.max() > _AT_START_RAD:
        joint = int(beside.argmax())
        raise _other(path, name, robot.joint_names[joint], beside[joint], 0.0, _AT_START_RAD)
    lates = np.arange(0.0, _LATEST_S, _STEP_S)
    for joint, (wanted, got) in enumerate(zip(asked.positions.T, found.T, strict=True)):
        apart = np.abs(np.interp(time - lates[:, None], asked.time, wanted) - got)
        least = apart[apart.max(axis=1).argmin()]
        if least.max() > _ON_THE_WAY_RAD:
            at = int(least.argmax())
            raise _other(path, name, robot.joint_names[joint], least[at], time[at], _ON_THE_WAY_RAD)


def _asked_at(asked: AskedMovement, time: FloatArray) -> FloatArray:
    """Return what is asked at some times (T,), shape (T, n), rad."""
    return np.column_stack([np.interp(time, asked.time, one) for one in asked.positions.T])


def _refuse_asked(path: Path, farthest: float, name: str) -> None:
    """Refuse set-points in place of what came of them: an arm without any fault would be found."""
    if farthest <= _NO_ARM_RAD:
        raise RecordingError(
            f"{path}: is what was asked of the arm in motion {name}, to {_NO_ARM_RAD:g} rad at "
            "every sample; expected the angles that the arm measured"
        )


def _other(
    path: Path, name: str, joint: str, far: float, time: float, allowed: float
) -> RecordingError:
    return RecordingError(
        f"{path}: is not of motion {name}, or the run was computed anew since: joint {joint} is "
        f"{far:.2f} rad beside it at {time:.2f} s; expected at most {allowed:g}"
    )
