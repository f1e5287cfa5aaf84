"""Where an arm's hand comes, by random poses: its reach, and what part is singular or touches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.robot.collision import distances
from besman.robot.kinematics import forward_kinematics, jacobian
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

POSES = 4000
"""Random poses that are looked at."""

SINGULAR = 0.05
"""Least singular value, of a Jacobian in shares of the reach, below which a pose is singular."""

_WIDEST_RAD = np.pi


@dataclass(frozen=True, eq=False)
class Workspace:
    """What random poses of an arm are like.

    Attributes
    ----------
    poses : array, shape (N, n)
        Evenly spread within the limits, a turn at most, rad.
    points : array, shape (N, 3)
        Tool centre point in the world, metres.
    touching : bool array, shape (N,)
        Whether the arm touches itself, its pedestal or the floor.
    least_turn : array, shape (N,)
        Least singular value of the Jacobian whose lengths are shares of the reach: how well the
        hand moves in the direction in which it moves worst. Of an arm with less than six joints
        that of the position alone.
    shoulder : array, shape (3,)
        Where the second joint is, metres: what the reach is counted from.
    reach_m : float
        Greatest distance of the tool centre point from there, of clear poses; of all, if none is.
    """

    poses: FloatArray
    points: FloatArray
    touching: BoolArray
    least_turn: FloatArray
    shoulder: FloatArray
    reach_m: float

    @property
    def singular(self) -> BoolArray:
        """Which poses are singular, or next to it, shape (N,)."""
        found: BoolArray = self.least_turn < SINGULAR
        return found


def sample_workspace(robot: Robot, count: int = POSES, seed: int = 0) -> Workspace:
    """Look at random poses of an arm.

    Parameters
    ----------
    robot : Robot
    count : int
        How many.
    seed : int
        Of the poses.

    Returns
    -------
    Workspace
    """
    low = np.maximum(robot.limits.position_min, robot.home - _WIDEST_RAD)
    high = np.minimum(robot.limits.position_max, robot.home + _WIDEST_RAD)
    poses: FloatArray = low + (high - low) * np.random.default_rng(seed).random((count, robot.n))
    points = forward_kinematics(robot.chain, poses)[:, :3, 3]
    touching = distances(robot.chain, poses).min(axis=1) <= 0
    places = robot.chain.placements
    shoulder = (places[0] @ places[1] if robot.n > 1 else places[0])[:3, 3]
    ways = np.linalg.norm(points - shoulder, axis=1)
    reach = float(ways[~touching].max() if (~touching).any() else ways.max())
    return Workspace(
        poses, points, touching, least_singular_values(robot, poses, reach), shoulder, reach
    )


def least_singular_values(robot: Robot, poses: FloatArray, reach_m: float) -> FloatArray:
    """Return how well the hand moves in the direction in which it moves worst, shape (N,).

    Parameters
    ----------
    robot : Robot
    poses : array, shape (N, n)
        rad.
    reach_m : float
        Length that the Jacobian's upper rows are divided by, so that turns and ways compare.

    References
    ----------
    J. Angeles, C. S. Lopez-Cajun: Kinematic isotropy and the conditioning index of serial robotic
    manipulators, 1992: the characteristic length.
    doi:10.1177/027836499201100605
    """
    matrices = jacobian(robot.chain, poses)
    matrices[:, :3] /= max(reach_m, 1e-6)
    if robot.n < 6:
        matrices = matrices[:, : min(3, robot.n)]
    least: FloatArray = np.asarray(np.linalg.svd(matrices, compute_uv=False)[:, -1], np.float64)
    return least
