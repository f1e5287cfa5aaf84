"""The terms of `besman.stages.map.terms.path_terms`, compiled: the search asks for thousands."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.collision import first_falling, nearest_parts, place_capsules
from besman.robot.kinematics import compiled, fill_frames, fill_jacobian, fill_tip

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
    terms: FloatArray,
) -> None:
    """Write the terms of paths.

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
    terms : array, shape (D, K, 6)
        Written: position, orientation, singularity, collision, speed, workspace.
    """
    n_paths, n_branches, n_poses, n = positions.shape
    falling = first_falling(placements, axes)
    rotations, origins, pose = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((4, 4))
    jacobian, square = np.empty((6, n)), np.empty((6, 6))
    placed, last, pair = np.empty((len(joints), 2, 3)), np.empty(3), -1
    for path in range(n_paths):
        asked = 0.0
        for index in range(1, n_poses):
            way = 0.0
            for row in range(3):
                way += (targets[path, index, row, 3] - targets[path, index - 1, row, 3]) ** 2
            asked += np.sqrt(way)
        for branch in range(n_branches):
            off = turned = singular = near = used = 0.0
            for index in range(n_poses):
                fill_frames(placements, axes, positions[path, branch, index], rotations, origins)
                fill_tip(tip, rotations, origins, pose)
                fill_jacobian(axes, rotations, origins, pose, jacobian)
                lack = max(0.0, 1.0 - manipulability_of(jacobian, square) / usable)
                singular += lack * lack
                place_capsules(joints, ends, rotations, origins, placed)
                own, floor, pair, _ = nearest_parts(
                    joints, placed, radii, pairs, pair, safe_m, falling
                )
                near += max(0.0, 1.0 - min(own, floor) / safe_m)
                off += errors[path, branch, index, 0] ** 2
                turned += errors[path, branch, index, 1] ** 2
                way = 0.0
                for row in range(3):
                    if index > 0:
                        way += (pose[row, 3] - last[row]) ** 2
                    last[row] = pose[row, 3]
                used += np.sqrt(way)
            row_of = terms[path, branch]
            row_of[0] = np.sqrt(off / n_poses) / scales[0]
            row_of[1] = np.sqrt(turned / n_poses) / scales[1]
            row_of[2] = singular / n_poses
            row_of[3] = near / n_poses
            row_of[4] = _fastest(positions[path, branch], steps_s[path], velocity, acceleration)
            row_of[5] = max(0.0, 1.0 - used / max(asked, 1e-9))
