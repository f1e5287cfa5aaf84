"""Branches of an arm: configurations that reach one pose, followed along paths of poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from besman.robot.ik_kernel import follow_paths
from besman.robot.model import Robot
from besman.robot.parts import JointLimits

FloatArray = npt.NDArray[np.float64]

# Branches of an arm with six joints: eight, some of them twice within +-360 degrees.
_RANDOM_STARTS = 24
SAME_BRANCH_RAD = 0.05
_LIMIT_MARGIN_RAD = np.radians(0.5)


@dataclass(frozen=True)
class IkWeights:
    """What counts how much where not all can be had.

    Attributes
    ----------
    position : float
        Per metre.
    orientation : float
        Per radian.
    home : float
        Per radian from the home configuration; small: it decides only what the pose leaves open.
    stretch : float
        Per unit of time stretch that a branch needs beyond 1 to keep velocity and acceleration
        limits; compares branches where the time between poses is known.

    References
    ----------
    A. Fabisch: A comparison of policy search in joint space and Cartesian space for refinement of
    skills, 2019 (approximate inverse kinematics). doi:10.1007/978-3-030-19648-6_35
    """

    position: float = 1.0
    orientation: float = 0.1
    home: float = 1e-3
    stretch: float = 0.005

    def as_array(self) -> FloatArray:
        """Return the weights of one pose, shape (3,)."""
        return np.array([self.position, self.orientation, self.home])


def follow_all(
    robot: Robot,
    targets: FloatArray,
    starts: FloatArray,
    anchor: int,
    weights: IkWeights,
    free_spin: bool,
    *,
    rounds: int,
    tolerance: float,
    enough: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Follow many paths from many starts; see `besman.robot.ik_kernel.follow_paths`.

    Parameters
    ----------
    robot : Robot
    targets : array, shape (D, T, 4, 4)
        Poses of D paths, metres.
    starts : array, shape (K, n)
        Where to start at the anchor, rad.
    anchor : int
        Index of the pose to start from.
    weights, free_spin
        As in `besman.robot.inverse_kinematics.solve_path`.
    rounds, tolerance : int, float
        Greatest number of steps a pose, and the relative improvement that ends them.

    enough : float
        A pose is met where the error's six entries (m and rad) are no longer than this; what it
        leaves open is then settled less exactly. 0: to the tolerance.

    Returns
    -------
    positions : array, shape (D, K, T, n)
        rad.
    errors : array, shape (D, K, T, 2)
        Position (m) and orientation (rad).
    """
    chain = robot.chain
    low, high = joint_box(robot)
    return follow_paths(
        chain.placements,
        chain.axes,
        chain.tip,
        low,
        high,
        np.array(robot.home),
        weights.as_array(),
        free_spin,
        _writable(targets),
        _writable(starts),
        anchor,
        rounds,
        tolerance,
        enough,
    )


def _writable(values: FloatArray) -> FloatArray:
    """Return an array that is writable: a read-only one would be compiled for once more."""
    fits = values.flags.c_contiguous and values.flags.writeable
    return (
        values if fits and values.dtype == np.float64 else np.array(values, np.float64, order="C")
    )


def find_branches(
    robot: Robot,
    target: FloatArray,
    starts: FloatArray,
    weights: IkWeights,
    free_spin: bool,
) -> FloatArray:
    """Solve one pose from many starts and keep one configuration of every branch.

    Parameters
    ----------
    robot : Robot
    target : array, shape (4, 4)
        Pose in the robot's world frame, metres.
    starts : array, shape (S, n)
        Configurations to start from, rad.
    weights, free_spin
        As in `besman.robot.inverse_kinematics.solve_path`.

    Returns
    -------
    array, shape (K, n)
        Configurations in the order of their cost, rad.
    """
    paths, errors = follow_all(
        robot, target[None, None], starts, 0, weights, free_spin, rounds=100, tolerance=1e-10
    )
    found = paths[0, :, 0]
    costs = (
        (weights.position * errors[0, :, 0, 0]) ** 2
        + (weights.orientation * errors[0, :, 0, 1]) ** 2
        + weights.home**2 * np.sum((found - robot.home) ** 2, axis=1)
    )
    order = np.argsort(costs, kind="stable")
    # Others than the best are worth following only if they come near the pose at all.
    bound = costs[order[0]] + (0.05 * weights.position) ** 2
    kept: list[FloatArray] = []
    for index in order:
        if costs[index] <= bound and is_new(found[index], kept, SAME_BRANCH_RAD):
            kept.append(found[index])
    return np.array(kept)


def is_new(one: FloatArray, others: Sequence[FloatArray], apart_rad: float) -> bool:
    """Tell whether a configuration or path differs in some joint by more than this from others."""
    if len(others) == 0:
        return True
    ways = np.abs(np.asarray(others) - one).reshape(len(others), -1)
    return bool(ways.max(axis=1).min() > apart_rad)


def draw_starts(robot: Robot, seed: int) -> FloatArray:
    """Return home and configurations drawn around it, shape (S, n)."""
    rng = np.random.default_rng(seed)
    low, high = joint_box(robot)
    near = robot.home + rng.uniform(-np.pi, np.pi, (_RANDOM_STARTS, robot.n))
    return np.vstack([robot.home, np.clip(near, low, high)])


def joint_box(robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Return the position limits, a little inside, so that a smoothed path stays within."""
    low, high = _box_within(robot.limits)
    return low.copy(), high.copy()


@lru_cache(maxsize=64)
def _box_within(limits: JointLimits) -> tuple[FloatArray, FloatArray]:
    """Return the box of `joint_box`: as long to compute as five poses of a path."""
    low, high = limits.position_min, limits.position_max
    margin = np.minimum(_LIMIT_MARGIN_RAD, (high - low) / 10)
    return low + margin, high - margin
