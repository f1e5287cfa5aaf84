"""Experiment: demonstrations moved into the workspaces of several arms, and what that costs.

References
----------
L. Gutzeit: From human movement recordings to robot behavior, thesis, section 7.2.3.
H. Sakoe, S. Chiba: Dynamic programming algorithm optimization for spoken word recognition, 1978.
doi:10.1109/TASSP.1978.1163055
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.config.yaml_file import load_config
from besman.evaluation.mapping_data import DATASET, DemonstrationSet
from besman.exceptions import BesmanError, ConfigError
from besman.records import Failure, JointTrajectory
from besman.robot.config import RobotConfig
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits, resample_trajectory
from besman.robot.model import Robot, find_robot, load_robot
from besman.robot.tool_shelf import tools_of
from besman.stages.map.mapping import Mapping
from besman.stages.map.stage import MapConfig
from besman.work.outcome import Notes
from besman.work.work import Work

FloatArray = npt.NDArray[np.float64]

ROBOTS = ("ur5", "ur10", "iiwa7", "compi")
"""The robots of thesis 7.2.3."""

THESIS = {"n_demonstrations": 697, "n_transferred_to_all": 682}
"""Of the stick throws, in thesis 7.2.3; without the errors that it took."""

_USUAL = MapConfig()
# A stretch within rounding of 1 is none.
_UNSCALED = 1.0 + 1e-6


@dataclass(frozen=True, eq=False)
class Transferred:
    """Demonstrations of one class on one arm.

    Attributes
    ----------
    data : DemonstrationSet
    robot : Robot
    trajectories : tuple of JointTrajectory
        Of those that were transferred.
    """

    data: DemonstrationSet
    robot: Robot
    trajectories: tuple[JointTrajectory, ...]


@dataclass(frozen=True)
class TransferMeasures:
    """What one transferred demonstration costs.

    Attributes
    ----------
    limit_violations, self_collisions : int
        Samples of the trajectory at 1 kHz.
    dtw_m : float
        Average DTW distance between the path that the hand asks for and the tool's, metres.
    """

    limit_violations: int
    self_collisions: int
    dtw_m: float


def evaluate_mapping(
    sets: Sequence[DemonstrationSet],
    robots: Sequence[str] = ROBOTS,
    *,
    config: MapConfig = _USUAL,
    work: Work = Work(),
) -> tuple[dict[str, Any], list[Transferred]]:
    """Map demonstrations of several classes to several arms.

    Parameters
    ----------
    sets : sequence of DemonstrationSet
        One of each class.
    robots : sequence of str
        Names, or paths of robot.yaml files.
    config : MapConfig
        How to map; whether the tool may spin is the class's own.
    work : Work
        Threads, processes and progress.

    Returns
    -------
    result : dict
        ``experiment``, ``wall_s``, ``jobs`` and ``rows``, one for each class and robot: dataset,
        source, method, label, robot, tool, n_demonstrations, n_transferred, n_corrected (with a
        placement of their own), scale, failed (names and reasons), n_transferred_to_all and
        transferred_to_all (share that every robot can do), position_error_m and
        orientation_error_deg (mean, p95 and max over samples), time_stretch (median, p95 and
        max), unscaled_share, limit_violations and self_collisions (samples at 1 kHz), dtw_m
        (mean, p95, max), seconds_per_demonstration,
        cpu_seconds_per_demonstration, peak_rss_mb, thesis.
    mapped : list of Transferred
        What was transferred, in the order of the rows.

    Raises
    ------
    ConfigError
        If a robot is named twice.
    RobotError
        If a robot cannot be loaded.
    """
    from threadpoolctl import threadpool_limits

    arms = [[_load(name, one.tool) for name in robots] for one in sets]
    names = [arm.name for arm in arms[0]] if arms else []
    if len(set(names)) < len(names):
        raise ConfigError(f"--robot: got one robot twice: {', '.join(names)}")
    started = time.perf_counter()
    n_steps = sum(len(own) for own in arms)
    rows: list[dict[str, Any]] = []
    mapped: list[Transferred] = []
    with threadpool_limits(limits=1, user_api="blas"):
        for one, own in zip(sets, arms, strict=True):
            first = len(rows)
            for robot in own:
                done = len(rows)
                part = work.part(done / n_steps, (done + 1) / n_steps)
                row, trajectories = _map_set(one, robot, config, part)
                rows.append(row)
                mapped.append(Transferred(one, robot, trajectories))
            _add_shares(rows[first:], one)
            work.progress(len(rows) / n_steps)
    wall_s = time.perf_counter() - started
    return {"experiment": "mapping", "wall_s": wall_s, "jobs": work.jobs, "rows": rows}, mapped


def _load(name: str, tool: str) -> Robot:
    """Load a robot with a tool, or with its own where it has no such tool."""
    tools = tools_of(load_config(find_robot(name), RobotConfig))
    return load_robot(name, tool if tool in tools else None)


def _map_set(
    one: DemonstrationSet, robot: Robot, config: MapConfig, work: Work
) -> tuple[dict[str, Any], tuple[JointTrajectory, ...]]:
    """Map one class to one arm and measure what came of it."""
    stage = config.model_copy(update={"free_axis_spin": one.free_spin})
    notes = Notes()
    wall, cpu = time.perf_counter(), time.process_time()
    mapping, failed = _try_mapping(stage, one, robot, work, notes)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu + notes.cpu_s
    trajectories = () if mapping is None else mapping.trajectories
    measured = Work(jobs=work.jobs).map(partial(measure, robot=robot), trajectories)
    own_peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    row = {
        "dataset": one.dataset,
        "source": one.source,
        "method": stage.method,
        "label": one.label,
        "robot": robot.name,
        "tool": robot.tool.name,
        "n_demonstrations": one.n,
        "n_transferred": len(trajectories),
        "n_corrected": 0 if mapping is None else len(mapping.corrected),
        "scale": None if mapping is None else mapping.scale,
        "failed": [asdict(failure) for failure in (*one.failed, *failed)],
        **transfer_figures(trajectories, measured),
        "seconds_per_demonstration": wall / max(len(one.demonstrations), 1),
        "cpu_seconds_per_demonstration": cpu / max(len(one.demonstrations), 1),
        "peak_rss_mb": max([own_peak_mb, *notes.workers.values()]),
    }
    return row, trajectories


def _try_mapping(
    stage: MapConfig, one: DemonstrationSet, robot: Robot, work: Work, notes: Notes
) -> tuple[Mapping | None, tuple[Failure, ...]]:
    """Map one class to one arm; where nothing can be transferred, that is each one's reason."""
    if not one.demonstrations:
        return None, ()
    try:
        part = Work(work.jobs, work.progress, notes, work.workers)
        mapping: Mapping = stage.run(one.demonstrations, robot, part)
    except BesmanError as error:
        return None, tuple(Failure(hand.name, str(error)) for hand in one.demonstrations)
    return mapping, mapping.failed


def measure(trajectory: JointTrajectory, robot: Robot) -> TransferMeasures:
    """Check a trajectory at 1 kHz, and compare the tool's path with that of the hand.

    Parameters
    ----------
    trajectory : JointTrajectory
    robot : Robot
    """
    _, *dense = resample_trajectory(
        trajectory.time, trajectory.positions, trajectory.velocities, trajectory.accelerations
    )
    report = check_limits(robot, *dense)
    reached = forward_kinematics(robot.chain, trajectory.positions)[:, :3, 3]
    distance = average_dtw(trajectory.poses[:, :3], reached)
    return TransferMeasures(report.violations, report.self_collisions, distance)


def average_dtw(first: FloatArray, second: FloatArray) -> float:
    """Return the average DTW distance: sum of distances over the longer path's samples.

    Parameters
    ----------
    first, second : array, shape (T, 3) and (R, 3)
        Metres.

    Returns
    -------
    float
        Metres.

    References
    ----------
    Thesis 7.2.3; Sakoe and Chiba, 1978, doi:10.1109/TASSP.1978.1163055
    """
    from scipy.spatial.distance import cdist

    apart = cdist(first, second)
    n_first, n_second = apart.shape
    least = np.full((n_first + 1, n_second + 1), np.inf)
    least[0, 0] = 0.0
    # All pairs of samples whose numbers add up to the same depend only on earlier ones.
    for both in range(n_first + n_second - 1):
        i = np.arange(max(0, both - n_second + 1), min(n_first, both + 1))
        j = both - i
        before = np.minimum(np.minimum(least[i, j], least[i, j + 1]), least[i + 1, j])
        least[i + 1, j + 1] = apart[i, j] + before
    return float(least[-1, -1] / max(n_first, n_second))


def transfer_figures(
    trajectories: Sequence[JointTrajectory], measured: Sequence[TransferMeasures]
) -> dict[str, Any]:
    """Return the figures of transferred demonstrations, None where there are none.

    Parameters
    ----------
    trajectories : sequence of JointTrajectory
    measured : sequence of TransferMeasures
        Of each of them.
    """
    if not trajectories:
        names = ("position_error_m", "orientation_error_deg", "time_stretch", "unscaled_share")
        return {**dict.fromkeys((*names, "dtw_m")), "limit_violations": 0, "self_collisions": 0}
    stretch = np.array([one.time_stretch for one in trajectories])
    paths = [one.dtw_m for one in measured]
    position = np.concatenate([one.position_error for one in trajectories])
    orientation = np.concatenate([one.orientation_error for one in trajectories])
    return {
        "position_error_m": _spread(position, np.mean),
        "orientation_error_deg": _spread(np.degrees(orientation), np.mean),
        "time_stretch": _spread(stretch, np.median),
        "unscaled_share": float(np.mean(stretch <= _UNSCALED)),
        "dtw_m": _spread(np.array(paths), np.mean),
        "limit_violations": sum(one.limit_violations for one in measured),
        "self_collisions": sum(one.self_collisions for one in measured),
    }


def _spread(values: FloatArray, middle: Callable[[FloatArray], Any]) -> dict[str, float]:
    """Return mean or median, 95th percentile and maximum."""
    return {
        middle.__name__: float(middle(values)),
        "p95": float(np.percentile(values, 95)),
        "max": float(values.max()),
    }


def _add_shares(rows: list[dict[str, Any]], one: DemonstrationSet) -> None:
    """Add how many demonstrations every robot can do, and what the thesis has to say to it."""
    failed = {failure["name"] for row in rows for failure in row["failed"]}
    n_all = one.n - len(failed)
    is_thesis = one.dataset == DATASET and one.source == "synthetic"
    for row in rows:
        row["n_transferred_to_all"] = n_all
        row["transferred_to_all"] = n_all / one.n
        row["thesis"] = THESIS if is_thesis else None
