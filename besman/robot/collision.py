"""Distances of an arm to itself, to its pedestal and to the floor, by capsules."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import RobotError
from besman.robot.body_balls import group_pairs
from besman.robot.kinematics import as_rows, compiled, fill_frames
from besman.robot.nearest_pair import are_far, nearest_parts, segment_distance
from besman.robot.parts import Chain

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Cosine of the angle between an axis and the vertical, about two degrees.
_UPRIGHT = 0.9994


def distances(chain: Chain, positions: npt.ArrayLike, beyond: float = np.inf) -> FloatArray:
    """Compute how near an arm is to itself and to the floor.

    The first is the least distance between parts that must not touch, below zero where capsules
    overlap, the second the least height of the moving parts.

    Parameters
    ----------
    chain : Chain
        The arm with its capsules. A first joint that stands upright only turns its link above the
        base: that link is not measured against the floor.
    positions : array, shape (..., n)
        Joint angles, rad.
    beyond : float
        A self-distance greater than this is this, metres: to look for less is quicker.

    Returns
    -------
    array, shape (..., 2)
        Self-distance and floor distance, metres; infinite where there are no capsules, NaN where
        the angles are not finite.
    """
    rows, shape = as_rows(chain, positions)
    result = _distances(
        chain.placements,
        chain.axes,
        chain.capsule_joints,
        chain.capsule_ends,
        chain.capsule_radii,
        chain.capsule_pairs,
        rows,
        beyond,
    )
    result[~np.isfinite(rows).all(axis=1)] = np.nan
    return result.reshape(*shape, 2)


def distances_between(
    first: Chain, first_positions: npt.ArrayLike, second: Chain, second_positions: npt.ArrayLike
) -> FloatArray:
    """Compute the distance between the moving parts of two arms with one world.

    Parameters
    ----------
    first, second : Chain
    first_positions, second_positions : array, shape (..., n)
        Joint angles of each arm at the same moments, rad.

    Returns
    -------
    array, shape (...)
        Metres; below zero where capsules overlap, infinite where an arm has none.
    """
    rows, shape = as_rows(first, first_positions)
    others, other_shape = as_rows(second, second_positions)
    if shape != other_shape:
        raise RobotError(
            f"distances_between: got positions of {shape} and {other_shape} moments, expected the "
            "same for both arms"
        )
    arms = [
        (chain.placements, chain.axes, chain.capsule_joints, chain.capsule_ends, angles)
        for chain, angles in ((first, rows), (second, others))
    ]
    placed = [place_all(*arm) for arm in arms]
    moving = [chain.capsule_joints >= 0 for chain in (first, second)]
    result = least_gaps(
        placed[0][:, moving[0]],
        first.capsule_radii[moving[0]],
        placed[1][:, moving[1]],
        second.capsule_radii[moving[1]],
        np.inf,
    )
    return result.reshape(shape)


@compiled
def place_all(
    placements: FloatArray, axes: FloatArray, joints: IntArray, ends: FloatArray, rows: FloatArray
) -> FloatArray:
    """Return the capsules' ends in the world for every configuration, shape (B, C, 2, 3)."""
    rotations, origins = np.empty((len(axes), 3, 3)), np.empty((len(axes), 3))
    placed = np.empty((len(rows), len(joints), 2, 3))
    for index in range(len(rows)):
        fill_frames(placements, axes, rows[index], rotations, origins)
        place_capsules(joints, ends, rotations, origins, placed[index])
    return placed


@compiled
def least_gaps(
    first: FloatArray,
    first_radii: FloatArray,
    second: FloatArray,
    second_radii: FloatArray,
    beyond: float,
) -> FloatArray:
    """Return the least distance of two sets of placed capsules (B, C, 2, 3) in every pose (B,).

    What is further apart than `beyond`, metres, is that: to look for less is quicker.
    """
    result = np.full(len(first), beyond)
    one_ball, other_ball = np.empty((len(first_radii), 4)), np.empty((len(second_radii), 4))
    for index in range(len(first)):
        _fill_balls(first[index], first_radii, one_ball)
        _fill_balls(second[index], second_radii, other_ball)
        for one in range(len(first_radii)):
            for other in range(len(second_radii)):
                reach = result[index] + one_ball[one, 3] + other_ball[other, 3]
                if are_far(one_ball[one], other_ball[other], reach):
                    continue
                distance = segment_distance(
                    first[index, one, 0],
                    first[index, one, 1],
                    second[index, other, 0],
                    second[index, other, 1],
                )
                gap = distance - first_radii[one] - second_radii[other]
                result[index] = min(result[index], gap)
    return result


@compiled
def _fill_balls(placed: FloatArray, radii: FloatArray, balls: FloatArray) -> None:
    """Write middles and radii (C, 4) of the balls that enclose placed capsules, metres."""
    for capsule in range(len(radii)):
        square = 0.0
        for row in range(3):
            low, high = placed[capsule, 0, row], placed[capsule, 1, row]
            balls[capsule, row] = 0.5 * (low + high)
            square += (high - low) ** 2
        balls[capsule, 3] = 0.5 * np.sqrt(square) + radii[capsule]


@compiled
def place_capsules(
    joints: IntArray,
    ends: FloatArray,
    rotations: FloatArray,
    origins: FloatArray,
    placed: FloatArray,
) -> None:
    """Write the capsules' ends in the world into `placed`, shape (C, 2, 3)."""
    for capsule in range(len(joints)):
        joint = joints[capsule]
        for end in range(2):
            for row in range(3):
                if joint < 0:
                    placed[capsule, end, row] = ends[capsule, end, row]
                else:
                    placed[capsule, end, row] = (
                        origins[joint, row]
                        + rotations[joint, row, 0] * ends[capsule, end, 0]
                        + rotations[joint, row, 1] * ends[capsule, end, 1]
                        + rotations[joint, row, 2] * ends[capsule, end, 2]
                    )


@compiled
def first_falling(placements: FloatArray, axes: FloatArray) -> int:
    """Return the first joint that can bring its link nearer to the floor: 0 if its axis lies.

    Parameters
    ----------
    placements, axes : array
        As in `besman.robot.parts.Chain`.
    """
    if len(axes) == 0:
        return 0
    upwards = 0.0
    for row in range(3):
        upwards += placements[0, 2, row] * axes[0, row]
    return 1 if abs(upwards) > _UPRIGHT else 0


@compiled
def add_motion(
    axes: FloatArray,
    rotations: FloatArray,
    origins: FloatArray,
    joint: int,
    point: FloatArray,
    along: FloatArray,
    slope: FloatArray,
) -> None:
    """Add to `slope` (n,) how far a point moves along a direction, per rad of every joint.

    Parameters
    ----------
    axes, rotations, origins : array
        As `besman.robot.kinematics.fill_frames` has and writes them.
    joint : int
        That moves the point; -1: none.
    point, along : array, shape (3,)
        In the world, metres.
    slope : array, shape (n,)
        Written to, metres per rad.
    """
    for j in range(joint + 1):
        turn = rotations[j]
        a = turn[0, 0] * axes[j, 0] + turn[0, 1] * axes[j, 1] + turn[0, 2] * axes[j, 2]
        b = turn[1, 0] * axes[j, 0] + turn[1, 1] * axes[j, 1] + turn[1, 2] * axes[j, 2]
        d = turn[2, 0] * axes[j, 0] + turn[2, 1] * axes[j, 1] + turn[2, 2] * axes[j, 2]
        x, y, z = point[0] - origins[j, 0], point[1] - origins[j, 1], point[2] - origins[j, 2]
        slope[j] += (
            along[0] * (b * z - d * y) + along[1] * (d * x - a * z) + along[2] * (a * y - b * x)
        )


@compiled
def _distances(
    placements: FloatArray,
    axes: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    rows: FloatArray,
    beyond: float,
) -> FloatArray:
    """Compute both distances of every configuration, shape (B, 2)."""
    n = len(axes)
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    placed = np.empty((len(joints), 2, 3))
    result, nearest = np.empty((len(rows), 2)), -1
    falling, bodies = first_falling(placements, axes), group_pairs(joints, ends, radii, pairs)
    for index in range(len(rows)):
        fill_frames(placements, axes, rows[index], rotations, origins)
        place_capsules(joints, ends, rotations, origins, placed)
        own, floor, nearest, _ = nearest_parts(
            joints, placed, radii, pairs, bodies, nearest, beyond, falling
        )
        result[index, 0], result[index, 1] = own, floor
    return result
