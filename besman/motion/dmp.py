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

FloatArray = npt.NDArray[np.float64]

ALPHA = 25.0  # spring-damper gain, as in [1]
BETA = ALPHA / 4.0  # critical damping
LAST_PHASE = 0.01  # phase at the end of the movement
OVERLAP = 0.8  # height of a basis function at its neighbour's centre
N_NODES = 501  # quintic interpolation between them errs by less than 1e-10 of the movement
_RIDGE = 1e-10  # relative to the largest eigenvalue


@dataclass(frozen=True)
class DmpBasis:
    """The linear map of a DMP on a grid of normalised time.

    Attributes
    ----------
    position, velocity, acceleration : array, shape (N_NODES, K + 2)
        Response to ``[start, goal, weights]`` and its first and second derivative with respect
        to normalised time, at `N_NODES` equal steps from 0 to 1.
    """

    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


def forcing_basis(x: npt.ArrayLike, n_weights: int) -> FloatArray:
    """Evaluate the phase-scaled, normalised Gaussians of the forcing term (eq. 2.3 of [1]).

    Parameters
    ----------
    x : array, shape (...)
        Normalised time.
    n_weights : int
        Number K of basis functions, at least 2; their centres are equally spaced in time.

    Returns
    -------
    array, shape (..., K)
    """
    decay = np.log(LAST_PHASE)
    phase = np.exp(decay * np.asarray(x, dtype=np.float64))[..., None]
    centres = np.exp(decay * np.linspace(0.0, 1.0, n_weights))
    gaps = np.diff(centres)
    widths = -np.log(OVERLAP) / np.append(gaps, gaps[-1]) ** 2
    # The nearest Gaussian is scaled to 1, so that none of the sums underflows.
    exponent = -widths * (phase - centres) ** 2
    activation = np.exp(exponent - exponent.max(axis=-1, keepdims=True))
    basis: FloatArray = phase * activation / activation.sum(axis=-1, keepdims=True)
    return basis


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
    nodes = np.linspace(0.0, 1.0, N_NODES)
    rate = ALPHA / 2.0  # double eigenvalue of the critically damped system

    def forcing(x: FloatArray) -> FloatArray:
        phase = np.exp(np.log(LAST_PHASE) * x)[..., None]
        stiffness = ALPHA * BETA
        return np.concatenate(
            [stiffness * phase, stiffness * (1.0 - phase), forcing_basis(x, n_weights)], axis=-1
        )

    points, shares = np.polynomial.legendre.leggauss(6)
    step = nodes[1]
    x = nodes[:-1, None] + 0.5 * step * (points + 1.0)
    weighted = (0.5 * step * shares * np.exp(rate * x))[..., None] * forcing(x)
    zero = np.zeros((1, n_weights + 2))
    integral = np.concatenate([zero, np.cumsum(weighted.sum(axis=1), axis=0)])
    moment = np.concatenate([zero, np.cumsum((x[..., None] * weighted).sum(axis=1), axis=0)])
    decay, at = np.exp(-rate * nodes)[:, None], nodes[:, None]
    position = decay * (at * integral - moment)
    velocity = decay * integral - rate * position
    position[:, :1] += decay * (1.0 + rate * at)
    velocity[:, :1] -= decay * rate**2 * at
    acceleration = forcing(nodes) - ALPHA * BETA * position - ALPHA * velocity
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
    basis = dmp_basis(weights.shape[-1])
    scale = np.asarray(duration, dtype=np.float64)[..., None]
    normalised = np.asarray(time, dtype=np.float64) / scale
    x = np.clip(normalised, 0.0, 1.0)
    # Durations of their own ask for interpolation of every movement; one for all, of the map.
    if scale.ndim == 1:
        maps = interpolate(basis.position, basis.velocity, basis.acceleration, x)
        position, velocity, acceleration = (matrix @ parameters for matrix in maps)
    else:
        position, velocity, acceleration = interpolate(
            basis.position @ parameters,
            basis.velocity @ parameters,
            basis.acceleration @ parameters,
            x,
        )
    moving = (normalised <= 1.0)[..., None] / scale[..., None]
    return position, velocity * moving, acceleration * moving / scale[..., None]


def interpolate(
    position: FloatArray, velocity: FloatArray, acceleration: FloatArray, x: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Interpolate between nodes by quintic Hermite polynomials.

    Parameters
    ----------
    position, velocity, acceleration : array, shape (..., N_NODES, c)
        Values and derivatives with respect to x at `N_NODES` equal steps from 0 to 1.
    x : array, shape (..., T)
        Where, 0 to 1.

    Returns
    -------
    tuple of three arrays, shape (..., T, c)
        Value, first and second derivative.
    """
    step = 1.0 / (N_NODES - 1)
    before = np.minimum((x / step).astype(np.int64), N_NODES - 2)
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


def rest_conditions(n_weights: int) -> FloatArray:
    """Give the rows that vanish for a DMP that starts and ends at rest, at its goal.

    Returns
    -------
    array, shape (4, K + 2)
        Times ``[start, goal, weights]``: acceleration at the start; distance to the goal,
        velocity and acceleration at the end.
    """
    basis = dmp_basis(n_weights)
    miss = basis.position[-1].copy()
    miss[1] -= 1.0
    return np.stack([basis.acceleration[0], miss, basis.velocity[-1], basis.acceleration[-1]])


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
    return constrained_least_squares(
        response[:, 2:], residual, conditions[:, 2:], -conditions[:, :2] @ ends
    ).T


def constrained_least_squares(
    matrix: FloatArray, target: FloatArray, constraint: FloatArray, value: FloatArray
) -> FloatArray:
    """Minimise ``|matrix w - target|^2`` with a tiny ridge, subject to constraint w = value."""
    left, singular, right = np.linalg.svd(constraint)
    rank = len(singular)
    particular = right[:rank].T @ ((left.T @ value) / singular[:, None])
    null = right[rank:].T
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
        One direction per row.
    """
    basis = dmp_basis(n_weights)
    null = np.linalg.svd(rest_conditions(n_weights)[:, 2:])[2][4:].T
    moved, bent = basis.position[:, 2:] @ null, basis.acceleration[:, 2:] @ null
    # Along the principal axes of the accelerations, so that these are equal by construction.
    _, singular, right = np.linalg.svd(bent / np.sqrt(N_NODES), full_matrices=False)
    whitened = right.T / singular
    _, spread, axes = np.linalg.svd(moved @ whitened / np.sqrt(N_NODES), full_matrices=False)
    directions: FloatArray = (null @ whitened @ axes.T / spread[0]).T
    largest = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    directions *= np.sign(largest)
    directions.setflags(write=False)
    return directions
