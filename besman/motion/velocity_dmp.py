r"""Joint-space DMPs that pass through their goal with a velocity, as linear maps.

With time scaled to x = t / T in [0, 1], the spring pulls towards a goal g(x) that moves along
the quintic polynomial with the wanted position and velocity at both ends and no acceleration
there:

.. math::

    y'' = \alpha (\beta (g - y) + g' - y') + g'' + s \sum_k \psi_k(s) w_k,
    \quad s = e^{-\alpha_s x}

(eq. 6 to 11 of [1]_). The movement starts on g, so it is g plus the weights' own response, which
is that of `besman.motion.dmp`: linear in start, goal, their velocities and the weights.

References
----------
.. [1] K. Muelling, J. Kober, O. Kroemer, J. Peters: Learning to select and generalize striking
   movements in robot table tennis. International Journal of Robotics Research 32 (2013),
   DOI 10.1177/0278364912472380.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from besman.motion.dmp import DmpBasis, dmp_basis, interpolate, respond
from besman.motion.dmp_fit import fit_within_conditions, rest_conditions
from besman.motion.forcing import DENSE, count_nodes

FloatArray = npt.NDArray[np.float64]

# Coefficients of 1, x, ..., x^5 of the responses to start, start velocity, goal, goal velocity.
_QUINTICS = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
    ]
)


@lru_cache(maxsize=16)
def velocity_basis(n_weights: int) -> DmpBasis:
    """Give the responses of the DMP to its unit parameters.

    Parameters
    ----------
    n_weights : int
        Weights per joint, at least 2.

    Returns
    -------
    DmpBasis
        Columns: start, start velocity times duration, goal, goal velocity times duration, and
        the weights.
    """
    weights = dmp_basis(n_weights)
    arrays = []
    responses = weights.position, weights.velocity, weights.acceleration
    for pieces, response in zip(_quintics(len(weights.position)), responses, strict=True):
        array = np.column_stack([pieces, response[:, 2:]])
        array.setflags(write=False)
        arrays.append(array)
    return DmpBasis(*arrays)


def _quintics(n_nodes: int) -> list[FloatArray]:
    """Return the responses to the ends, shape (N, 4), and their derivatives."""
    x = np.linspace(0.0, 1.0, n_nodes)
    polynomials = [np.polynomial.Polynomial(row) for row in _QUINTICS]
    return [np.column_stack([one.deriv(order)(x) for one in polynomials]) for order in range(3)]


def respond_velocity(parameters: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute movements at the nodes of normalised time.

    Parameters
    ----------
    parameters : array, shape (..., K + 4, c)
        Of each of c joints, in the order of `velocity_basis`.

    Returns
    -------
    position, velocity, acceleration : array, shape (..., N, c)
        As of `besman.motion.dmp.respond`.
    """
    n_weights = parameters.shape[-2] - 4
    if n_weights <= DENSE:
        basis = velocity_basis(n_weights)
        arrays = basis.position, basis.velocity, basis.acceleration
        return arrays[0] @ parameters, arrays[1] @ parameters, arrays[2] @ parameters
    ends, weights = parameters[..., :4, :], parameters[..., 4:, :]
    by_weights = respond(np.concatenate([np.zeros_like(ends[..., :2, :]), weights], axis=-2))
    by_ends = _quintics(count_nodes(n_weights))
    q, v, a = (piece @ ends + part for piece, part in zip(by_ends, by_weights, strict=True))
    return q, v, a


def roll_out_velocity(
    weights: npt.ArrayLike,
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    start_velocity: npt.ArrayLike,
    goal_velocity: npt.ArrayLike,
    duration: npt.ArrayLike,
    lead_in_out: npt.ArrayLike,
    time: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute the movements of one or many DMPs, from rest to rest.

    Before the primitive the arm speeds up from rest to the start's velocity, after it it slows
    down, as `besman.motion.rest_at_ends.rest_at_both_ends` says.

    Parameters
    ----------
    weights : array, shape (..., n, K)
        Weights of the forcing term.
    start, goal : array, shape (..., n)
        Of the primitive, rad.
    start_velocity, goal_velocity : array, shape (..., n)
        rad/s.
    duration : array, shape (...)
        Of the whole movement, seconds.
    lead_in_out : array, shape (..., 2)
        Seconds before the primitive's start and after its goal, part of the duration.
    time : array, shape (T,)
        Seconds from the start of the movement; afterwards the arm stands where it ended.

    Returns
    -------
    positions, velocities, accelerations : array, shape (..., T, n)
        rad, rad/s, rad/s^2.
    """
    weights, lead_in_out = (
        np.asarray(weights, dtype=np.float64),
        np.asarray(lead_in_out, dtype=np.float64),
    )
    v0, v1 = np.asarray(start_velocity)[..., None, :], np.asarray(goal_velocity)[..., None, :]
    time = np.asarray(time, dtype=np.float64)
    lead_in, lead_out = lead_in_out[..., :1], lead_in_out[..., 1:]
    scale = np.asarray(duration, dtype=np.float64)[..., None] - lead_in - lead_out
    ends = [np.asarray(start)[..., None, :], scale[..., None] * v0]
    ends += [np.asarray(goal)[..., None, :], scale[..., None] * v1]
    parameters = np.concatenate([*ends, weights.swapaxes(-1, -2)], axis=-2)
    n_weights = weights.shape[-1]
    x = (time - lead_in) / scale
    inner = np.clip(x, 0.0, 1.0)
    # As in `roll_out`: many movements of one duration ask for interpolation of the map alone.
    if x.ndim == 1 and n_weights <= DENSE and weights.size > parameters.shape[-2] * n_weights:
        basis = velocity_basis(n_weights)
        maps = interpolate(basis.position, basis.velocity, basis.acceleration, inner)
        q, v, a = (matrix @ parameters for matrix in maps)
    else:
        q, v, a = interpolate(*respond_velocity(parameters), inner)
    within = ((x >= 0.0) & (x <= 1.0))[..., None] / scale[..., None]
    v, a = v * within, a * within / scale[..., None]
    for sign, lead, since, outside, velocity in (
        (-1.0, lead_in, lead_in - time, x < 0.0, v0),
        (1.0, lead_out, time - lead_in - scale, x > 1.0, v1),
    ):
        length = np.where(lead > 0.0, lead, np.inf)
        u = np.clip(since / length, 0.0, 1.0)
        way, share, rate = _slow_down(u)
        outside = outside & (lead > 0.0)
        q = q + (sign * outside * lead * way)[..., None] * velocity
        v = v + (outside * share)[..., None] * velocity
        a = a + (sign * outside * rate / length)[..., None] * velocity
    return q, v, a


@lru_cache(maxsize=16)
def _positions_between(n_weights: int) -> FloatArray:
    """Return positions as a map of the parameters, shape (2 N - 1, K + 4), as `velocity_basis`."""
    basis = velocity_basis(n_weights)
    x = np.linspace(0.0, 1.0, 2 * len(basis.position) - 1)
    found, *_ = interpolate(basis.position, basis.velocity, basis.acceleration, x)
    found.setflags(write=False)
    return found


def split_shape(
    weights: FloatArray,
    start: FloatArray,
    goal: FloatArray,
    start_velocity: FloatArray,
    goal_velocity: FloatArray,
    duration: float,
) -> tuple[FloatArray, FloatArray]:
    """Compute what a movement would be without weights, and what these add to it.

    Parameters
    ----------
    weights : array, shape (n, K)
    start, goal : array, shape (n,)
        rad.
    start_velocity, goal_velocity : array, shape (n,)
        rad/s.
    duration : float
        Seconds, without lead-in and lead-out.

    Returns
    -------
    rest, shape : array, shape (2 N - 1, n)
        rad, whose sum is the movement, at its N nodes and in the middle between them.
    """
    ends = np.stack([start, duration * start_velocity, goal, duration * goal_velocity])
    n_weights = weights.shape[1]
    if n_weights <= DENSE:
        matrix = _positions_between(n_weights)
        return matrix[:, :4] @ ends, matrix[:, 4:] @ weights.T
    x = np.linspace(0.0, 1.0, 2 * count_nodes(n_weights) - 1)
    rest, shape = (
        interpolate(*respond_velocity(parameters), x)[0]
        for parameters in (
            np.concatenate([ends, np.zeros_like(weights.T)]),
            np.concatenate([np.zeros_like(ends), weights.T]),
        )
    )
    return rest, shape


def _slow_down(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return way, velocity and acceleration of a unit velocity that vanishes from u = 0 to 1."""
    return u - u**3 + u**4 / 2.0, 1.0 - 3.0 * u**2 + 2.0 * u**3, 6.0 * u * (u - 1.0)


def fit_velocity_weights(
    time: npt.ArrayLike,
    positions: npt.ArrayLike,
    start_velocity: npt.ArrayLike,
    goal_velocity: npt.ArrayLike,
    n_weights: int,
) -> FloatArray:
    """Fit the weights to a trajectory by least squares between trajectories.

    The DMP has the trajectory's position and the given velocities at both ends, and no
    acceleration there, as the lead-in and lead-out have none.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds from 0, rising.
    positions : array, shape (T, n)
        rad.
    start_velocity, goal_velocity : array, shape (n,)
        rad/s.
    n_weights : int
        Weights per joint, at least 5.

    Returns
    -------
    array, shape (n, K)
    """
    time, positions = np.asarray(time, dtype=np.float64), np.asarray(positions, dtype=np.float64)
    duration = time[-1]
    units = respond_velocity(np.eye(n_weights + 4))
    response, _, _ = interpolate(*units, np.clip(time / duration, 0.0, 1.0))
    ends = np.stack(
        [
            positions[0],
            duration * np.asarray(start_velocity),
            positions[-1],
            duration * np.asarray(goal_velocity),
        ]
    )
    conditions = rest_conditions(n_weights)[:, 2:]
    return fit_within_conditions(
        response[:, 4:],
        positions - response[:, :4] @ ends,
        conditions,
        np.zeros((len(conditions), positions.shape[1])),
    ).T
