"""The terms of `besman.stages.map.terms.path_terms`, compiled: the search asks for thousands."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.body_balls import Bodies, group_pairs
from besman.robot.collision import first_falling, place_capsules
from besman.robot.kinematics import compiled, fill_frames, fill_jacobian, fill_tip
from besman.robot.nearest_pair import nearest_parts

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@compiled
def manipulability_of(jacobian: FloatArray, square: FloatArray) -> float:
    """Return sqrt(det(J J')) of a Jacobian (6, n) by Cholesky; `square` (6, 6) is written over."""
    product = 1.0
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(jacobian.shape[1]):
                total += jacobian[i, k] * jacobian[j, k]
            for k in range(j):
                total -= square[i, k] * square[j, k]
            if i == j:
                if total <= 0.0:
                    return 0.0
                square[i, i] = np.sqrt(total)
                product *= square[i, i]
            else:
                square[i, j] = total / square[j, j]
    return product


@compiled
def _fastest(
    path: FloatArray, step_s: float, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Return by how much a path (P, n) is too fast for the limits."""
    speed = pull = 0.0
    for pose in range(1, len(path)):
        for j in range(path.shape[1]):
            way = path[pose, j] - path[pose - 1, j]
            speed = max(speed, abs(way) / step_s / velocity[j])
            if pose > 1:
                bend = way - path[pose - 1, j] + path[pose - 2, j]
                pull = max(pull, abs(bend) / step_s**2 / acceleration[j])
    return float(max(0.0, max(speed, np.sqrt(pull)) - 1.0))


@compiled
def _nearness(
    placements: FloatArray,
    axes: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    bodies: Bodies,
    safe_m: float,
    path: FloatArray,
) -> float:
    """Return by what share of a safe distance a path (P, n) falls short of it, on average."""
    n_poses, n = path.shape
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    placed, pair, near = np.empty((len(joints), 2, 3)), -1, 0.0
    falling = first_falling(placements, axes)
    for index in range(n_poses):
        fill_frames(placements, axes, path[index], rotations, origins)
        place_capsules(joints, ends, rotations, origins, placed)
        own, floor, pair, _ = nearest_parts(
            joints, placed, radii, pairs, bodies, pair, safe_m, falling
        )
        near += max(0.0, 1.0 - min(own, floor) / safe_m)
    return float(near / n_poses)


@compiled
def _fill_free(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    usable: float,
    path: FloatArray,
    row_of: FloatArray,
) -> float:
    """Write a path's term of singularity; return the length of the tool's way, metres."""
    n_poses, n = path.shape
    rotations, origins, pose = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((4, 4))
    jacobian, square, last = np.empty((6, n)), np.empty((6, 6)), np.empty(3)
    singular = used = 0.0
    for index in range(n_poses):
        fill_frames(placements, axes, path[index], rotations, origins)
        fill_tip(tip, rotations, origins, pose)
        fill_jacobian(axes, rotations, origins, pose, jacobian)
        lack = max(0.0, 1.0 - manipulability_of(jacobian, square) / usable)
        singular += lack * lack
        way = 0.0
        for row in range(3):
            if index > 0:
                way += (pose[row, 3] - last[row]) ** 2
            last[row] = pose[row, 3]
        used += np.sqrt(way)
    row_of[2] = singular / n_poses
    return used


@compiled
def _way_of(targets: FloatArray) -> float:
    """Return how long the way through poses (P, 4, 4) is, metres."""
    total = 0.0
    for index in range(1, len(targets)):
        way = 0.0
        for row in range(3):
            way += (targets[index, row, 3] - targets[index - 1, row, 3]) ** 2
        total += np.sqrt(way)
    return total


@compiled
def fill_terms(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    usable: float,
    safe_m: float,
    scales: FloatArray,
    positions: FloatArray,
    errors: FloatArray,
    targets: FloatArray,
    steps_s: FloatArray,
    weights: FloatArray,
    more: FloatArray,
    terms: FloatArray,
    chosen: IntArray,
) -> None:
    """Write which branch is cheapest, and its terms.

    How near a path comes to itself costs as much to tell as all else: it is only looked at where
    a branch may still be the cheapest.

    Parameters
    ----------
    placements, axes, tip, joints, ends, radii, pairs : array
        Of a `besman.robot.parts.Chain`.
    velocity, acceleration : array, shape (n,)
        Limits, rad/s and rad/s^2.
    usable, safe_m : float
        Manipulability (m^3) and distance (m) that are enough.
    scales : array, shape (2,)
        Position (m) and orientation error (rad) that make a term 1.
    positions : array, shape (D, K, P, n)
        rad.
    errors : array, shape (D, K, P, 2)
        Position (m) and orientation (rad).
    targets : array, shape (D, P, 4, 4)
        Poses asked for, metres.
    steps_s : array, shape (D,)
        Seconds between poses.
    weights : array, shape (6,)
        Of the terms, none below 0.
    more : array, shape (D, K)
        What a branch costs besides.
    terms : array, shape (D, 6)
        Written: position, orientation, singularity, collision, speed, workspace.
    chosen : int array, shape (D,)
        Written.
    """
    n_paths, n_branches, n_poses, _ = positions.shape
    bodies = group_pairs(joints, ends, radii, pairs)
    found, costs = np.empty((n_branches, 6)), np.empty(n_branches)
    for path in range(n_paths):
        asked = _way_of(targets[path])
        for branch in range(n_branches):
            row_of, off, turned = found[branch], 0.0, 0.0
            used = _fill_free(placements, axes, tip, usable, positions[path, branch], row_of)
            for index in range(n_poses):
                off += errors[path, branch, index, 0] ** 2
                turned += errors[path, branch, index, 1] ** 2
            row_of[0] = np.sqrt(off / n_poses) / scales[0]
            row_of[1] = np.sqrt(turned / n_poses) / scales[1]
            row_of[3] = 0.0
            row_of[4] = _fastest(positions[path, branch], steps_s[path], velocity, acceleration)
            row_of[5] = max(0.0, 1.0 - used / max(asked, 1e-9))
            costs[branch] = more[path, branch]
            for term in range(6):
                costs[branch] += weights[term] * row_of[term]
        least, best = np.inf, -1
        for _ in range(n_branches):
            branch = int(np.argmin(costs))
            if best >= 0 and not costs[branch] < least:
                break
            found[branch, 3] = _nearness(
                placements, axes, joints, ends, radii, pairs, bodies, safe_m,
                positions[path, branch],
            )  # fmt: skip
            total = costs[branch] + weights[3] * found[branch, 3]
            costs[branch] = np.inf
            if best < 0 or total < least:
                least, best = total, branch
        chosen[path] = best
        for term in range(6):
            terms[path, term] = found[best, term]
