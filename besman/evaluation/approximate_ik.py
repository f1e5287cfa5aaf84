"""The benchmark of approximate inverse kinematics: via points and obstacles for a KUKA iiwa 14.

A policy of 50 weights for each coordinate moves the arm for one second, from a pose to another.
A Cartesian policy is followed by inverse kinematics that cares for the position first (weights of
the squared errors: 1 and 0.001); a joint policy needs none. The joint angles are cut at their
limits, and judged by what is met on the way and by the sums over time of the norms of joint
velocity and acceleration.

References
----------
A. Fabisch: A Comparison of Policy Search in Joint Space and Cartesian Space for Refinement of
Skills. RAAD 2019, DOI 10.1007/978-3-030-19648-6_35; the functions as in the sources published
with it (rock-learning/approxik).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from besman.geometry.frames import quaternion_to_rotation
from besman.motion.cartesian_dmp import roll_out_poses
from besman.motion.dmp import roll_out
from besman.robot.ik_kernel import follow_paths
from besman.robot.kinematics import forward_kinematics
from besman.robot.parts import Chain

FloatArray = npt.NDArray[np.float64]

Course = Literal["via_points", "obstacles"]
Policy = Literal["cartesian", "joint"]

LIMIT_RAD = np.array([2.94, 2.08, 2.94, 2.08, 2.94, 2.08, 3.03])
N_WEIGHTS = 50
TIME_S = np.linspace(0.0, 1.0, 101)
STEP_S = 0.01
START = np.array([-0.2, -0.5, 0.8, 0.0, 1.0, 0.0, 0.0])
GOAL = np.array([0.2, -0.5, 0.8, 0.0, 1.0, 0.0, 0.0])

VIA_TIMES_S = np.array([0.0, 0.1, 0.45, 0.55, 1.0])
VIA_POINTS = np.array([START[:3], [-0.1, -0.5, 1.0], [0.0, -0.5, 0.5], [0.1, -0.6, 0.6], GOAL[:3]])
_VIA_PER_M, _VIA_RATES = 100.0, (1e-4, 1e-5)

OBSTACLES = np.array(
    [
        [0.0, y, z]
        for z, row in (
            (0.65, (-0.6, -0.4, -0.2)),
            (0.8, (-0.7, -0.5, -0.3, -0.1)),
            (0.95, (-0.6, -0.2)),
        )
        for y in row
    ]
)
OBSTACLE_RADIUS_M = 0.17
_GOAL_PER_M, _OBSTACLE, _OBSTACLE_RATES = 100.0, 10.0, (1e-2, 1e-5)

# Best rewards after 500 and 2000 episodes, mean and standard error of 30 runs, of the publication.
PUBLIC = {
    ("via_points", "cartesian"): ((-12.3, 0.5), (-6.12, 0.19)),
    ("via_points", "joint"): ((-16.1, 0.4), (-8.56, 0.24)),
    ("obstacles", "cartesian"): ((-2.69, 0.07), (-2.21, 0.03)),
    ("obstacles", "joint"): ((-8.37, 2.3), (-2.49, 0.06)),
}

# Weights of the errors, not of their squares; what they leave open is settled by the last angles.
_IK_WEIGHTS = np.array([1.0, np.sqrt(0.001), 1e-4])
_EXACT_WEIGHTS = np.array([1.0, 1.0, 1e-6])
_ROUNDS, _TOLERANCE = 30, 1e-7


@lru_cache(maxsize=1)
def iiwa14() -> Chain:
    """Return the KUKA LBR iiwa 14 R820 from its base to link 7, 0.081 m beyond the wrist centre."""
    up, across, back = [0.0, 0, 1], [0.0, 1, 0], [0.0, -1, 0]
    axes = np.array([up, across, up, back, up, across, up])
    placements = np.tile(np.eye(4), (7, 1, 1))
    # Shoulder 0.36 m above the base, elbow and wrist 0.42 m and 0.40 m further up.
    placements[:, 2, 3] = [0.1575, 0.2025, 0.2045, 0.2155, 0.1845, 0.2155, 0.081]
    none = np.empty(0, dtype=np.int64)
    return Chain(
        placements=placements,
        axes=axes,
        tip=np.eye(4),
        capsule_joints=none,
        capsule_ends=np.empty((0, 2, 3)),
        capsule_radii=np.empty(0),
        capsule_links=(),
        capsule_pairs=none.reshape(0, 2),
    )


def pose_matrices(poses: FloatArray) -> FloatArray:
    """Turn poses (..., 7), position and quaternion wxyz, into matrices (..., 4, 4)."""
    matrices = np.zeros((*poses.shape[:-1], 4, 4))
    matrices[..., :3, :3] = quaternion_to_rotation(poses[..., 3:])
    matrices[..., :3, 3] = poses[..., :3]
    matrices[..., 3, 3] = 1.0
    return matrices


def solve(poses: FloatArray, starts: FloatArray, weights: FloatArray) -> FloatArray:
    """Follow paths of poses (P, T, 7), each from starts (K, 7): joint angles (P, K, T, 7)."""
    chain = iiwa14()
    found, _ = follow_paths(
        chain.placements, chain.axes, chain.tip, -LIMIT_RAD, LIMIT_RAD, starts[0], weights, False,
        pose_matrices(poses), starts, 0, _ROUNDS, _TOLERANCE,
    )  # fmt: skip
    return found


@lru_cache(maxsize=1)
def end_angles() -> tuple[FloatArray, FloatArray]:
    """Return joint angles at the start, the nearest to an upright arm, and at the goal from them.

    Returns
    -------
    start, goal : array, shape (7,)
        rad.
    """
    drawn = np.random.default_rng(0).uniform(-1, 1, (200, 7)) * LIMIT_RAD
    found = solve(START[None, None], drawn, _EXACT_WEIGHTS)[0, :, 0]
    reached = forward_kinematics(iiwa14(), found)
    wrong = np.abs(reached - pose_matrices(START)).max(axis=(1, 2)) > 1e-4
    start = found[np.argmin(np.linalg.norm(found, axis=1) + np.where(wrong, np.inf, 0.0))]
    way = np.linspace(START, GOAL, 51)[None]
    goal = solve(way, start[None], _EXACT_WEIGHTS)[0, 0, -1]
    return start, goal


@dataclass(frozen=True)
class ArmFunction:
    """A course and a policy as a function of a search's points.

    Attributes
    ----------
    course : "via_points" or "obstacles"
    policy : "cartesian" or "joint"
    """

    course: Course
    policy: Policy

    @property
    def n_coordinates(self) -> int:
        """Number of coordinates that the policy moves, with `N_WEIGHTS` weights each."""
        return 6 if self.policy == "cartesian" else 7

    @property
    def dimension(self) -> int:
        """Number of coordinates of a point: all weights."""
        return self.n_coordinates * N_WEIGHTS

    def __call__(self, points: npt.ArrayLike) -> FloatArray:
        """Return the rewards (P,) of points (P, D)."""
        positions = self.move(points)
        tips = forward_kinematics(iiwa14(), positions)[..., :3, 3]
        rate = via_point_rewards if self.course == "via_points" else obstacle_rewards
        return rate(positions, tips)

    def move(self, points: npt.ArrayLike) -> FloatArray:
        """Return the joint angles (P, 101, 7) of points (P, D), rad."""
        array = np.asarray(points, dtype=np.float64)
        weights = array.reshape(len(array), self.n_coordinates, N_WEIGHTS)
        start, goal = end_angles()
        n = (len(array), 7)
        if self.policy == "joint":
            ends = np.broadcast_to(start, n), np.broadcast_to(goal, n)
            return np.clip(roll_out(weights, *ends, 1.0, TIME_S)[0], -LIMIT_RAD, LIMIT_RAD)
        ends = np.broadcast_to(START, n), np.broadcast_to(GOAL, n)
        return solve(roll_out_poses(weights, *ends, 1.0, TIME_S), start[None], _IK_WEIGHTS)[:, 0]


def rate_costs(positions: FloatArray, velocity: float, acceleration: float) -> FloatArray:
    """Return the costs (P,) of joint velocity and acceleration of movements (P, T, n)."""
    rest = np.zeros_like(positions[:, :1])
    v = np.concatenate([rest, np.diff(positions, axis=1) / STEP_S], axis=1)
    a = np.concatenate([rest, np.diff(v, axis=1) / STEP_S], axis=1)
    norms = [np.linalg.norm(x, axis=2).sum(axis=1) for x in (v, a)]
    return np.asarray(velocity * norms[0] + acceleration * norms[1])


def via_point_rewards(positions: FloatArray, tips: FloatArray) -> FloatArray:
    """Return the rewards (P,) of movements (P, T, n) with the tip at (P, T, 3): pass via points."""
    at = np.round(VIA_TIMES_S / STEP_S).astype(np.int64)
    missed = np.linalg.norm(tips[:, at] - VIA_POINTS, axis=2).sum(axis=1)
    return np.asarray(-_VIA_PER_M * missed - rate_costs(positions, *_VIA_RATES))


def obstacle_rewards(positions: FloatArray, tips: FloatArray) -> FloatArray:
    """Return the rewards (P,) of movements (P, T, n) with the tip at (P, T, 3): avoid obstacles."""
    apart = np.linalg.norm(tips[:, :, None] - OBSTACLES, axis=3)
    entered = np.maximum(1.0 - apart / OBSTACLE_RADIUS_M, 0.0).sum(axis=(1, 2))
    missed = np.linalg.norm(tips[:, -1] - GOAL[:3], axis=1)
    cost = _GOAL_PER_M * missed + _OBSTACLE * entered + rate_costs(positions, *_OBSTACLE_RATES)
    return np.asarray(-cost)
