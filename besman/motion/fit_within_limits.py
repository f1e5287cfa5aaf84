"""Weights of a DMP that follows a trajectory as closely as the limits of an arm allow."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.motion.dmp import respond, roll_out
from besman.motion.dmp_fit import rest_conditions, solutions
from besman.motion.forcing import LAST_PHASE

FloatArray = npt.NDArray[np.float64]

# Passes of the method of multipliers, and how far beyond a limit is none.
_PASSES, _BEYOND = 400, 1e-3


def fit_within_limits(
    time: npt.ArrayLike,
    positions: npt.ArrayLike,
    n_weights: int,
    velocity: FloatArray,
    acceleration: FloatArray,
) -> FloatArray:
    """Fit a DMP to a trajectory by least squares, its velocities and accelerations within limits.

    Solved by the alternating direction method of multipliers [1]_, section 5.2, for all joints at
    once.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds from 0, rising.
    positions : array, shape (T, n)
        rad.
    n_weights : int
        Weights per joint, at least 5.
    velocity, acceleration : array, shape (n,)
        Greatest, rad/s and rad/s^2; kept at the nodes of the DMP's solution, as far as that can be
        together with rest at both ends.

    Returns
    -------
    array, shape (n, K)

    References
    ----------
    .. [1] S. Boyd et al.: Distributed optimization and statistical learning via the alternating
       direction method of multipliers. Foundations and Trends in Machine Learning 3(1), 2011, DOI
       10.1561/2200000016.
    """
    time, positions = np.asarray(time, dtype=np.float64), np.asarray(positions, dtype=np.float64)
    duration, identity = float(time[-1]), np.eye(n_weights + 2)
    response, _, _ = roll_out(identity[:, 2:], identity[:, 0], identity[:, 1], duration, time)
    _, speed, pull = respond(identity)
    # Rates in shares of a limit, one limit after the other: (2 N, K + 2) and (2 N, n).
    rates = np.concatenate([speed / duration, pull / duration**2])
    most = np.repeat(np.stack([velocity, acceleration]), len(speed), axis=0)
    ends = np.stack([positions[0], positions[-1]])
    conditions = rest_conditions(n_weights)
    scale = LAST_PHASE ** -np.linspace(0.0, 1.0, n_weights)
    particular, null = solutions(conditions[:, 2:] * scale, -conditions[:, :2] @ ends)
    fixed, free = scale[:, None] * particular, scale[:, None] * null
    wanted = positions - response[:, :2] @ ends - response[:, 2:] @ fixed
    given = rates[:, :2] @ ends + rates[:, 2:] @ fixed
    found = _solve(response[:, 2:] @ free, wanted, rates[:, 2:] @ free, given, most)
    weights: FloatArray = (fixed + free @ found).T
    return weights


def _solve(
    matrix: FloatArray, wanted: FloatArray, rates: FloatArray, given: FloatArray, most: FloatArray
) -> FloatArray:
    """Minimise ``|matrix z - wanted|^2`` where ``|rates z + given| <= most``, for every column."""
    found = np.empty((matrix.shape[1], wanted.shape[1]))
    for joint in range(wanted.shape[1]):
        limit = most[:, joint]
        rows, offset = rates / limit[:, None], given[:, joint] / limit
        found[:, joint] = _solve_one(matrix, wanted[:, joint], rows, offset)
    return found


def _solve_one(
    matrix: FloatArray, wanted: FloatArray, rows: FloatArray, offset: FloatArray
) -> FloatArray:
    """Minimise ``|matrix z - wanted|^2`` where ``|rows z + offset| <= 1``."""
    # In the coordinates in which the rows are orthonormal all multipliers are of one kind.
    left, singular, right = np.linalg.svd(rows, full_matrices=False)
    matrix = matrix @ (right.T / singular)
    gram = matrix.T @ matrix
    weight = float(np.trace(gram)) / len(gram)
    system, pulled = np.linalg.inv(gram + weight * np.eye(len(gram))), matrix.T @ wanted
    point = np.linalg.lstsq(matrix, wanted, rcond=None)[0]
    multipliers = np.zeros(len(rows))
    for _ in range(_PASSES):
        share = left @ point + offset
        kept = np.clip(share + multipliers, -1.0, 1.0)
        multipliers += share - kept
        if np.abs(share).max() <= 1.0 + _BEYOND:
            break
        point = system @ (pulled + weight * (left.T @ (kept - multipliers - offset)))
    return np.asarray((right.T / singular) @ point)
