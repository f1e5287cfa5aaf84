"""What a placement of demonstrations costs an arm, compiled."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from besman.robot.collision import least_distances, place_capsules
from besman.robot.ik_kernel import sweep
from besman.robot.kinematics import fill_frames, fill_jacobian, fill_tip

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

N_TERMS = 6


@numba.njit(cache=True, nogil=True)
def path_terms(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    capsule_joints: IntArray,
    capsule_ends: FloatArray,
    capsule_radii: FloatArray,
    capsule_pairs: IntArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    positions: FloatArray,
    errors: FloatArray,
    targets: FloatArray,
    step_s: float,
    scales: FloatArray,
    terms: FloatArray,
) -> None:
    """Write the cost terms of one path in joint space into `terms`.

    Parameters
    ----------
    placements, axes, tip, capsule_joints, capsule_ends, capsule_radii, capsule_pairs : array
        As in `Chain`.
    velocity, acceleration : array, shape (n,)
        Limits, rad/s and rad/s^2.
    positions : array, shape (P, n)
        rad.
    errors : array, shape (P, 2)
        Position (m) and orientation (rad).
    targets : array, shape (P, 4, 4)
        Poses asked for, metres.
    step_s : float
        Seconds between poses.
    scales : array, shape (4,)
        What makes a term 1: position (m), orientation (rad), manipulability (m^3) and distance (m)
        below which the arm is too close to a singularity or to itself.
    terms : array, shape (6,)
        Written: position, orientation, singularity, collision, speed, workspace.
    """
    n_poses, n = positions.shape
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    rotation, origin, before = np.empty((3, 3)), np.empty(3), np.zeros(3)
    jacobian = np.empty((6, n))
    placed = np.empty((len(capsule_joints), 2, 3))
    singular = collision = stretch = reached = asked = 0.0
    for index in range(n_poses):
        fill_frames(placements, axes, positions[index], rotations, origins)
        fill_tip(tip, rotations[n - 1], origins[n - 1], rotation, origin)
        fill_jacobian(axes, rotations, origins, origin, jacobian)
        measure = np.sqrt(max(np.linalg.det(jacobian @ jacobian.T), 0.0))
        singular += max(0.0, 1.0 - measure / scales[2]) ** 2
        place_capsules(capsule_joints, capsule_ends, rotations, origins, placed)
        near, low = least_distances(capsule_joints, placed, capsule_radii, capsule_pairs)
        collision += max(0.0, 1.0 - min(near, low) / scales[3])
        if index > 0:
            reached += np.sqrt(np.sum((origin - before) ** 2))
            asked += np.sqrt(np.sum((targets[index, :3, 3] - targets[index - 1, :3, 3]) ** 2))
            for joint in range(n):
                step = positions[index, joint] - positions[index - 1, joint]
                stretch = max(stretch, abs(step) / step_s / velocity[joint])
                if index > 1:
                    change = step - positions[index - 1, joint] + positions[index - 2, joint]
                    pull = abs(change) / step_s**2 / acceleration[joint]
                    stretch = max(stretch, np.sqrt(pull))
        before[:] = origin
    terms[0] = np.sqrt(np.mean(errors[:, 0] ** 2)) / scales[0]
    terms[1] = np.sqrt(np.mean(errors[:, 1] ** 2)) / scales[1]
    terms[2] = singular / n_poses
    terms[3] = collision / n_poses
    terms[4] = max(0.0, stretch - 1.0)
    terms[5] = max(0.0, 1.0 - reached / asked) if asked > 0.0 else 0.0


@numba.njit(cache=True, nogil=True)
def placement_terms(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    capsule_joints: IntArray,
    capsule_ends: FloatArray,
    capsule_radii: FloatArray,
    capsule_pairs: IntArray,
    low: FloatArray,
    high: FloatArray,
    home: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    ik_weights: FloatArray,
    free_spin: bool,
    scales: FloatArray,
    term_weights: FloatArray,
    starts: FloatArray,
    demonstrations: FloatArray,
    steps_s: FloatArray,
    placement: FloatArray,
) -> tuple[FloatArray, IntArray]:
    """Compute the terms of every demonstration on its cheapest branch.

    Parameters
    ----------
    placements, axes, tip, capsule_joints, capsule_ends, capsule_radii, capsule_pairs : array
        As in `Chain`.
    low, high, home, ik_weights, free_spin
        As in `solve_pose`.
    velocity, acceleration, scales : array
        As in `path_terms`.
    term_weights : array, shape (6,)
        By which branches are compared.
    starts : array, shape (K, n)
        Configurations on the branches to try, rad.
    demonstrations : array, shape (D, P, 4, 4)
        Poses of the tool centre point in the back frame, metres.
    steps_s : array, shape (D,)
        Seconds between poses.
    placement : array, shape (4, 4)
        Back frame to the robot's world frame.

    Returns
    -------
    terms : array, shape (D, 6)
    branches : int array, shape (D,)
        Index of the start that each demonstration's cheapest branch came from.
    """
    n_demonstrations, n_poses = demonstrations.shape[:2]
    result = np.zeros((n_demonstrations, N_TERMS))
    branches = np.zeros(n_demonstrations, dtype=np.int64)
    targets = np.empty((n_poses, 4, 4))
    terms = np.empty(N_TERMS)
    for index in range(n_demonstrations):
        for pose in range(n_poses):
            targets[pose] = np.dot(placement, demonstrations[index, pose])
        best = np.inf
        for start in range(len(starts)):
            positions, errors = sweep(
                placements, axes, tip, low, high, home, ik_weights, free_spin,
                targets, starts[start], n_poses // 2, 25, 1e-5,
            )  # fmt: skip
            path_terms(
                placements, axes, tip, capsule_joints, capsule_ends, capsule_radii, capsule_pairs,
                velocity, acceleration, positions, errors, targets, steps_s[index], scales, terms,
            )  # fmt: skip
            cost = np.sum(term_weights * terms)
            if cost < best:
                best = cost
                result[index] = terms
                branches[index] = start
    return result, branches
