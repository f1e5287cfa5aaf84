"""Where a hand goes in the world of an arm: as in a run, or by the first seconds of a stream."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from besman.exceptions import RunError
from besman.following.plans import FollowPlan, learn_names_of
from besman.following.stream_names import LearnNames
from besman.geometry.frames import rotation_to_quaternion
from besman.pipeline.config import learn_from
from besman.pipeline.finished_run import read_recipe
from besman.pipeline.stored_run import open_run
from besman.records import FloatArray, HandTrajectory
from besman.records.layers import Side
from besman.robot.inverse_kinematics import IkWeights, solve_path
from besman.robot.model import Robot, load_robot
from besman.stages.label.model_from_pose import model_from_pose
from besman.stages.map.demonstration import MappingSettings, tcp_in_hand, tool_poses
from besman.stages.map.map_demonstrations import arm_paths
from besman.stages.map.mapping import Mapping
from besman.stages.map.placement import find_placement

# The first seconds are looked at as pieces of one second; the search is a short one, since the
# person waits.
_PIECE_S, _EVALUATIONS = 1.0, 80
_MOST_STARTS = 12
_PATH_HZ = 20.0


@dataclass(frozen=True, eq=False)
class HandPlacement:
    """From the hand in the person's frame to the tool centre point in the arm's world.

    Attributes
    ----------
    back2world : array, shape (3, 3)
    shift : array, shape (3,)
        Metres.
    scale : float
        Movements are made smaller or larger by it.
    tcp2hand : array, shape (4, 4)
        Metres.
    starts : array, shape (K, n)
        Configurations of the branches that served what the placement was learnt from, rad.
    ik : IkWeights
        What counts where the arm cannot have all.
    free_spin : bool
        The rotation about the tool's axis does not matter.
    """

    back2world: FloatArray
    shift: FloatArray
    scale: float
    tcp2hand: FloatArray
    starts: FloatArray
    ik: IkWeights
    free_spin: bool

    def apply(self, hand2back: FloatArray) -> FloatArray:
        """Return what a hand's pose (4, 4) asks of the tool centre point, (4, 4), metres."""
        pose = hand2back @ self.tcp2hand
        placed = np.eye(4)
        placed[:3, :3] = self.back2world @ pose[:3, :3]
        placed[:3, 3] = self.place_points(pose[:3, 3])
        return placed

    def place_points(self, points: FloatArray) -> FloatArray:
        """Return points (..., 3) of the person's frame in the arm's world, metres."""
        placed: FloatArray = self.scale * (points @ self.back2world.T) + self.shift
        return placed


@dataclass(frozen=True, eq=False)
class MirrorPlan:
    """What is known before a stream begins.

    Attributes
    ----------
    robot : Robot
    markers : str
        Marker set.
    side : "right" or "left"
        The person's arm.
    placement : HandPlacement, optional
        Without it, it is learnt from the first seconds.
    learn_names : callable
        Returns what the markers look like, where they come without a name.
    """

    robot: Robot
    markers: str
    side: Side = "right"
    placement: HandPlacement | None = None
    learn_names: LearnNames = model_from_pose


def mirror_as_in_run(run: Path, markers: str | None = None) -> MirrorPlan:
    """Take robot, marker set and placement from a run.

    Raises
    ------
    RunError, ConfigError, RobotError
        If the folder is no run, or the run has mapped nothing.
    """
    config, stored = read_recipe(run), open_run(run, needs_state=False)
    missing = [name for name in ("map", "select") if name not in stored.stages]
    if missing:
        raise RunError(
            f"{run}: no {missing[0]} here: expected a run that is finished, of recordings; or "
            "--robot NAME in place of --run"
        )
    robot = load_robot(config.robot, config.tool)
    mapping, demonstrations = stored.record("map"), stored.record("select")
    by_name = {one.name: one for one in demonstrations}
    corrected = {one.name for one in mapping.corrected}
    pairs = [
        (one, by_name[one.name])
        for one in mapping.trajectories
        if one.name in by_name and one.name not in corrected
    ]
    if not pairs:
        raise RunError(
            f"{run}: none of its demonstrations has the common placement; expected another run, "
            "or --robot NAME in place of --run"
        )
    trajectory, demonstration = pairs[0]
    turn = mapping.placement[:3, :3]
    # Movements are made smaller about a point that no record has: what became of one tells it.
    scaled = mapping.scale * tool_poses(demonstration, robot)[:, :3, 3] @ turn.T
    settings = config.map.settings
    placement = HandPlacement(
        back2world=turn,
        shift=np.median(trajectory.poses[:, :3] - scaled, axis=0),
        scale=mapping.scale,
        tcp2hand=tcp_in_hand(demonstration.grasp, robot),
        starts=_starts_of(mapping),
        ik=settings.ik,
        free_spin=settings.free_spin,
    )
    return MirrorPlan(
        robot,
        markers or config.label.markers,
        config.select.arm,
        placement,
        learn_names_of(FollowPlan((), config.label, learn_from(config))),
    )


def _starts_of(mapping: Mapping) -> FloatArray:
    """Return where some trajectories begin and end."""
    rows = np.unique(
        np.linspace(0, len(mapping.trajectories) - 1, _MOST_STARTS // 2).round().astype(int)
    )
    chosen = [mapping.trajectories[row].positions for row in rows]
    return np.array([path[at] for path in chosen for at in (0, -1)])


def learn_placement(robot: Robot, time: FloatArray, hand2back: FloatArray) -> HandPlacement:
    """Find a placement by what a hand did for some seconds.

    Parameters
    ----------
    robot : Robot
    time : array, shape (T,)
        Seconds, rising.
    hand2back : array, shape (T, 4, 4)
        Metres.

    Returns
    -------
    HandPlacement
        That of `besman.stages.map.placement.find_placement` for pieces of one second.
    """
    settings = MappingSettings(evaluations=_EVALUATIONS)
    poses = np.hstack([hand2back[:, :3, 3], rotation_to_quaternion(hand2back[:, :3, :3])])
    n_pieces = max(1, int((time[-1] - time[0]) / _PIECE_S))
    pieces = [
        HandTrajectory(
            time[rows] - time[rows[0]], poses[rows], f"piece {k}", "", np.full(3, np.nan)
        )
        for k, rows in enumerate(np.array_split(np.arange(len(time)), n_pieces))
    ]
    placement = find_placement([arm_paths(robot, pieces)], settings.search)
    shift = placement.pose[:3, 3] + placement.pose[:3, :3] @ placement.centre * (
        1.0 - placement.scale
    )
    found = HandPlacement(
        back2world=placement.pose[:3, :3],
        shift=shift,
        scale=placement.scale,
        tcp2hand=tcp_in_hand(np.full(7, np.nan), robot),
        starts=np.empty((0, robot.n)),
        ik=settings.ik,
        free_spin=settings.free_spin,
    )
    every = max(1, round(1.0 / (_PATH_HZ * float(np.median(np.diff(time))))))
    path = np.array([found.apply(pose) for pose in hand2back[::every]])
    solved = solve_path(
        robot, path, weights=found.ik, step_s=every * float(np.median(np.diff(time)))
    )
    rows = np.unique(np.linspace(0, len(path) - 1, _MOST_STARTS).round().astype(int))
    return HandPlacement(**{**vars(found), "starts": solved.positions[rows]})
