"""Weights of DMPs: those of a trajectory, and those that change a movement which rests at its ends.

All are least squares under the linear conditions of `rest_conditions`.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from besman.motion.dmp import dmp_basis, respond, roll_out
from besman.motion.forcing import DENSE, LAST_PHASE, count_nodes

FloatArray = npt.NDArray[np.float64]

# Singular values below this share of the greatest are not told from zero.
_RANK = 1e-13
_RIDGE = 1e-10  # relative to the largest eigenvalue


@lru_cache(maxsize=16)
def rest_conditions(n_weights: int) -> FloatArray:
    """Give the rows that vanish for a DMP that starts and ends at rest, at its goal.

    Returns
    -------
    array, shape (4, K + 2)
        Times ``[start, goal, weights]``: acceleration at the start; distance to the goal,
        velocity and acceleration at the end.
    """
    position, velocity, acceleration = respond(np.eye(n_weights + 2))
    miss = position[-1].copy()
    miss[1] -= 1.0
    conditions = np.stack([acceleration[0], miss, velocity[-1], acceleration[-1]])
    conditions.setflags(write=False)
    return conditions


def fit_weights(time: npt.ArrayLike, positions: npt.ArrayLike, n_weights: int) -> FloatArray:
    """Fit a DMP to a trajectory by least squares between trajectories.

    The DMP starts at the trajectory's start and ends at its end, both at rest (see
    `rest_conditions`), also where the trajectory itself still moves.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds from 0, rising.
    positions : array, shape (T, n)
        rad.
    n_weights : int
        Weights per joint, at least 5.

    Returns
    -------
    array, shape (n, K)
    """
    time, positions = np.asarray(time, dtype=np.float64), np.asarray(positions, dtype=np.float64)
    identity = np.eye(n_weights + 2)
    response, _, _ = roll_out(identity[:, 2:], identity[:, 0], identity[:, 1], time[-1], time)
    ends = np.stack([positions[0], positions[-1]])
    residual = positions - response[:, :2] @ ends
    conditions = rest_conditions(n_weights)
    return fit_within_conditions(
        response[:, 2:], residual, conditions[:, 2:], -conditions[:, :2] @ ends
    ).T


def fit_within_conditions(
    response: FloatArray, residual: FloatArray, conditions: FloatArray, value: FloatArray
) -> FloatArray:
    """Find the weights (K, n) with the least ``|response w - residual|^2`` that keep conditions.

    Late weights act through a small phase: scaled by it all weigh alike, and none that the movement
    depends on is lost to rounding, however many turns it makes.
    """
    n_weights = response.shape[1]
    scale = LAST_PHASE ** -np.linspace(0.0, 1.0, n_weights)
    particular, null = _solutions(conditions * scale, value)
    matrix = response * scale
    found = np.linalg.lstsq(matrix @ null, residual - matrix @ particular, rcond=_RANK)[0]
    weights: FloatArray = scale[:, None] * (particular + null @ found)
    return weights


def _solutions(constraint: FloatArray, value: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the smallest solution of constraint w = value, and a basis of all changes of it."""
    left, singular, right = np.linalg.svd(constraint)
    rank = len(singular)
    return right[:rank].T @ ((left.T @ value) / singular[:, None]), right[rank:].T


def constrained_least_squares(
    matrix: FloatArray, target: FloatArray, constraint: FloatArray, value: FloatArray
) -> FloatArray:
    """Minimise ``|matrix w - target|^2`` with a tiny ridge, subject to constraint w = value."""
    particular, null = _solutions(constraint, value)
    reduced = matrix @ null
    gram = reduced.T @ reduced
    gram += _RIDGE * np.linalg.eigvalsh(gram)[-1] * np.eye(len(gram))
    weights: FloatArray = particular + null @ np.linalg.solve(
        gram, reduced.T @ (target - matrix @ particular)
    )
    return weights


@lru_cache(maxsize=16)
def goal_response(n_weights: int) -> FloatArray:
    """Change the weights with the goal such that a movement at rest at its ends stays so.

    Of all such changes it is the one that adds the least mean square acceleration.

    Parameters
    ----------
    n_weights : int
        Weights per joint, at least 5.

    Returns
    -------
    array, shape (K,)
        Change of one joint's weights for a change of its goal by 1 rad.
    """
    if n_weights > DENSE:
        coarse = np.concatenate([[0.0, 1.0], goal_response(DENSE)])
        finer: FloatArray = _as_fine(coarse[None], n_weights)[0]
        return finer
    conditions = rest_conditions(n_weights)
    basis = dmp_basis(n_weights)
    change = constrained_least_squares(
        basis.acceleration[:, 2:],
        -basis.acceleration[:, 1:2],
        conditions[:, 2:],
        -conditions[:, 1:2],
    )[:, 0]
    change.setflags(write=False)
    return change


@lru_cache(maxsize=16)
def shape_directions(n_weights: int) -> FloatArray:
    """Give the changes of the weights that keep a movement's ends, the smoothest first.

    All have the same mean square acceleration; the first moves the joint by 1 rad (root mean
    square), each of the others by less than the one before.

    Parameters
    ----------
    n_weights : int
        Weights per joint, at least 5.

    Returns
    -------
    array, shape (K - 4, K)
        One direction per row; of more than `besman.motion.forcing.DENSE` weights those that so
        many have, as smooth, so that a search does not depend on how fine the weights are.
    """
    if n_weights > DENSE:
        coarse = shape_directions(DENSE)
        return _as_fine(np.column_stack([np.zeros((len(coarse), 2)), coarse]), n_weights)
    basis = dmp_basis(n_weights)
    null = np.linalg.svd(rest_conditions(n_weights)[:, 2:])[2][4:].T
    moved, bent = basis.position[:, 2:] @ null, basis.acceleration[:, 2:] @ null
    # Along the principal axes of the accelerations, so that these are equal by construction.
    _, singular, right = np.linalg.svd(bent / np.sqrt(len(basis.position)), full_matrices=False)
    whitened = right.T / singular
    _, spread, axes = np.linalg.svd(
        moved @ whitened / np.sqrt(len(basis.position)), full_matrices=False
    )
    directions: FloatArray = (null @ whitened @ axes.T / spread[0]).T
    largest = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    directions *= np.sign(largest)
    directions.setflags(write=False)
    return directions


def _as_fine(coarse: FloatArray, n_weights: int) -> FloatArray:
    """Return the weights, shape (D, K), whose movements are those of coarser ones.

    `coarse`, shape (D, DENSE + 2), holds ``[start, goal, weights]`` of movements at rest at their
    ends.
    """
    x = np.linspace(0.0, 1.0, count_nodes(n_weights))
    movement, _, _ = roll_out(coarse[:, 2:], coarse[:, 0], coarse[:, 1], 1.0, x)
    weights = fit_weights(x, movement, n_weights)
    weights.setflags(write=False)
    return weights
