"""What a good placement is: named terms of paths in joint space."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from besman.robot.collision import distances
from besman.robot.dynamics import inverse_dynamics
from besman.robot.kinematics import forward_kinematics, manipulability
from besman.robot.model import Robot
from besman.stages.map.terms_kernel import fill_terms

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# What makes a term 1.
POSITION_SCALE_M = 0.01
ORIENTATION_SCALE_RAD = np.radians(10.0)
SAFE_DISTANCE_M = 0.03
HEIGHT_SCALE_M = 0.1
SCALE_SCALE = 0.1  # natural logarithm of the factor
SINGULAR_SHARE = 0.3  # of the manipulability at home
EASY_SHARE = 0.9  # of a torque limit, to stand still
_WEAK_POSES, _MOST_HEAVY = 200, 2.0


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
        By how much the movement must be stretched to keep velocity and acceleration limits, and
        by how much more where the arm can hardly hold itself.
    workspace : float
        Share of the demonstrated path length that the arm does not use.
    height : float
        Distance from the height at which the movement was demonstrated, per 10 cm; a throw from
        another height lands elsewhere. Only where that height is known.
    scale : float
        By how much movements are made smaller or larger, per tenth. Only where they may be.
    """

    position: float = 1.0
    orientation: float = 0.3
    singularity: float = 1.0
    collision: float = 3.0
    speed: float = 3.0
    workspace: float = 1.0
    height: float = 0.3
    scale: float = 0.5

    def as_array(self) -> FloatArray:
        """Return the weights in the order of the fields, shape (8,)."""
        return np.array([getattr(self, field.name) for field in fields(self)])


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
        In the order of `TermWeights`, without height and scale.
    """
    limits = robot.limits
    rms = np.sqrt(np.mean(errors**2, axis=-2)) / (POSITION_SCALE_M, ORIENTATION_SCALE_RAD)
    usable = SINGULAR_SHARE * max(float(manipulability(robot.chain, robot.home)), 1e-6)
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


def cheapest_terms(
    robot: Robot,
    positions: FloatArray,
    errors: FloatArray,
    targets: FloatArray,
    steps_s: FloatArray,
    weights: FloatArray,
    more: FloatArray | None = None,
) -> tuple[FloatArray, IntArray]:
    """Compute the same for the cheapest of K branches of D demonstrations, by a kernel.

    Parameters
    ----------
    robot : Robot
    positions : array, shape (D, K, P, n)
        rad.
    errors : array, shape (D, K, P, 2)
        Position (m) and orientation (rad).
    targets : array, shape (D, P, 4, 4)
        Poses asked for, metres.
    steps_s : array, shape (D,)
        Seconds between poses.
    weights : array, shape (6,)
        Of the terms.
    more : array, shape (D, K), optional
        What each branch costs besides.

    Returns
    -------
    terms : array, shape (D, 6)
    branches : int array, shape (D,)
    """
    chain, limits = robot.chain, robot.limits
    usable = SINGULAR_SHARE * max(float(manipulability(chain, robot.home)), 1e-6)
    n_paths, n_branches = positions.shape[:2]
    terms, chosen = np.empty((n_paths, 6)), np.empty(n_paths, dtype=np.int64)
    fill_terms(
        chain.placements, chain.axes, chain.tip, chain.capsule_joints, chain.capsule_ends,
        chain.capsule_radii, chain.capsule_pairs, limits.velocity, limits.acceleration, usable,
        SAFE_DISTANCE_M, np.array([POSITION_SCALE_M, ORIENTATION_SCALE_RAD]), positions, errors,
        np.array(targets, order="C"), np.array(steps_s), np.array(weights),
        np.zeros((n_paths, n_branches)) if more is None else np.array(more), terms, chosen,
    )  # fmt: skip
    return terms, chosen


def static_loads(robot: Robot, positions: FloatArray) -> FloatArray:
    """Return the shares of the torque limits that standing still takes, shape (..., n)."""
    still = np.zeros_like(positions)
    loads: FloatArray = np.abs(inverse_dynamics(robot, positions, still, still))
    return loads / robot.limits.torque


def is_weak(robot: Robot) -> bool:
    """Tell whether there are poses that an arm can hardly hold."""
    limits = robot.limits
    share = np.random.default_rng(0).random((_WEAK_POSES, robot.n))
    poses = limits.position_min + share * (limits.position_max - limits.position_min)
    return bool(static_loads(robot, poses).max() > EASY_SHARE)


def heaviness(robot: Robot, positions: FloatArray) -> FloatArray:
    """Return by how much paths are taken to be slower where a joint can hardly hold the arm.

    What gravity leaves of a torque is what moves; where it leaves nothing no stretch of time helps.

    Parameters
    ----------
    robot : Robot
    positions : array, shape (..., P, n)
        rad.

    Returns
    -------
    array, shape (...)
        Added to the speed's term; below 2, so that an arm that cannot hold itself anywhere is not
        sent where it cannot reach.
    """
    most = static_loads(robot, positions).max(axis=(-2, -1))
    heavy = np.maximum(0.0, most - EASY_SHARE) / (1.0 - EASY_SHARE)
    slower: FloatArray = heavy / (1.0 + heavy / _MOST_HEAVY)
    return slower


def _length(points: FloatArray) -> FloatArray:
    """Return the lengths of polylines (..., P, 3), metres."""
    lengths: FloatArray = np.linalg.norm(np.diff(points, axis=-2), axis=-1).sum(axis=-1)
    return lengths
