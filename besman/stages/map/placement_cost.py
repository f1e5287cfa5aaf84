"""What a placement costs: the terms of all demonstrations, each on the arm's best branch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from besman.robot.inverse_kinematics import IkWeights, draw_starts, find_branches, follow_all
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.stages.map.surroundings import AROUND_WEIGHT, Around, thin_among
from besman.stages.map.terms import (
    HEIGHT_SCALE_M,
    SCALE_SCALE,
    TermWeights,
    cheapest_terms,
    heaviness,
    is_weak,
)

if TYPE_CHECKING:
    from besman.simulation.tasks.rearrange.shown_scene import ShownScene

FloatArray = npt.NDArray[np.float64]

_POSES = 12
# A whole task is as long as several movements, and touches what is passed on the way.
POSES_AMONG = 24
"""How many poses of a demonstration are looked at among things."""

_GREATEST_BRANCHES = 8
_SEARCHED_BRANCHES = 3
_SAMPLE = 4
# What a first look at a placement takes of one demonstration: so many of its poses.
_GLANCE_POSES = 4
# Enough to compare placements.
_ROUNDS, _TOLERANCE = 15, 1e-3


def pose_of(parameters: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the placement that brings `centre` to (x, y, z) and turns about it by yaw, (4, 4)."""
    x, y, z, yaw = parameters[:4]
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:3, 3] = np.array([x, y, z]) - pose[:3, :3] @ centre
    return pose


def scale_about(poses: FloatArray, centre: FloatArray, scale: float) -> FloatArray:
    """Make a movement (..., 4, 4) smaller or larger about a point (3,); nothing is turned."""
    if scale == 1.0:
        return poses
    scaled: FloatArray = poses.copy()
    scaled[..., :3, 3] = centre + scale * (poses[..., :3, 3] - centre)
    return scaled


def thin_out(
    demonstrations: Sequence[tuple[FloatArray, FloatArray]], n_poses: int = _POSES
) -> tuple[FloatArray, FloatArray]:
    """Keep so many poses of every demonstration: (D, P, 4, 4) and seconds between them (D,)."""
    paths = [poses[thin_rows(len(time), n_poses)] for time, poses in demonstrations]
    steps_s = [float(time[-1] - time[0]) / (n_poses - 1) for time, _ in demonstrations]
    return np.array(paths), np.array(steps_s)


def thin_rows(n_samples: int, n_poses: int = _POSES) -> npt.NDArray[np.int64]:
    """Return which samples of a demonstration are kept, shape (P,)."""
    return np.rint(np.linspace(0, n_samples - 1, n_poses)).astype(np.int64)


@dataclass(frozen=True, eq=False)
class Cost:
    """The weighted sum of terms over all arms as a function of x, y, z, yaw and scale."""

    arms: tuple[ArmCost, ...]

    def terms(self, parameters: FloatArray) -> FloatArray:
        """Return the mean of every term over arms and demonstrations, as of `ArmCost.terms`."""
        found: FloatArray = np.mean(
            [arm.terms(parameters)[0].mean(axis=0) for arm in self.arms], axis=0
        )
        return found

    def __call__(self, parameters: FloatArray) -> float:
        """Return the mean cost over arms and demonstrations."""
        return float(np.mean([arm(parameters) for arm in self.arms]))


@dataclass(frozen=True, eq=False)
class ArmCost:
    """The same for one arm, among what stands around it, if that is known."""

    robot: Robot
    paths: FloatArray
    steps_s: FloatArray
    centre: FloatArray
    weights: TermWeights
    ik_weights: IkWeights
    free_spin: bool
    starts: FloatArray
    back_height: float | None
    around: Around | None = None
    weak: bool = False

    @property
    def weight_array(self) -> FloatArray:
        """Weights of all terms, shape (8,), or (9,) among things."""
        weights = self.weights.as_array()
        return weights if self.around is None else np.append(weights, AROUND_WEIGHT)

    def sample(self) -> ArmCost:
        """Return the cost of some of the demonstrations, evenly spaced in their order."""
        number = min(_SAMPLE, len(self.paths))
        chosen = np.rint(np.linspace(0, len(self.paths) - 1, number)).astype(int)
        around = None if self.around is None else self.around.take(chosen)
        return replace(self, paths=self.paths[chosen], steps_s=self.steps_s[chosen], around=around)

    def glance(self) -> ArmCost:
        """Return the cost of a few poses of the demonstration in the middle of their order."""
        middle = len(self.paths) // 2
        n_poses = self.paths.shape[1]
        rows = np.rint(np.linspace(0, n_poses - 1, _GLANCE_POSES)).astype(int)
        wider = (n_poses - 1) / (_GLANCE_POSES - 1)
        one = slice(middle, middle + 1)
        around = None if self.around is None else self.around.take(one)
        if around is not None:
            around = replace(around, own=around.own[:, rows])
        return replace(
            self,
            paths=self.paths[one, rows],
            steps_s=self.steps_s[one] * wider,
            around=around,
        )

    def keep_branches(self, places: list[FloatArray]) -> ArmCost:
        """Return the cost over the branches that are best most often at some places."""
        sample = self.sample()
        used = np.concatenate([sample.terms(place)[1] for place in places])
        branches, counts = np.unique(used, return_counts=True)
        most = np.argsort(-counts, kind="stable")[:_SEARCHED_BRANCHES]
        return replace(self, starts=self.starts[np.sort(branches[most])])

    def terms(self, parameters: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Return terms (D, 8) and cheapest branch (D,) of every demonstration.

        Among things terms are (D, 9): the last is that of `Around.cost`.
        """
        placement = pose_of(parameters, self.centre)
        paths = self.paths if self.around is None else self.around.paths
        targets = placement @ scale_about(paths, self.centre, float(parameters[4]))
        positions, errors = follow_all(
            self.robot, targets, self.starts, targets.shape[1] // 2, self.ik_weights,
            self.free_spin, rounds=_ROUNDS, tolerance=_TOLERANCE,
        )  # fmt: skip
        beside = None
        if self.around is not None:
            own = self.around.own
            beside = self.around.cost(self.robot, positions, errors, placement)
            positions, errors = (
                np.take_along_axis(part, own[:, None, :, None], axis=2)
                for part in (positions, errors)
            )
            targets = np.take_along_axis(targets, own[:, :, None, None], axis=1)
        slow = heaviness(self.robot, positions) if self.weak else np.zeros(positions.shape[:2])
        besides = 0.0 if beside is None else AROUND_WEIGHT * beside
        terms, branches = cheapest_terms(
            self.robot, positions, errors, targets, self.steps_s, self.weights.as_array()[:6],
            self.weights.speed * slow + besides,
        )  # fmt: skip
        terms[:, 4] += slow[np.arange(len(terms)), branches]
        height = placement[2, 3] if self.back_height is None else self.back_height
        off = np.full((len(terms), 1), abs(placement[2, 3] - height) / HEIGHT_SCALE_M)
        shrunk = np.full_like(off, abs(np.log(parameters[4])) / SCALE_SCALE)
        more = () if beside is None else (beside[np.arange(len(terms)), branches][:, None],)
        return np.concatenate([terms, off, shrunk, *more], axis=1), branches

    def __call__(self, parameters: FloatArray) -> float:
        """Return the mean cost over the demonstrations."""
        return float(np.mean(self.terms(parameters)[0] @ self.weight_array))


@dataclass(frozen=True, eq=False)
class ArmPaths:
    """What one arm is to do.

    Attributes
    ----------
    robot : Robot
        The arm with its tool.
    paths : sequence of (time, poses)
        Seconds, shape (T,), and poses of the tool centre point in the back frame, shape (T, 4, 4).
    scenes : sequence of ShownScene
        What stands around each; none where nothing is known to.
    n_poses : int
        How many of each are looked at among that.
    """

    robot: Robot
    paths: Sequence[tuple[FloatArray, FloatArray]]
    scenes: Sequence[ShownScene] = ()
    n_poses: int = POSES_AMONG

    def cost(
        self,
        centre: FloatArray,
        weights: TermWeights,
        ik: IkWeights,
        free_spin: bool,
        seed: int,
        back_height: float | None,
    ) -> ArmCost:
        """Return what placements cost; see `besman.stages.map.placement.PlacementSearch`.

        Parameters
        ----------
        centre : array, shape (3,)
            About which movements are turned and scaled, metres in the back frame.
        weights, ik, free_spin, seed
            Of the search.
        back_height : float or None
            As of `besman.stages.map.placement.find_placement`.
        """
        around = None
        if self.scenes:
            paths, steps_s = thin_out(self.paths, self.n_poses)
            rows = [thin_rows(len(time), self.n_poses) for time, _ in self.paths]
            around = thin_among(self.paths, rows, self.scenes)
        else:
            paths, steps_s = thin_out(self.paths)
        starts = find_starts(self.robot, paths, ik, free_spin, seed)
        return ArmCost(
            self.robot, paths, steps_s, centre, weights, ik, free_spin, starts, back_height, around,
            is_weak(self.robot),
        )  # fmt: skip


def find_starts(
    robot: Robot, paths: FloatArray, ik: IkWeights, free_spin: bool, seed: int
) -> FloatArray:
    """Find the branches to try: those of the typical pose, put where home has its tool."""
    middle = paths[:, paths.shape[1] // 2].mean(axis=0)
    left, _, right = np.linalg.svd(middle[:3, :3])
    pose = np.eye(4)
    pose[:3, :3] = left @ right
    pose[:3, 3] = forward_kinematics(robot.chain, robot.home)[:3, 3]
    starts = draw_starts(robot, seed)
    return find_branches(robot, pose, starts, ik, free_spin)[:_GREATEST_BRANCHES]
