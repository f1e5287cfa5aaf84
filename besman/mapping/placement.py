"""One placement of all demonstrations of a class in the workspace of an arm."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from besman.robot.collision import distances
from besman.robot.inverse_kinematics import IkWeights, draw_starts, find_branches, follow_all
from besman.robot.kinematics import forward_kinematics, manipulability
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

# What makes a term 1.
POSITION_SCALE_M = 0.01
ORIENTATION_SCALE_RAD = np.radians(10.0)
SAFE_DISTANCE_M = 0.03
HEIGHT_SCALE_M = 0.1
_SINGULAR_SHARE = 0.3  # of the manipulability at home
_POSES = 12
_GREATEST_BRANCHES = 8
_SEARCHED_BRANCHES = 3
_GRID_DEMONSTRATIONS = 4
# A unit of the search: metres along x, y, z and radians of yaw.
_UNITS = np.array([0.1, 0.1, 0.1, 0.3])
# Shares of the arm's length: in front of the base, to its left, above its shoulder.
_GRID_FORWARD = (-0.3, 0.0, 0.3, 0.55)
_GRID_LEFT = (-0.7, -0.35, 0.0, 0.35, 0.7)
_GRID_UP = (0.0, 0.25, 0.5, 0.75)


@dataclass(frozen=True)
class TermWeights:
    """Weights of the cost of a placement; every term is averaged over demonstrations.

    Attributes
    ----------
    position : float
        Root mean square position error, per centimetre.
    orientation : float
        Root mean square orientation error, per 10 degrees.
    singularity : float
        Mean squared shortfall of manipulability below 0.3 of that at home.
    collision : float
        Mean shortfall of the distance to itself, pedestal and floor below 3 cm.
    speed : float
        By how much the movement must be stretched to keep velocity and acceleration limits.
    workspace : float
        Share of the demonstrated path length that the arm does not use.
    height : float
        Distance from the height at which the movement was demonstrated, per 10 cm; a throw from
        another height lands elsewhere. Only where that height is known.
    """

    position: float = 1.0
    orientation: float = 0.3
    singularity: float = 1.0
    collision: float = 3.0
    speed: float = 3.0
    workspace: float = 1.0
    height: float = 0.3

    def as_array(self) -> FloatArray:
        """Return the weights in the order of the fields, shape (7,)."""
        return np.array([getattr(self, field.name) for field in fields(self)])


@dataclass(frozen=True, eq=False)
class Placement:
    """Where the demonstrations go.

    Attributes
    ----------
    pose : array, shape (4, 4)
        Back frame to the robot's world frame: translation and yaw, metres.
    terms : dict of float
        Mean of every term over the demonstrations, unweighted.
    cost : float
        Their weighted sum.
    evaluations : int
        Placements tried after the coarse grid.
    """

    pose: FloatArray
    terms: dict[str, float]
    cost: float
    evaluations: int


def find_placement(
    robot: Robot,
    demonstrations: list[tuple[FloatArray, FloatArray]],
    *,
    weights: TermWeights,
    ik_weights: IkWeights,
    free_spin: bool,
    evaluations: int,
    seed: int,
    back_height: float | None = None,
    jobs: int = 1,
    progress: Callable[[float], None] = lambda done: None,
) -> Placement:
    """Choose where in the robot's world the demonstrations are, by CMA-ES over x, y, z and yaw.

    Parameters
    ----------
    robot : Robot
    demonstrations : list of (time, poses)
        Seconds, shape (T,), and poses of the tool centre point in the back frame, shape (T, 4, 4).
    weights : TermWeights
        What a good placement is.
    ik_weights, free_spin
        As in `solve_path`.
    evaluations : int
        Placements to try after a coarse grid.
    seed : int
        Of the search and of the configurations it starts from.
    back_height : float, optional
        Height of the back frame's origin above the floor in the demonstrations, metres.
    jobs : int
        Threads; does not change the result.
    progress : callable
        Called with the share done.

    Returns
    -------
    Placement
    """
    import cma

    paths, steps_s = _thin_out(demonstrations)
    centre = paths[:, :, :3, 3].mean(axis=(0, 1))
    starts = _find_starts(robot, paths, ik_weights, free_spin, seed)
    cost = _Cost(robot, paths, steps_s, centre, weights, ik_weights, free_spin, starts, back_height)
    with ThreadPoolExecutor(max_workers=jobs) as threads:
        start, cost = _search_grid(robot, cost, threads)
        # The library takes 0 for "draw a seed".
        options = {"seed": seed + 1, "verbose": -9, "maxfevals": evaluations}
        search = cma.CMAEvolutionStrategy(start / _UNITS, 0.7, options)
        while not search.stop():
            candidates = search.ask()
            search.tell(candidates, list(threads.map(cost, [x * _UNITS for x in candidates])))
            progress(min(1.0, search.result.evaluations / evaluations))
    best = search.result.xbest * _UNITS
    terms = cost.terms(best)[0].mean(axis=0)
    names = [field.name for field in fields(TermWeights)]
    return Placement(
        pose=pose_of(best, centre),
        terms=dict(zip(names, terms.tolist(), strict=True)),
        cost=float(terms @ weights.as_array()),
        evaluations=int(search.result.evaluations),
    )


def pose_of(parameters: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the placement that brings `centre` to (x, y, z) and turns about it by yaw, (4, 4)."""
    x, y, z, yaw = parameters
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:3, 3] = np.array([x, y, z]) - pose[:3, :3] @ centre
    return pose


def _thin_out(
    demonstrations: list[tuple[FloatArray, FloatArray]],
) -> tuple[FloatArray, FloatArray]:
    """Keep twelve poses of every demonstration: (D, P, 4, 4) and seconds between them (D,)."""
    paths, steps_s = [], []
    for time, poses in demonstrations:
        rows = np.rint(np.linspace(0, len(time) - 1, _POSES)).astype(int)
        paths.append(poses[rows])
        steps_s.append(float(time[-1] - time[0]) / (_POSES - 1))
    return np.array(paths), np.array(steps_s)


def _reach(robot: Robot) -> float:
    """Length of the arm from its second joint on, metres."""
    links = np.linalg.norm(robot.chain.placements[2:, :3, 3], axis=1).sum()
    return float(links + np.linalg.norm(robot.chain.tip[:3, 3]))


def _search_grid(
    robot: Robot, cost: _Cost, threads: ThreadPoolExecutor
) -> tuple[FloatArray, _Cost]:
    """Find a good start on a coarse grid, and the few branches of the arm that matter there."""
    reach = _reach(robot)
    height = robot.chain.placements[0, 2, 3]
    grid = [
        np.array([forward * reach, left * reach, height + up * reach, 0.0])
        for forward in _GRID_FORWARD
        for left in _GRID_LEFT
        for up in _GRID_UP
    ]
    sample = cost.sample(_GRID_DEMONSTRATIONS)
    order = np.argsort(list(threads.map(sample, grid)), kind="stable")
    used = np.concatenate([sample.terms(grid[index])[1] for index in order[:3]])
    branches, counts = np.unique(used, return_counts=True)
    most = np.argsort(-counts, kind="stable")[:_SEARCHED_BRANCHES]
    return grid[order[0]], replace(cost, starts=cost.starts[np.sort(branches[most])])


def path_terms(
    robot: Robot,
    positions: FloatArray,
    errors: FloatArray,
    targets: FloatArray,
    step_s: FloatArray,
) -> FloatArray:
    """Compute the cost terms of paths in joint space.

    Parameters
    ----------
    robot : Robot
    positions : array, shape (..., P, n)
        rad.
    errors : array, shape (..., P, 2)
        Position (m) and orientation (rad).
    targets : array, shape (..., P, 4, 4)
        Poses asked for, metres.
    step_s : array, shape (..., 1, 1)
        Seconds between poses.

    Returns
    -------
    array, shape (..., 6)
        In the order of `TermWeights`, without height.
    """
    limits = robot.limits
    rms = np.sqrt(np.mean(errors**2, axis=-2)) / (POSITION_SCALE_M, ORIENTATION_SCALE_RAD)
    usable = _SINGULAR_SHARE * max(float(manipulability(robot.chain, robot.home)), 1e-6)
    singular = np.maximum(0.0, 1.0 - manipulability(robot.chain, positions) / usable) ** 2
    nearest = distances(robot.chain, positions).min(axis=-1)
    near = np.maximum(0.0, 1.0 - nearest / SAFE_DISTANCE_M)
    steps = np.diff(positions, axis=-2) / step_s
    speed = np.max(np.abs(steps) / limits.velocity, axis=(-2, -1))
    pull = np.max(np.abs(np.diff(steps, axis=-2)) / step_s / limits.acceleration, axis=(-2, -1))
    tips = forward_kinematics(robot.chain, positions)[..., :3, 3]
    used, asked = _length(tips), _length(targets[..., :3, 3])
    return np.stack(
        [
            rms[..., 0],
            rms[..., 1],
            np.mean(singular, axis=-1),
            np.mean(near, axis=-1),
            np.maximum(0.0, np.maximum(speed, np.sqrt(pull)) - 1.0),
            np.maximum(0.0, 1.0 - used / np.maximum(asked, 1e-9)),
        ],
        axis=-1,
    )


def _length(points: FloatArray) -> FloatArray:
    """Return the lengths of polylines (..., P, 3), metres."""
    lengths: FloatArray = np.linalg.norm(np.diff(points, axis=-2), axis=-1).sum(axis=-1)
    return lengths


@dataclass(frozen=True, eq=False)
class _Cost:
    """The weighted sum of terms as a function of (x, y, z, yaw) of the demonstrations' centre."""

    robot: Robot
    paths: FloatArray
    steps_s: FloatArray
    centre: FloatArray
    weights: TermWeights
    ik_weights: IkWeights
    free_spin: bool
    starts: FloatArray
    back_height: float | None

    def sample(self, number: int) -> _Cost:
        """Return the cost of some of the demonstrations, evenly spaced in their order."""
        number = min(number, len(self.paths))
        chosen = np.rint(np.linspace(0, len(self.paths) - 1, number)).astype(int)
        return replace(self, paths=self.paths[chosen], steps_s=self.steps_s[chosen])

    def terms(self, parameters: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Return terms (D, 7) and cheapest branch (D,) of every demonstration."""
        placement = pose_of(parameters, self.centre)
        targets = placement @ self.paths
        positions, errors = follow_all(
            self.robot, targets, self.starts, _POSES // 2, self.ik_weights, self.free_spin,
            rounds=25, tolerance=1e-5,
        )  # fmt: skip
        terms = path_terms(
            self.robot, positions, errors, targets[:, None], self.steps_s[:, None, None, None]
        )
        height = placement[2, 3] if self.back_height is None else self.back_height
        off = np.full((*terms.shape[:-1], 1), abs(placement[2, 3] - height) / HEIGHT_SCALE_M)
        terms = np.concatenate([terms, off], axis=-1)
        branches = np.argmin(terms @ self.weights.as_array(), axis=1)
        return terms[np.arange(len(branches)), branches], branches

    def __call__(self, parameters: FloatArray) -> float:
        """Return the mean cost over the demonstrations."""
        return float(np.mean(self.terms(parameters)[0] @ self.weights.as_array()))


def _find_starts(
    robot: Robot, paths: FloatArray, ik_weights: IkWeights, free_spin: bool, seed: int
) -> FloatArray:
    """Find the branches to try: those of the typical pose, put where home has its tool."""
    middle = paths[:, _POSES // 2].mean(axis=0)
    left, _, right = np.linalg.svd(middle[:3, :3])
    pose = np.eye(4)
    pose[:3, :3] = left @ right
    pose[:3, 3] = forward_kinematics(robot.chain, robot.home)[:3, 3]
    starts = draw_starts(robot, seed)
    return find_branches(robot, pose, starts, ik_weights, free_spin)[:_GREATEST_BRANCHES]
