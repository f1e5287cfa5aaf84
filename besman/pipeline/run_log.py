"""A finished run as a log that other tools open, or as a dataset to learn from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from besman.exceptions import RunError
from besman.io.log_content import Log, LoggedEvent, LoggedMarkers, LoggedMovement
from besman.pipeline.finished_run import read_recipe
from besman.pipeline.stored_run import StoredRun, open_run
from besman.records import FloatArray, LabelledRecording, LabelledSegments, RefinedMotion

if TYPE_CHECKING:
    from besman.robot.model import Robot

EXPORT_FORMATS = ("mcap", "bag", "lerobot")
STATES_HZ = 100
"""Joint states, transforms and datasets have so many samples a second, trajectories all of them."""

# A log begins here, as a time of 0 says "the latest" to tf; recordings are so far apart.
_BEGIN_S = 1.0
_PAUSE_S = 1.0
_MOTIONS_HZ = 1000


def export_run(run: Path, kind: str, out: Path | None = None) -> tuple[Path, str]:
    """Write a run for other tools.

    Parameters
    ----------
    run : Path
        A finished run with refined motions.
    kind : str
        One of `EXPORT_FORMATS`.
    out : Path, optional
        File of ``mcap``, which is replaced; folder of the others, which must not be there. Beside
        the run, under its name, if not given.

    Returns
    -------
    path : Path
    summary : str
        What was written, in a few words.

    Raises
    ------
    RunError
        If the folder is no finished run.
    FileError
        If a library is not installed, or it cannot be written.
    """
    endings = {"mcap": ".mcap", "bag": "_bag", "lerobot": "_lerobot"}
    if kind not in endings:
        raise RunError(f"--to: got {kind!r:.60}; expected one of {', '.join(EXPORT_FORMATS)}")
    place = run.parent / f"{run.resolve().name}{endings[kind]}" if out is None else out
    return place, _WRITERS[kind](_finished(run), place)


def read_log(stored: StoredRun) -> Log:
    """Read all of a run that moves, on one clock.

    Recordings come one after the other. A motion begins when the movement of the person did that
    it is made of, or when the motion before it has ended.

    Parameters
    ----------
    stored : StoredRun
        A finished run.
    """
    recordings = stored.record("label") if "label" in stored.stages else ()
    segments = stored.record("recognize") if "recognize" in stored.stages else ()
    starts = _starts(recordings)
    events = [
        LoggedEvent(at + float(bounds[0]) / found.rate_hz, label, "block", found.source, index)
        for at, found in zip(starts, segments, strict=False)
        for index, (bounds, label) in enumerate(zip(found.bounds, found.labels, strict=True))
    ]
    arms = _arms(stored)
    movements: dict[str, Sequence[LoggedMovement]] = {}
    for prefix, (robot, motions) in arms.items():
        begins = _begins(motions, segments, starts)
        movements[prefix] = [
            _movement(robot, motion, at) for motion, at in zip(motions, begins, strict=True)
        ]
        events += [
            LoggedEvent(at, motion.plan.label, "motion", motion.plan.name, index)
            for index, (motion, at) in enumerate(zip(motions, begins, strict=True))
        ]
    markers = [
        LoggedMarkers(at + one.time - one.time[0], one.positions, one.markers)
        for at, one in zip(starts, recordings, strict=True)
    ]
    return Log(markers, movements, tuple(sorted(events, key=lambda one: one.time_s)))


def _finished(run: Path) -> StoredRun:
    """Open a run; refuse one that has not ended well, or refined nothing."""
    stored = open_run(run)
    if stored.status != "done":
        raise RunError(
            f"{run}: is {stored.status}; expected a finished run: the command that made it "
            "goes on with it"
        )
    if "refine" not in stored.stages:
        raise RunError(f"{run}: no refined motions here; expected a run with a stage refine")
    return stored


def _arms(stored: StoredRun) -> dict[str, tuple[Robot, tuple[RefinedMotion, ...]]]:
    """Return robot and motions of every arm, by the prefix of its topics."""
    from besman.robot.model import load_robot

    config = read_recipe(stored.folder)
    arms = {"": (load_robot(config.robot, config.tool), stored.record("refine"))}
    if config.second_arm is not None and "refine_second" in stored.stages:
        second = load_robot(config.second_arm.robot, config.second_arm.tool)
        return {"first": arms[""], "second": (second, stored.record("refine_second"))}
    return arms


def _starts(recordings: Sequence[LabelledRecording]) -> list[float]:
    """Return when each recording begins."""
    starts, at = [], _BEGIN_S
    for one in recordings:
        starts.append(at)
        at += len(one.time) / one.rate_hz + _PAUSE_S
    return starts


def _begins(
    motions: Sequence[RefinedMotion],
    segments: Sequence[LabelledSegments],
    starts: Sequence[float],
) -> list[float]:
    """Return when each motion begins, in their order."""
    at, begins = _BEGIN_S, []
    for motion in motions:
        source, _, number = motion.plan.name.rpartition(":")
        for found, start in zip(segments, starts, strict=False):
            index = int(number) if number.isdecimal() else len(found.labels)
            if found.source == source and found.labels[index : index + 1] == (motion.plan.label,):
                at = max(at, start + float(found.bounds[index, 0]) / found.rate_hz)
                break
        begins.append(at)
        at += float(motion.time[-1] - motion.time[0]) + 1 / STATES_HZ
    return begins


def _state_rows(motion: RefinedMotion) -> Any:
    return np.arange(0, len(motion.time), round(_MOTIONS_HZ / STATES_HZ))


def _movement(robot: Robot, motion: RefinedMotion, start_s: float) -> LoggedMovement:
    """Add to a motion where the links are in it."""
    rows = _state_rows(motion)
    frames, poses = _poses_of_links(robot, motion.positions[rows])
    trajectory = motion.time, motion.positions, motion.velocities, motion.accelerations
    return LoggedMovement(start_s, trajectory, robot.joint_names, rows, frames, poses)


def _poses_of_links(robot: Robot, positions: FloatArray) -> tuple[tuple[str, ...], FloatArray]:
    """Return links and the tool centre point; position and quaternion (x, y, z, w) of each."""
    # Loaded with the robot.
    import pinocchio

    model, data = robot.model, robot.model.createData()
    chosen = {
        frame.name: index
        for index, frame in enumerate(model.frames)
        if frame.type == pinocchio.FrameType.BODY or index == robot.tip_frame
    }
    chosen.pop("world", None)
    poses = np.empty((len(positions), len(chosen), 7))
    for row, joints in enumerate(positions):
        pinocchio.framesForwardKinematics(model, data, np.ascontiguousarray(joints))
        for column, index in enumerate(chosen.values()):
            poses[row, column] = pinocchio.SE3ToXYZQUAT(data.oMf[index])
    return tuple(chosen), poses


def _write_mcap(stored: StoredRun, place: Path) -> str:
    from besman.io.atomic_files import check_file
    from besman.io.ros_logs import write_mcap

    check_file(place)
    log = read_log(stored)
    write_mcap(log, place)
    return _in_words(log)


def _write_bag(stored: StoredRun, place: Path) -> str:
    from besman.io.ros_logs import write_rosbag2

    _check_new_folder(place)
    log = read_log(stored)
    write_rosbag2(log, place)
    return _in_words(log)


def _write_lerobot(stored: StoredRun, place: Path) -> str:
    from besman.io.lerobot_dataset import Episode, write_lerobot

    _check_new_folder(place)
    arms = _arms(stored)
    if len(arms) > 1:
        raise RunError(f"{stored.folder}: two arms; expected one, as a dataset is of one robot")
    robot, motions = arms[""]
    episodes = []
    for motion in motions:
        states = motion.positions[_state_rows(motion)]
        # What is commanded next; at the end to stay.
        actions = np.concatenate([states[1:], motion.positions[-1:]])
        episodes.append(Episode(states, actions, motion.plan.label))
    write_lerobot(place, episodes, robot.joint_names, robot.name, STATES_HZ)
    frames = sum(len(one.states) for one in episodes)
    some = f"{len(episodes)} episode{'s' if len(episodes) != 1 else ''}"
    return f"{some}, {frames} frames at {STATES_HZ} Hz"


def _check_new_folder(place: Path) -> None:
    """Refuse before the work a folder that is there, or cannot be made."""
    from besman.exceptions import FileError
    from besman.io.atomic_files import check_folder

    if place.exists():
        raise FileError(f"{place}: is there already; expected a folder that is not")
    check_folder(place)


def _in_words(log: Log) -> str:
    motions = sum(len(one) for one in log.movements.values())
    return f"{len(log.markers)} recordings, {motions} motions, {len(log.events)} events"


_WRITERS: dict[str, Callable[[StoredRun, Path], str]] = {
    "mcap": _write_mcap,
    "bag": _write_bag,
    "lerobot": _write_lerobot,
}
