r"""Joint-space dynamical movement primitives (DMPs) as linear maps.

For one joint, with time scaled to x = t / T in [0, 1] and ' = d/dx, the transformation system is

.. math::

    y'' = \alpha (\beta (g - y) - y') - \alpha \beta (g - y_0) s + s \sum_k \psi_k(s) w_k,
    \quad s = e^{-\alpha_s x},

critically damped by beta = alpha / 4: eq. 2.1 to 2.3 of Ijspeert 2013 with the forcing term of
Pastor 2009, which does not jump when the goal moves and is linear in start, goal and weights.
So is its solution: position, velocity and acceleration are fixed matrices times
``[start, goal, weights]``, the same for every duration T (velocity / T, acceleration / T^2).

References
----------
.. [1] A. J. Ijspeert, J. Nakanishi, H. Hoffmann, P. Pastor, S. Schaal: Dynamical Movement
   Primitives: Learning Attractor Models for Motor Behaviors. Neural Computation 25 (2013),
   DOI 10.1162/NECO_a_00393.
.. [2] P. Pastor, H. Hoffmann, T. Asfour, S. Schaal: Learning and Generalization of Motor Skills
   by Learning from Demonstration. ICRA 2009, eq. 5, DOI 10.1109/ROBOT.2009.5152385.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from besman.motion.forcing import (
    DENSE,
    count_nodes,
    forcing_basis,
    integrate,
    quadrature,
    respond_locally,
    spring,
)

FloatArray = npt.NDArray[np.float64]

# Samples that are interpolated at a time.
_BLOCK = 1024


@dataclass(frozen=True)
class DmpBasis:
    """The linear map of a DMP on a grid of normalised time.

    Attributes
    ----------
    position, velocity, acceleration : array, shape (N, K + 2)
        Response to ``[start, goal, weights]`` and its first and second derivative with respect
        to normalised time, at N equal steps from 0 to 1, see `besman.motion.forcing.count_nodes`.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


@lru_cache(maxsize=16)
def dmp_basis(n_weights: int) -> DmpBasis:
    """Solve the transformation system for every unit parameter.

    The impulse response of the critically damped system is known in closed form, so the solution
    is an integral, computed by Gauss-Legendre quadrature to machine precision.

    Parameters
    ----------
    n_weights : int
        Weights per joint, at least 2.

    Returns
    -------
    DmpBasis
        Read-only arrays.
    """
    n_nodes = count_nodes(n_weights)

    def forcing(x: FloatArray) -> FloatArray:
        return np.concatenate([spring(x), forcing_basis(x, n_weights)], axis=-1)

    x, shares = quadrature(n_nodes)
    weighted = shares[..., None] * forcing(x)
    position, velocity, acceleration = integrate(
        weighted.sum(axis=1),
        (x[..., None] * weighted).sum(axis=1),
        forcing(np.linspace(0.0, 1.0, n_nodes)),
        np.eye(n_weights + 2)[:1],
    )
    for array in (position, velocity, acceleration):
        array.setflags(write=False)
    return DmpBasis(position, velocity, acceleration)


def roll_out(
    weights: npt.ArrayLike,
    start: npt.ArrayLike,
    goal: npt.ArrayLike,
    duration: npt.ArrayLike,
    time: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute the movements of one or many DMPs.

    Parameters
    ----------
    weights : array, shape (..., n, K)
        Weights of the forcing term.
    start, goal : array, shape (..., n)
        rad.
    duration : array, shape (...)
        Seconds.
    time : array, shape (T,)
        Seconds from the start; after the duration the arm stands where the movement ended.

    Returns
    -------
    positions, velocities, accelerations : array, shape (..., T, n)
        rad, rad/s, rad/s^2.
    """
    weights = np.asarray(weights, dtype=np.float64)
    parameters = np.concatenate(
        [np.asarray(start)[..., None], np.asarray(goal)[..., None], weights], axis=-1
    ).swapaxes(-1, -2)
    n_weights = weights.shape[-1]
    scale = np.asarray(duration, dtype=np.float64)[..., None]
    normalised = np.asarray(time, dtype=np.float64) / scale
    x = np.clip(normalised, 0.0, 1.0)
    # Many movements of one duration ask for interpolation of the map, others of every movement.
    if scale.ndim == 1 and n_weights <= DENSE and weights.size > parameters.shape[-2] * n_weights:
        basis = dmp_basis(n_weights)
        maps = interpolate(basis.position, basis.velocity, basis.acceleration, x)
        position, velocity, acceleration = (matrix @ parameters for matrix in maps)
    else:
        position, velocity, acceleration = interpolate(*respond(parameters), x)
    moving = (normalised <= 1.0)[..., None] / scale[..., None]
    return position, velocity * moving, acceleration * moving / scale[..., None]


def respond(parameters: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute movements at the nodes of normalised time.

    Parameters
    ----------
    parameters : array, shape (..., K + 2, c)
        ``[start, goal, weights]`` of each of c joints.

    Returns
    -------
    position, velocity, acceleration : array, shape (..., N, c)
        Derivatives with respect to normalised time, at `besman.motion.forcing.count_nodes` nodes.
    """
    n_weights = parameters.shape[-2] - 2
    if n_weights > DENSE:
        start, goal, weights = np.split(parameters, [1, 2], axis=-2)
        return respond_locally(start, goal, weights)
    basis = dmp_basis(n_weights)
    return basis.position @ parameters, basis.velocity @ parameters, basis.acceleration @ parameters


def interpolate(
    position: FloatArray, velocity: FloatArray, acceleration: FloatArray, x: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Interpolate between nodes by quintic Hermite polynomials.

    Parameters
    ----------
    position, velocity, acceleration : array, shape (..., N, c)
        Values and derivatives with respect to x at N equal steps from 0 to 1.
    x : array, shape (..., T)
        Where, 0 to 1.

    Returns
    -------
    tuple of three arrays, shape (..., T, c)
        Value, first and second derivative.
    """
    # Many movements may share their places.
    x = x[(None,) * (position.ndim - 1 - x.ndim)]
    n_samples = x.shape[-1]
    if n_samples <= _BLOCK:
        return _interpolate(position, velocity, acceleration, x)
    shape = (*np.broadcast_shapes(position.shape[:-2], x.shape[:-1]), n_samples, position.shape[-1])
    found = np.empty(shape), np.empty(shape), np.empty(shape)
    # What is worked on stays in the cache, so that the time is linear in the samples.
    for first in range(0, n_samples, _BLOCK):
        rows = slice(first, first + _BLOCK)
        block = _interpolate(position, velocity, acceleration, x[..., rows])
        for whole, part in zip(found, block, strict=True):
            whole[..., rows, :] = part
    return found


def _interpolate(
    position: FloatArray, velocity: FloatArray, acceleration: FloatArray, x: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Interpolate at so few places that all fits into the cache."""
    n_nodes = position.shape[-2]
    step = 1.0 / (n_nodes - 1)
    before = np.minimum((x / step).astype(np.int64), n_nodes - 2)
    u = (x / step - before)[..., None]
    index = np.stack([before, before + 1])[..., None]
    p0, p1 = (np.take_along_axis(position, at, axis=-2) for at in index)
    v0, v1 = (np.take_along_axis(velocity, at, axis=-2) * step for at in index)
    a0, a1 = (np.take_along_axis(acceleration, at, axis=-2) * (0.5 * step**2) for at in index)
    # Coefficients of u^3 to u^5 from what is missing at u = 1.
    gap, slope, bend = p1 - p0 - v0 - a0, v1 - v0 - 2.0 * a0, a1 - a0
    c3 = 10.0 * gap - 4.0 * slope + bend
    c4 = -15.0 * gap + 7.0 * slope - 2.0 * bend
    c5 = 6.0 * gap - 3.0 * slope + bend
    y = p0 + u * (v0 + u * (a0 + u * (c3 + u * (c4 + u * c5))))
    dy = v0 + u * (2.0 * a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))
    ddy = 2.0 * a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))
    return y, dy / step, ddy / step**2
