"""Levenberg-Marquardt inverse kinematics on plain arrays, compiled."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled, fill_frames, fill_jacobian, fill_tip

FloatArray = npt.NDArray[np.float64]

_GREATEST_STEP_RAD = 0.6


@compiled
def pose_error(pose: FloatArray, target: FloatArray, free_spin: bool, error: FloatArray) -> None:
    """Write position error (m) and rotation vector (rad) from pose to target into `error` (6,)."""
    x = y = z = 0.0
    cosine = 0.0
    if free_spin:
        # The shortest turn of one z axis to the other.
        a, b, c = pose[0, 2], pose[1, 2], pose[2, 2]
        u, v, w = target[0, 2], target[1, 2], target[2, 2]
        x, y, z = b * w - c * v, c * u - a * w, a * v - b * u
        cosine = a * u + b * v + c * w
    else:
        # The skew part of target * pose' is sine times axis.
        for k in range(3):
            x += 0.5 * (target[2, k] * pose[1, k] - target[1, k] * pose[2, k])
            y += 0.5 * (target[0, k] * pose[2, k] - target[2, k] * pose[0, k])
            z += 0.5 * (target[1, k] * pose[0, k] - target[0, k] * pose[1, k])
            for row in range(3):
                cosine += 0.5 * target[row, k] * pose[row, k]
        cosine -= 0.5
    sine = np.sqrt(x * x + y * y + z * z)
    if sine < 1e-9 and cosine < 0.0:
        # Half a turn apart: any axis across will do to get away.
        x, y, z = pose[0, 0], pose[1, 0], pose[2, 0]
        sine = 1.0
        scale = np.pi
    else:
        scale = np.arctan2(sine, cosine) / sine if sine > 1e-12 else 1.0
    error[0] = target[0, 3] - pose[0, 3]
    error[1] = target[1, 3] - pose[1, 3]
    error[2] = target[2, 3] - pose[2, 3]
    error[3], error[4], error[5] = x * scale, y * scale, z * scale


@compiled
def _cost(error: FloatArray, angles: FloatArray, nearby: FloatArray, weights: FloatArray) -> float:
    """Sum the weighted squares of pose error and distance from the preferred angles."""
    total = 0.0
    for i in range(len(angles)):
        total += (weights[2] * (angles[i] - nearby[i])) ** 2
    for row in range(6):
        total += ((weights[0] if row < 3 else weights[1]) * error[row]) ** 2
    return total


@compiled
def _square(error: FloatArray) -> float:
    """Return the sum of squares of a pose error (6,)."""
    total = 0.0
    for row in range(6):
        total += error[row] ** 2
    return total


@compiled
def _solve_linear(matrix: FloatArray, vector: FloatArray, solution: FloatArray) -> None:
    """Solve a small symmetric positive definite system by Cholesky; overwrites `matrix`.

    Of the matrix the lower triangle is read; the factor's diagonal is kept inverted.
    """
    n = len(vector)
    for i in range(n):
        for j in range(i):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total * matrix[j, j]
        total = matrix[i, i]
        for k in range(i):
            total -= matrix[i, k] * matrix[i, k]
        # Damping keeps the pivots above zero but for rounding.
        matrix[i, i] = 1.0 / np.sqrt(max(total, 1e-30))
    for i in range(n):
        total = vector[i]
        for k in range(i):
            total -= matrix[i, k] * solution[k]
        solution[i] = total * matrix[i, i]
    for i in range(n - 1, -1, -1):
        total = solution[i]
        for k in range(i + 1, n):
            total -= matrix[k, i] * solution[k]
        solution[i] = total * matrix[i, i]


@compiled
def _fill_normal_equations(
    jacobian: FloatArray,
    error: FloatArray,
    angles: FloatArray,
    nearby: FloatArray,
    weights: FloatArray,
    matrix: FloatArray,
    gradient: FloatArray,
) -> None:
    """Write J'J, its lower triangle, and J'e of the weighted problem."""
    near, place, turn = weights[2] ** 2, weights[0] ** 2, weights[1] ** 2
    for i in range(len(angles)):
        # Written out: a loop over the rows takes twice as long.
        a, b, c = place * jacobian[0, i], place * jacobian[1, i], place * jacobian[2, i]
        d, e, f = turn * jacobian[3, i], turn * jacobian[4, i], turn * jacobian[5, i]
        gradient[i] = (
            near * (nearby[i] - angles[i])
            + (a * error[0] + b * error[1] + c * error[2])
            + (d * error[3] + e * error[4] + f * error[5])
        )
        for j in range(i + 1):
            matrix[i, j] = (a * jacobian[0, j] + b * jacobian[1, j] + c * jacobian[2, j]) + (
                d * jacobian[3, j] + e * jacobian[4, j] + f * jacobian[5, j]
            )
        matrix[i, i] += near


@compiled
def _fill_damped(
    matrix: FloatArray,
    gradient: FloatArray,
    angles: FloatArray,
    low: FloatArray,
    high: FloatArray,
    damping: float,
    damped: FloatArray,
) -> None:
    """Write the damped lower triangle; a joint at its limit that is pushed further out is held."""
    n = len(angles)
    for i in range(n):
        for j in range(i + 1):
            damped[i, j] = matrix[i, j]
        damped[i, i] += damping * (matrix[i, i] + 1e-6)
        if (angles[i] <= low[i] and gradient[i] < 0.0) or (
            angles[i] >= high[i] and gradient[i] > 0.0
        ):
            damped[i, i] += 1e12


@compiled
def _take_step(
    angles: FloatArray, step: FloatArray, low: FloatArray, high: FloatArray, trial: FloatArray
) -> float:
    """Write the next trial, within the box and not too far; return the greatest step asked for."""
    greatest = 0.0
    for i in range(len(step)):
        greatest = max(greatest, abs(step[i]))
    shrink = min(1.0, _GREATEST_STEP_RAD / greatest) if greatest > 0.0 else 1.0
    for i in range(len(step)):
        trial[i] = min(max(angles[i] + shrink * step[i], low[i]), high[i])
    return greatest


@compiled
def remove_spin(jacobian: FloatArray, pose: FloatArray) -> None:
    """Take the rotation about the tool's z axis out of a Jacobian."""
    for i in range(jacobian.shape[1]):
        spin = 0.0
        for row in range(3):
            spin += jacobian[3 + row, i] * pose[row, 2]
        for row in range(3):
            jacobian[3 + row, i] -= spin * pose[row, 2]


@numba.njit(inline="always", error_model="numpy")
def _improve(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    low: FloatArray,
    high: FloatArray,
    nearby: FloatArray,
    weights: FloatArray,
    free_spin: bool,
    target: FloatArray,
    angles: FloatArray,
    error: FloatArray,
    rounds: int,
    tolerance: float,
    enough: float,
    rotations: FloatArray,
    origins: FloatArray,
    pose: FloatArray,
    jacobian: FloatArray,
    matrix: FloatArray,
    damped: FloatArray,
    gradient: FloatArray,
    step: FloatArray,
    trial: FloatArray,
    trial_error: FloatArray,
) -> float:
    """Improve `angles` in place until the pose is met as well as can be; return the cost.

    It ends, too, where the six entries of `error` are no longer than `enough`. See `follow_paths`.
    The further arrays are written over. They are allocated once for many poses and passed one by
    one into a function that is part of its callers: a fifth of a pose's time.
    """
    n = len(angles)
    for i in range(n):
        trial[i] = angles[i]
    cost, damping, greatest = np.inf, 1e-4, np.inf
    for _ in range(rounds + 1):
        fill_frames(placements, axes, trial, rotations, origins)
        fill_tip(tip, rotations, origins, pose)
        pose_error(pose, target, free_spin, trial_error)
        new_cost = _cost(trial_error, trial, nearby, weights)
        if new_cost < cost:
            gain = cost - new_cost
            cost = new_cost
            damping = max(damping * 0.2, 1e-12)
            for i in range(n):
                angles[i] = trial[i]
            for row in range(6):
                error[row] = trial_error[row]
            if gain <= tolerance * (cost + 1e-9) or _square(error) <= enough * enough:
                break
            fill_jacobian(axes, rotations, origins, pose, jacobian)
            if free_spin:
                remove_spin(jacobian, pose)
            _fill_normal_equations(jacobian, error, angles, nearby, weights, matrix, gradient)
        else:
            damping *= 6.0
            if greatest < 1e-9 or damping > 1e9:
                break
        _fill_damped(matrix, gradient, angles, low, high, damping, damped)
        _solve_linear(damped, gradient, step)
        greatest = _take_step(angles, step, low, high, trial)
    return cost


@compiled
def follow_paths(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    low: FloatArray,
    high: FloatArray,
    home: FloatArray,
    weights: FloatArray,
    free_spin: bool,
    targets: FloatArray,
    starts: FloatArray,
    anchor: int,
    rounds: int,
    tolerance: float,
    enough: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Follow paths from an anchor pose to both ends, each pose from its neighbour's answer.

    What a pose leaves open is settled by home at the anchor and by the neighbour's answer from
    there on, so that a redundant arm makes no idle motion.

    Parameters
    ----------
    placements, axes, tip : array
        As in `Chain`.
    low, high : array, shape (n,)
        Box of joint angles, rad.
    home : array, shape (n,)
        Preferred at the anchor, rad.
    weights : array, shape (3,)
        Of position (1/m), orientation (1/rad), distance from the preferred angles (1/rad).
    free_spin : bool
        The rotation about the tool's z axis does not matter.
    targets : array, shape (D, T, 4, 4)
        Poses of D paths, metres.
    starts : array, shape (K, n)
        Where to start at the anchor, rad.
    anchor : int
        Index of the pose to start from.
    rounds, tolerance : int, float
        Greatest number of steps, and the relative improvement below which a pose is left.
    enough : float
        See `besman.robot.branches.follow_all`.

    Returns
    -------
    positions : array, shape (D, K, T, n)
        rad.
    errors : array, shape (D, K, T, 2)
        Position (m) and orientation (rad).
    """
    n_paths, n_poses, n_starts, n = len(targets), targets.shape[1], len(starts), len(axes)
    positions = np.empty((n_paths, n_starts, n_poses, n))
    errors = np.empty((n_paths, n_starts, n_poses, 2))
    angles, nearby, error = np.empty(n), np.empty(n), np.empty(6)
    rotations, origins, pose = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((4, 4))
    jacobian, matrix, damped = np.empty((6, n)), np.empty((n, n)), np.empty((n, n))
    gradient, step_rad, trial, trial_error = np.empty(n), np.empty(n), np.empty(n), np.empty(6)
    for path in range(n_paths):
        for start in range(n_starts):
            for count in range(n_poses):
                # First from the anchor to the end, then from the anchor back to the beginning.
                index = anchor + count if anchor + count < n_poses else n_poses - 1 - count
                step = 1 if anchor + count < n_poses else -1
                # The movement is thought to go on as it does; where the end is not looked for to
                # the last digit by a parabola, which often is near enough at once.
                known = min((index - anchor) * step, 3 if enough > 0.0 else 2)
                for i in range(n):
                    if count == 0:
                        angles[i], nearby[i] = starts[start, i], home[i]
                    else:
                        nearby[i] = ahead = positions[path, start, index - step, i]
                        if known == 2:
                            ahead += nearby[i] - positions[path, start, index - 2 * step, i]
                        elif known == 3:
                            ahead = 3.0 * (ahead - positions[path, start, index - 2 * step, i])
                            ahead += positions[path, start, index - 3 * step, i]
                        angles[i] = min(max(ahead, low[i]), high[i])
                _improve(
                    placements, axes, tip, low, high, nearby, weights, free_spin,
                    targets[path, index], angles, error, rounds, tolerance, enough,
                    rotations, origins, pose, jacobian, matrix, damped, gradient, step_rad, trial,
                    trial_error,
                )  # fmt: skip
                for i in range(n):
                    positions[path, start, index, i] = angles[i]
                errors[path, start, index, 0] = np.sqrt(
                    error[0] * error[0] + error[1] * error[1] + error[2] * error[2]
                )
                errors[path, start, index, 1] = np.sqrt(
                    error[3] * error[3] + error[4] * error[4] + error[5] * error[5]
                )
    return positions, errors
