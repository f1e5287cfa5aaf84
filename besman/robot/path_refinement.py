"""A whole path improved at once: Gauss-Newton steps on all joint angles, within the limits."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.band_system import solve_band
from besman.robot.body_balls import Bodies, group_pairs
from besman.robot.collision import (
    add_motion,
    first_falling,
    place_capsules,
)
from besman.robot.ik_kernel import pose_error, remove_spin
from besman.robot.kinematics import compiled, fill_frames, fill_jacobian, fill_tip
from besman.robot.nearest_pair import nearest_parts, segment_shares
from besman.robot.parts import Chain
from besman.robot.path_smoothness import add_time, time_cost

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# What touching itself counts, in metres of pose error; see `besman.robot.path_smoothness` for more.
_TOUCH_M = 0.05
# Twice what most of the movement needs is no jump.
_RUSH = 1.3
# Beyond this an orientation error costs in proportion, no longer by its square (P. J. Huber: Robust
# estimation of a location parameter, 1964, doi:10.1214/aoms/1177703732): what an arm can turn only
# part of the way does not draw its position off.
LINEAR_RAD = 0.2
_SAFE_DISTANCE_M = 0.015
_GREATEST_STEP_RAD = 0.3


def refine_path(
    chain: Chain,
    targets: FloatArray,
    positions: FloatArray,
    box: tuple[FloatArray, FloatArray],
    weights: FloatArray,
    home: FloatArray,
    free_spin: bool,
    paces: tuple[FloatArray, FloatArray],
    *,
    pace_of: FloatArray | None = None,
    rounds: int = 60,
    tolerance: float = 1e-3,
) -> tuple[FloatArray, FloatArray]:
    """Improve all poses of a path together, so that one gives way where it helps the others.

    Minimises the weighted squares of pose errors, speeds, accelerations, speeds far beyond what
    most of the movement needs (jumps), nearness to itself and to the floor, distance from home.

    Parameters
    ----------
    chain : Chain
        The arm.
    targets : array, shape (T, 4, 4)
        Poses asked for, metres.
    positions : array, shape (T, n)
        Where to start, rad.
    box : (low, high), arrays of shape (n,)
        Limits of the joints, rad.
    weights : array, shape (3,)
        Of position (1/m), orientation (1/rad), distance from home (1/rad).
    home : array, shape (n,)
        rad.
    free_spin : bool
        The rotation about the tool's z axis does not matter.
    paces : (speed, pull), arrays of shape (n,)
        First and second differences between poses at the limits of speed and acceleration, rad.
    pace_of : array, shape (T, n), optional
        The path whose speed tells what is a jump; the one to start with if it is left out.
    rounds, tolerance : int, float
        Greatest number of steps, and the relative improvement below which the search ends.

    Returns
    -------
    positions : array, shape (T, n)
        rad.
    errors : array, shape (T, 2)
        Position (m) and orientation (rad).
    """
    answer = np.clip(positions, *box)
    usual = answer if pace_of is None else np.clip(pace_of, *box)
    rush = np.array(
        [_greatest_needed(np.diff(usual, k, axis=0), pace) for k, pace in enumerate(paces, 1)]
    )
    scales = np.stack([1.0 / paces[0], 1.0 / paces[1]])
    errors = _refine(
        chain.placements, chain.axes, chain.tip, chain.capsule_joints, chain.capsule_ends,
        chain.capsule_radii, chain.capsule_pairs, np.array(box[0]), np.array(box[1]),
        np.array(weights), np.array(home), free_spin, scales, rush,
        np.array(targets, order="C"), answer, rounds, tolerance,
    )  # fmt: skip
    return answer, errors


def _greatest_needed(differences: FloatArray, pace: FloatArray) -> float:
    """Return the share of the limits that most of the movement needs, and some more."""
    if len(differences) == 0:
        return np.inf
    return _RUSH * max(1.0, float(np.percentile(np.max(np.abs(differences) / pace, axis=1), 80)))


@compiled
def _copy(source: FloatArray, target: FloatArray) -> None:
    """Write one matrix over another."""
    for row in range(source.shape[0]):
        for column in range(source.shape[1]):
            target[row, column] = source[row, column]


@compiled
def _norm(error: FloatArray, first: int) -> float:
    """Return the length of three entries from `first` on."""
    return float(np.sqrt(error[first] ** 2 + error[first + 1] ** 2 + error[first + 2] ** 2))


@compiled
def _pose_cost(error: FloatArray, weights: FloatArray) -> float:
    """Return the cost of a pose error: position squared, orientation as Huber has it."""
    place = turn = 0.0
    for row in range(3):
        place += error[row] ** 2
        turn += error[3 + row] ** 2
    off = np.sqrt(turn)
    if off > LINEAR_RAD:
        turn = LINEAR_RAD * (2.0 * off - LINEAR_RAD)
    return float(weights[0] ** 2 * place + weights[1] ** 2 * turn)


@compiled
def _evaluate(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    bodies: Bodies,
    weights: FloatArray,
    home: FloatArray,
    free_spin: bool,
    targets: FloatArray,
    angles: FloatArray,
    errors: FloatArray,
    shorts: FloatArray,
    parts: IntArray,
) -> float:
    """Write the pose errors (T, 6); return their cost with that of distances and home.

    By which share the distances to itself and the floor fall short of the safe one is written to
    `shorts` (T,), which pair or capsule does to `parts` (T, 2), as `fill_slope` takes them.
    """
    n_poses, n = angles.shape
    rotations, origins, pose = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((4, 4))
    placed, pair = np.empty((len(joints), 2, 3)), -1
    falling = first_falling(placements, axes)
    total = 0.0
    for index in range(n_poses):
        fill_frames(placements, axes, angles[index], rotations, origins)
        fill_tip(tip, rotations, origins, pose)
        pose_error(pose, targets[index], free_spin, errors[index])
        place_capsules(joints, ends, rotations, origins, placed)
        own, floor, pair, down = nearest_parts(
            joints, placed, radii, pairs, bodies, pair, _SAFE_DISTANCE_M, falling
        )
        short = max(0.0, 1.0 - min(own, floor) / _SAFE_DISTANCE_M)
        shorts[index] = short
        parts[index, 0] = pair if short > 0.0 and own <= floor else -1
        parts[index, 1] = down if short > 0.0 and own > floor else -1
        total += _pose_cost(errors[index], weights) + (_TOUCH_M * short) ** 2
        for j in range(n):
            total += (weights[2] * (angles[index, j] - home[j])) ** 2
    return total


@compiled
def fill_slope(
    axes: FloatArray,
    joints: IntArray,
    pairs: IntArray,
    rotations: FloatArray,
    origins: FloatArray,
    placed: FloatArray,
    part: IntArray,
    slope: FloatArray,
) -> None:
    """Write the slope (n,), per rad, of what placed capsules lack to the safe distance.

    `part` has the pair that is nearest and falls short of it, or -1, and the capsule that is near
    the floor, or -1.
    """
    for j in range(len(slope)):
        slope[j] = 0.0
    if part[0] < 0 and part[1] < 0:
        return
    along, one, other = np.zeros(3), np.empty(3), np.empty(3)
    if part[0] >= 0:
        first, second = pairs[part[0], 0], pairs[part[0], 1]
        p, q = placed[first], placed[second]
        s, t = segment_shares(p[0], p[1], q[0], q[1])
        square = 0.0
        for row in range(3):
            one[row] = p[0, row] + s * (p[1, row] - p[0, row])
            other[row] = q[0, row] + t * (q[1, row] - q[0, row])
            square += (one[row] - other[row]) ** 2
        # Axes that meet have no way apart that is better than others.
        scale = -1.0 / (_SAFE_DISTANCE_M * np.sqrt(square)) if square > 1e-18 else 0.0
        for row in range(3):
            along[row] = scale * (one[row] - other[row])
        add_motion(axes, rotations, origins, joints[first], one, along, slope)
        for row in range(3):
            along[row] = -along[row]
        add_motion(axes, rotations, origins, joints[second], other, along, slope)
    else:
        down = part[1]
        lower = 0 if placed[down, 0, 2] <= placed[down, 1, 2] else 1
        along[2] = -1.0 / _SAFE_DISTANCE_M
        add_motion(axes, rotations, origins, joints[down], placed[down, lower], along, slope)


@compiled
def _add_poses(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    pairs: IntArray,
    weights: FloatArray,
    home: FloatArray,
    free_spin: bool,
    angles: FloatArray,
    errors: FloatArray,
    shorts: FloatArray,
    parts: IntArray,
    band: FloatArray,
    downhill: FloatArray,
) -> None:
    """Add pose errors, distances and home to the normal equations."""
    n_poses, n = angles.shape
    rotations, origins, pose = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((4, 4))
    jacobian, slope = np.empty((6, n)), np.empty(n)
    placed = np.empty((len(joints), 2, 3))
    for index in range(n_poses):
        fill_frames(placements, axes, angles[index], rotations, origins)
        fill_tip(tip, rotations, origins, pose)
        fill_jacobian(axes, rotations, origins, pose, jacobian)
        if free_spin:
            remove_spin(jacobian, pose)
        place_capsules(joints, ends, rotations, origins, placed)
        fill_slope(axes, joints, pairs, rotations, origins, placed, parts[index], slope)
        place, turn = weights[0] ** 2, weights[1] ** 2
        off = _norm(errors[index], 3)
        if off > LINEAR_RAD:
            turn *= LINEAR_RAD / off
        for j in range(n):
            here = index * n + j
            total = weights[2] ** 2 * (home[j] - angles[index, j])
            for row in range(6):
                total += (place if row < 3 else turn) * jacobian[row, j] * errors[index, row]
            downhill[here] += total - _TOUCH_M**2 * shorts[index] * slope[j]
            for k in range(j + 1):
                total = weights[2] ** 2 if j == k else 0.0
                for row in range(6):
                    total += (place if row < 3 else turn) * jacobian[row, j] * jacobian[row, k]
                band[here, j - k] += total + _TOUCH_M**2 * slope[j] * slope[k]


@compiled
def _fill_trial(
    angles: FloatArray,
    low: FloatArray,
    high: FloatArray,
    band: FloatArray,
    downhill: FloatArray,
    damping: float,
    trial: FloatArray,
) -> None:
    """Write the next trial (T, n): the damped step, not too far and within the limits."""
    n_poses, n = angles.shape
    damped, step = band.copy(), downhill.copy()
    for index in range(n_poses):
        for j in range(n):
            here = index * n + j
            damped[here, 0] += damping * (band[here, 0] + 1e-6)
            # A joint at its limit that is pushed further out is held.
            if (angles[index, j] <= low[j] and downhill[here] < 0.0) or (
                angles[index, j] >= high[j] and downhill[here] > 0.0
            ):
                damped[here, 0] += 1e12
    solve_band(damped, step, 2 * n)
    greatest = 0.0
    for here in range(len(step)):
        greatest = max(greatest, abs(step[here]))
    shrink = min(1.0, _GREATEST_STEP_RAD / greatest) if greatest > 0.0 else 1.0
    for index in range(n_poses):
        for j in range(n):
            wanted = angles[index, j] + shrink * step[index * n + j]
            trial[index, j] = min(max(wanted, low[j]), high[j])


@compiled
def _refine(
    placements: FloatArray,
    axes: FloatArray,
    tip: FloatArray,
    joints: IntArray,
    ends: FloatArray,
    radii: FloatArray,
    pairs: IntArray,
    low: FloatArray,
    high: FloatArray,
    weights: FloatArray,
    home: FloatArray,
    free_spin: bool,
    scales: FloatArray,
    rush: FloatArray,
    targets: FloatArray,
    angles: FloatArray,
    rounds: int,
    tolerance: float,
) -> FloatArray:
    """Improve `angles` in place; return the errors (T, 2). See `refine_path`."""
    n_poses, n = angles.shape
    band, downhill = np.empty((n_poses * n, 2 * n + 1)), np.empty(n_poses * n)
    trial, trial_errors, errors = angles.copy(), np.empty((n_poses, 6)), np.empty((n_poses, 6))
    trial_shorts, shorts = np.empty(n_poses), np.empty(n_poses)
    trial_parts, parts = np.empty((n_poses, 2), np.int64), np.empty((n_poses, 2), np.int64)
    cost, damping, bodies = np.inf, 1e-3, group_pairs(joints, ends, radii, pairs)
    for _ in range(rounds + 1):
        new_cost = time_cost(trial, scales, rush) + _evaluate(
            placements, axes, tip, joints, ends, radii, pairs, bodies, weights, home, free_spin,
            targets, trial, trial_errors, trial_shorts, trial_parts,
        )  # fmt: skip
        if new_cost < cost:
            gain = cost - new_cost
            cost = new_cost
            damping = max(damping * 0.2, 1e-9)
            _copy(trial, angles)
            _copy(trial_errors, errors)
            shorts[:] = trial_shorts
            parts[:] = trial_parts
            if gain <= tolerance * cost:
                break
            for here in range(n_poses * n):
                downhill[here] = 0.0
                for k in range(2 * n + 1):
                    band[here, k] = 0.0
            _add_poses(
                placements, axes, tip, joints, ends, pairs, weights, home, free_spin,
                angles, errors, shorts, parts, band, downhill,
            )  # fmt: skip
            add_time(angles, scales, rush, band, downhill)
        else:
            damping *= 8.0
            if damping > 1e7:
                break
        _fill_trial(angles, low, high, band, downhill, damping, trial)
    result = np.empty((n_poses, 2))
    for index in range(n_poses):
        for part in range(2):
            result[index, part] = _norm(errors[index], 3 * part)
    return result
