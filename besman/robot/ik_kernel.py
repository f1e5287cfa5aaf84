"""Levenberg-Marquardt inverse kinematics on plain arrays, compiled."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import fill_frames, fill_jacobian, fill_tip

FloatArray = npt.NDArray[np.float64]

_GREATEST_STEP_RAD = 0.6


@numba.njit(cache=True, nogil=True)
def _pose_error(
    rotation: FloatArray,
    origin: FloatArray,
    target: FloatArray,
    free_spin: bool,
    error: FloatArray,
) -> None:
    """Write position error (m) and rotation vector (rad) from pose to target into `error` (6,)."""
    for row in range(3):
        error[row] = target[row, 3] - origin[row]
    if free_spin:
        ax, ay, az = rotation[0, 2], rotation[1, 2], rotation[2, 2]
        bx, by, bz = target[0, 2], target[1, 2], target[2, 2]
        x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        cosine = ax * bx + ay * by + az * bz
        if cosine < 0.0 and x * x + y * y + z * z < 1e-18:
            # Opposite directions: any axis across will do.
            x, y, z = rotation[0, 0] * 1e-9, rotation[1, 0] * 1e-9, rotation[2, 0] * 1e-9
    else:
        # Half the skew part of target * rotation' is sine times axis.
        x = y = z = 0.0
        trace = 0.0
        for k in range(3):
            x += target[2, k] * rotation[1, k] - target[1, k] * rotation[2, k]
            y += target[0, k] * rotation[2, k] - target[2, k] * rotation[0, k]
            z += target[1, k] * rotation[0, k] - target[0, k] * rotation[1, k]
            for row in range(3):
                trace += target[row, k] * rotation[row, k]
        x, y, z = 0.5 * x, 0.5 * y, 0.5 * z
        cosine = 0.5 * (trace - 1.0)
    sine = np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(sine, cosine)
    scale = angle / sine if sine > 1e-12 else 1.0
    error[3], error[4], error[5] = x * scale, y * scale, z * scale


@numba.njit(cache=True, nogil=True)
def _cost(error: FloatArray, angles: FloatArray, home: FloatArray, weights: FloatArray) -> float:
    """Sum the weighted squares of pose error and distance from home."""
    total = 0.0
    for row in range(3):
        total += (weights[0] * error[row]) ** 2 + (weights[1] * error[3 + row]) ** 2
    for joint in range(len(angles)):
        total += (weights[2] * (angles[joint] - home[joint])) ** 2
    return total


@numba.njit(cache=True, nogil=True)
def _solve_linear(matrix: FloatArray, vector: FloatArray, solution: FloatArray) -> bool:
    """Solve a small symmetric positive definite system by Cholesky; overwrites `matrix`."""
    n = len(vector)
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                if total <= 0.0:
                    return False
                matrix[i, i] = np.sqrt(total)
            else:
                matrix[i, j] = total / matrix[j, j]
    for i in range(n):
        total = vector[i]
        for k in range(i):
            total -= matrix[i, k] * solution[k]
        solution[i] = total / matrix[i, i]
    for i in range(n - 1, -1, -1):
        total = solution[i]
        for k in range(i + 1, n):
            total -= matrix[k, i] * solution[k]
        solution[i] = total / matrix[i, i]
    return True


@numba.njit(cache=True, nogil=True)
def _normal_equations(
    jacobian: FloatArray,
    error: FloatArray,
    pointing: FloatArray,
    angles: FloatArray,
    home: FloatArray,
    weights: FloatArray,
    free_spin: bool,
    matrix: FloatArray,
    gradient: FloatArray,
) -> None:
    """Write J'J and J'e of the weighted problem; a free spin takes its row out of J."""
    n = len(angles)
    if free_spin:
        for joint in range(n):
            along = 0.0
            for row in range(3):
                along += jacobian[3 + row, joint] * pointing[row]
            for row in range(3):
                jacobian[3 + row, joint] -= along * pointing[row]
    wp, wo, wh = weights[0] ** 2, weights[1] ** 2, weights[2] ** 2
    for i in range(n):
        down = wh * (home[i] - angles[i])
        for row in range(3):
            down += wp * jacobian[row, i] * error[row]
            down += wo * jacobian[3 + row, i] * error[3 + row]
        gradient[i] = down
        for j in range(i + 1):
            total = 0.0
            for row in range(3):
                total += wp * jacobian[row, i] * jacobian[row, j]
                total += wo * jacobian[3 + row, i] * jacobian[3 + row, j]
            matrix[i, j] = total
            matrix[j, i] = total
        matrix[i, i] += wh


@numba.njit(cache=True, nogil=True)
def solve_pose(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    low: FloatArray,
    high: FloatArray,
    home: FloatArray,
    weights: FloatArray,
    free_spin: bool,
    target: FloatArray,
    angles: FloatArray,
    error: FloatArray,
    rounds: int,
    tolerance: float,
) -> float:
    """Improve `angles` in place until the pose is met as well as can be; return the cost.

    Parameters
    ----------
    placements, axes, tip : array
        As in `Chain`.
    low, high, home : array, shape (n,)
        Box of joint angles and preferred ones, rad.
    weights : array, shape (3,)
        Of position (1/m), orientation (1/rad), distance from home (1/rad).
    free_spin : bool
        The rotation about the tool's z axis does not matter.
    target : array, shape (4, 4)
        Pose asked for, metres.
    angles : array, shape (n,)
        Start, overwritten by the answer, rad.
    error : array, shape (6,)
        Written: remaining position error (m) and rotation vector (rad).
    rounds : int
        Greatest number of steps.
    tolerance : float
        Relative improvement below which the search ends.

    Returns
    -------
    float
        Weighted sum of squares.
    """
    n = len(angles)
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    rotation, origin = np.empty((3, 3)), np.empty(3)
    jacobian, matrix, damped = np.empty((6, n)), np.empty((n, n)), np.empty((n, n))
    gradient, step, trial, trial_error = np.empty(n), np.empty(n), np.empty(n), np.empty(6)
    fill_frames(placements, axes, angles, rotations, origins)
    fill_tip(tip, rotations[n - 1], origins[n - 1], rotation, origin)
    _pose_error(rotation, origin, target, free_spin, error)
    cost = _cost(error, angles, home, weights)
    damping = 1e-4
    stale = True
    for _ in range(rounds):
        if stale:
            fill_jacobian(axes, rotations, origins, origin, jacobian)
            pointing = rotation[:, 2].copy()
            _normal_equations(
                jacobian, error, pointing, angles, home, weights, free_spin, matrix, gradient
            )
            stale = False
        for i in range(n):
            # A joint at its limit that is pushed further out stands still in this step.
            held = (angles[i] <= low[i] and gradient[i] < 0.0) or (
                angles[i] >= high[i] and gradient[i] > 0.0
            )
            for j in range(n):
                damped[i, j] = matrix[i, j]
            damped[i, i] += damping * (matrix[i, i] + 1e-6)
            if held:
                damped[i, i] += 1e12
        if not _solve_linear(damped, gradient, step):
            damping *= 10.0
            continue
        greatest = np.max(np.abs(step))
        shrink = min(1.0, _GREATEST_STEP_RAD / greatest) if greatest > 0.0 else 1.0
        for i in range(n):
            trial[i] = min(max(angles[i] + shrink * step[i], low[i]), high[i])
        fill_frames(placements, axes, trial, rotations, origins)
        fill_tip(tip, rotations[n - 1], origins[n - 1], rotation, origin)
        _pose_error(rotation, origin, target, free_spin, trial_error)
        new_cost = _cost(trial_error, trial, home, weights)
        if new_cost < cost:
            gain = cost - new_cost
            angles[:] = trial
            error[:] = trial_error
            cost = new_cost
            damping = max(damping * 0.2, 1e-12)
            stale = True
            if gain <= tolerance * (new_cost + 1e-9):
                break
        else:
            if greatest < 1e-9 or damping > 1e9:
                break
            damping *= 6.0
    return cost


@numba.njit(cache=True, nogil=True)
def solve_from(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    low: FloatArray,
    high: FloatArray,
    home: FloatArray,
    weights: FloatArray,
    free_spin: bool,
    target: FloatArray,
    starts: FloatArray,
    rounds: int,
    tolerance: float,
) -> tuple[FloatArray, FloatArray]:
    """Solve one pose from many starts: configurations (S, n) and costs (S,)."""
    found = starts.copy()
    costs = np.empty(len(starts))
    error = np.empty(6)
    for index in range(len(starts)):
        costs[index] = solve_pose(
            placements, axes, tip, low, high, home, weights, free_spin,
            target, found[index], error, rounds, tolerance,
        )  # fmt: skip
    return found, costs


@numba.njit(cache=True, nogil=True)
def sweep(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    low: FloatArray,
    high: FloatArray,
    home: FloatArray,
    weights: FloatArray,
    free_spin: bool,
    targets: FloatArray,
    start: FloatArray,
    anchor: int,
    rounds: int,
    tolerance: float,
) -> tuple[FloatArray, FloatArray]:
    """Follow a path (T, 4, 4) from its anchor to both ends, each pose from its neighbour's answer.

    What a pose leaves open is settled by home at the anchor and by the neighbour's answer from
    there on, so that a redundant arm makes no idle motion.

    Returns
    -------
    positions : array, shape (T, n)
        rad.
    errors : array, shape (T, 2)
        Position (m) and orientation (rad).
    """
    n_poses, n = len(targets), len(start)
    positions, errors = np.empty((n_poses, n)), np.empty((n_poses, 2))
    error = np.empty(6)
    angles, nearby = start.copy(), home.copy()
    for turn in range(2):
        if turn == 1:
            angles[:] = positions[anchor]
            nearby[:] = angles
        first = anchor if turn == 0 else anchor - 1
        last = n_poses if turn == 0 else -1
        for index in range(first, last, 1 if turn == 0 else -1):
            solve_pose(
                placements, axes, tip, low, high, nearby, weights, free_spin,
                targets[index], angles, error, rounds, tolerance,
            )  # fmt: skip
            positions[index] = angles
            nearby[:] = angles
            errors[index, 0] = np.sqrt(np.sum(error[:3] ** 2))
            errors[index, 1] = np.sqrt(np.sum(error[3:] ** 2))
    return positions, errors
