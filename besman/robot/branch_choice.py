"""Candidates for the joint path of an arm: sequences of branches, chosen over all poses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from besman.robot.branch_sequence import choose_sequences
from besman.robot.branches import (
    SAME_BRANCH_RAD,
    IkWeights,
    draw_starts,
    find_branches,
    follow_all,
    is_new,
    joint_box,
)
from besman.robot.collision import distances
from besman.robot.kinematics import manipulability
from besman.robot.limits import time_stretch
from besman.robot.model import Robot
from besman.robot.path_refinement import LINEAR_RAD
from besman.robot.ur_kinematics import UrGeometry, read_geometry, solve_branches

FloatArray = npt.NDArray[np.float64]

Gaps = Callable[[FloatArray], FloatArray]
"""How far an arm is from what it must not touch, metres, by its joints, (..., n) to (...)."""

_ANCHORS = 5
_SEQUENCES = 4
_DIFFERENT_RAD = 0.3
# Within this distance to itself a branch is dearer than any other.
_SAFE_DISTANCE_M = 0.01
# Touching what stands around, of which ways at hand keep clear yet, costs as much as this error.
_BESIDE_M = 0.02
# Closeness to a singularity or to a limit costs a configuration at most this much pose error.
_CLOSE_M = 2e-3
_SINGULAR_SHARE = 0.3  # of the manipulability at home
_WIDE_RAD = 0.2
# A spin of the tool that is free is looked at in these many steps, at these many poses.
_SPINS = 24
_SPIN_POSES = 16


def choose_candidates(
    robot: Robot,
    targets: FloatArray,
    weights: IkWeights,
    free_spin: bool,
    step_s: float | None,
    seed: int,
    gaps: Gaps | None = None,
) -> FloatArray:
    """Choose joint paths that are worth refining.

    Parameters
    ----------
    robot : Robot
    targets : array, shape (T, 4, 4)
        Poses of the tool centre point, metres.
    weights, free_spin, step_s, seed, gaps
        As in `besman.robot.inverse_kinematics.solve_path`.

    Returns
    -------
    array, shape (K, T, n)
        rad; at least one.
    """
    geometry = read_geometry(robot.chain)
    if geometry is not None:
        choose = _choose_spins if free_spin else _choose_exact
        sequences = choose(robot, geometry, targets, step_s, gaps)
        if len(sequences):
            return sequences
    return _choose_followed(robot, targets, weights, free_spin, step_s, seed, gaps)


def rate_paths(
    robot: Robot,
    positions: FloatArray,
    errors: FloatArray,
    weights: IkWeights,
    step_s: float | None,
    gaps: Gaps | None = None,
    near: FloatArray | None = None,
) -> FloatArray:
    """Return what paths cost: pose errors first, then time, way, collisions and home.

    Parameters
    ----------
    robot : Robot
    positions : array, shape (K, T, n)
        rad.
    errors : array, shape (K, T, 2)
        Position (m) and orientation (rad).
    weights, step_s, gaps
        As in `besman.robot.inverse_kinematics.solve_path`.
    near : array, shape (K, T), optional
        What `nearness` says of them, where that is known.

    Returns
    -------
    array, shape (K,)
        Like metres of position error (root mean square and greatest).
    """
    steps = np.diff(positions, axis=1)
    near = nearness(robot, positions) if near is None else near
    costs: FloatArray = (
        np.sqrt(np.mean(_squared_errors(errors, weights), axis=1))
        + 0.2 * weights.position * errors[:, :, 0].max(axis=1)
        + weights.home * np.sqrt(np.mean((positions - robot.home) ** 2, axis=(1, 2)))
        + weights.home * np.sum(np.linalg.norm(steps, axis=2), axis=1)
        + np.mean(near, axis=1)
    )
    if gaps is not None:
        costs += _BESIDE_M * np.mean(_shortfall(gaps(positions)), axis=1)
    if step_s is not None and steps.shape[1] > 1:
        rates = steps / step_s, np.diff(steps, axis=1) / step_s**2
        stretch = [time_stretch(robot.limits, *both) for both in zip(*rates, strict=True)]
        costs += weights.stretch * np.maximum(np.array(stretch) - 1.0, 0.0)
    return costs


def nearness(robot: Robot, positions: FloatArray) -> FloatArray:
    """Return by what share of a safe distance to itself and the floor an arm falls short of it."""
    return _shortfall(distances(robot.chain, positions, _SAFE_DISTANCE_M).min(axis=-1))


def _shortfall(distance: FloatArray) -> FloatArray:
    """Return by what share of a safe distance each falls short of it."""
    near: FloatArray = np.maximum(0.0, 1.0 - distance / _SAFE_DISTANCE_M)
    return near


def _squared_errors(errors: FloatArray, weights: IkWeights) -> FloatArray:
    """Return what pose errors (..., 2) cost, as in `refine_path`."""
    place, turn = errors[..., 0] ** 2, errors[..., 1]
    turn = np.where(turn > LINEAR_RAD, LINEAR_RAD * (2 * turn - LINEAR_RAD), turn**2)
    squares: FloatArray = weights.position**2 * place + weights.orientation**2 * turn
    return squares


def _choose_exact(
    robot: Robot,
    geometry: UrGeometry,
    targets: FloatArray,
    step_s: float | None,
    gaps: Gaps | None,
) -> FloatArray:
    """Choose sequences of exact branches (K, T, n); none if a pose cannot be reached."""
    low, high = joint_box(robot)
    states, valid = solve_branches(geometry, targets, low, high, robot.home)
    return _choose(robot, states, np.where(valid, 0.0, np.inf), 1, step_s, gaps)


def _choose_spins(
    robot: Robot,
    geometry: UrGeometry,
    targets: FloatArray,
    step_s: float | None,
    gaps: Gaps | None,
) -> FloatArray:
    """Choose sequences of exact branches and spins at some poses, with straight ways between."""
    n_poses = len(targets)
    rows = np.unique(np.rint(np.linspace(0, n_poses - 1, _SPIN_POSES)).astype(int))
    low, high = joint_box(robot)
    turned = _spun(targets[rows]).reshape(-1, 4, 4)
    states, valid = solve_branches(geometry, turned, low, high, robot.home)
    states = np.swapaxes(states.reshape(_SPINS, len(rows), -1, 6), 0, 1).reshape(len(rows), -1, 6)
    valid = np.swapaxes(valid.reshape(_SPINS, len(rows), -1), 0, 1).reshape(len(rows), -1)
    stride = (n_poses - 1) / max(len(rows) - 1, 1)
    chosen = _choose(robot, states, np.where(valid, 0.0, np.inf), stride, step_s, gaps)
    return _between(chosen, rows, n_poses)


def _spun(targets: FloatArray) -> FloatArray:
    """Return poses (S, R, 4, 4) of all spins about the tool's z axis, apart from their own spin.

    Spin 0 is carried from pose to pose without a turn about z, whatever the spins asked for are.
    """
    axes = targets[:, :3, 2]
    across = np.eye(3)[np.argmin(np.abs(axes[0]))]
    spins = np.arange(_SPINS) * 2 * np.pi / _SPINS
    result = np.tile(targets, (_SPINS, 1, 1, 1))
    for index, axis in enumerate(axes):
        across = across - axis * (axis @ across)
        across /= max(float(np.linalg.norm(across)), 1e-9)
        beside = np.cross(axis, across)
        turned = np.outer(np.cos(spins), across) + np.outer(np.sin(spins), beside)
        result[:, index, :3, 0] = turned
        result[:, index, :3, 1] = np.cross(axis, turned)
    return result


def _between(sequences: FloatArray, rows: npt.NDArray[np.int64], n_poses: int) -> FloatArray:
    """Fill sequences (K, R, n) that are known at some poses with straight ways (K, T, n)."""
    full = np.empty((len(sequences), n_poses, sequences.shape[2]))
    for sequence, known in zip(full, sequences, strict=True):
        for joint in range(sequences.shape[2]):
            sequence[:, joint] = np.interp(np.arange(n_poses), rows, known[:, joint])
    return full


def _choose_followed(
    robot: Robot,
    targets: FloatArray,
    weights: IkWeights,
    free_spin: bool,
    step_s: float | None,
    seed: int,
    gaps: Gaps | None,
) -> FloatArray:
    """Choose sequences (K, T, n) of branches that are followed from several poses."""
    starts = draw_starts(robot, seed)
    paths: list[FloatArray] = []
    errors: list[FloatArray] = []
    for anchor in np.unique(np.rint(np.linspace(0, len(targets) - 1, _ANCHORS)).astype(int)):
        branches = find_branches(robot, targets[anchor], starts, weights, free_spin)
        found, missed = follow_all(
            robot, targets[None], branches, int(anchor), weights, free_spin,
            rounds=30, tolerance=1e-6,
        )  # fmt: skip
        for path, error in zip(found[0], missed[0], strict=True):
            if is_new(path, paths, SAME_BRANCH_RAD):
                paths.append(path)
                errors.append(error)
    states, missed = np.stack(paths, axis=1), np.stack(errors, axis=1)
    near = nearness(robot, states)
    chosen = _choose(robot, states, _squared_errors(missed, weights), 1, step_s, gaps, near)
    rated = rate_paths(robot, np.array(paths), np.array(errors), weights, step_s, gaps, near.T)
    order = np.argsort(rated, kind="stable")[:_SEQUENCES]
    # Most of those that are followed are among the sequences already.
    further = [paths[at] for at in order if is_new(paths[at], list(chosen), SAME_BRANCH_RAD)]
    return np.concatenate([chosen, np.array(further).reshape(-1, *chosen.shape[1:])])


def _choose(
    robot: Robot,
    states: FloatArray,
    squares: FloatArray,
    stride: float,
    step_s: float | None,
    gaps: Gaps | None,
    near: FloatArray | None = None,
) -> FloatArray:
    """Choose different sequences (K, T, n) from states (T, S, n) of these squared pose errors.

    `near` (T, S) is what `nearness` says of them, where that is known.
    """
    low, high = joint_box(robot)
    costs = squares.copy()
    here = np.isfinite(costs)
    usable = _SINGULAR_SHARE * max(float(manipulability(robot.chain, robot.home)), 1e-6)
    some = states[here]
    singular = np.maximum(0.0, 1.0 - manipulability(robot.chain, some) / usable)
    room = np.minimum(some - low, high - some).min(axis=1)
    tight = np.maximum(0.0, 1.0 - room / _WIDE_RAD)
    close = nearness(robot, some) if near is None else near[here]
    away = np.mean((some - robot.home) ** 2, axis=1)
    costs[here] += _CLOSE_M**2 * (singular**2 + tight**2 + 0.1 * away) + 0.1 * close
    if gaps is not None:
        costs[here] += _BESIDE_M**2 * _shortfall(gaps(some))
    # Without a time the arm is thought to need a second from one end of the path to the other.
    pace = (step_s or 1.0 / len(states)) * stride
    found = choose_sequences(
        states, costs, robot.limits.velocity * pace, low, high, robot.home, 4 * _SEQUENCES
    )
    kept: list[FloatArray] = []
    for path in found:
        if is_new(path, kept, _DIFFERENT_RAD):
            kept.append(path)
    return np.array(kept[:_SEQUENCES]).reshape(-1, len(states), robot.n)
