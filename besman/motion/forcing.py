"""The forcing term of a DMP: Gaussians of the phase, all of them or those near a place alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

ALPHA = 25.0  # spring-damper gain, as in Ijspeert 2013
BETA = ALPHA / 4.0  # critical damping
RATE = ALPHA / 2.0  # double eigenvalue of the critically damped system
LAST_PHASE = 0.01  # phase at the end of the movement
OVERLAP = 0.8  # height of a basis function at its neighbour's centre
N_NODES = 501  # quintic interpolation between them errs by less than 1e-10 of the movement

# Up to so many weights the response to each is kept at every node, above only what is near it.
DENSE = 100
# So many basis functions on either side of a place; all others together are below 1e-15 there.
_REACH = 22
# Gauss-Legendre points within a step, and their shares of the unit step.
_POINTS, _SHARES = np.polynomial.legendre.leggauss(6)


def count_nodes(n_weights: int) -> int:
    """Return how many nodes of normalised time carry a movement of so many weights.

    There are at least five for every weight, and as many for all up to `DENSE`.
    """
    return (N_NODES - 1) * max(-(-n_weights // DENSE), 1) + 1


def forcing_basis(x: npt.ArrayLike, n_weights: int) -> FloatArray:
    """Evaluate the phase-scaled, normalised Gaussians of the forcing term.

    Parameters
    ----------
    x : array, shape (...)
        Normalised time.
    n_weights : int
        Number K of basis functions, at least 2; their centres are equally spaced in time.

    Returns
    -------
    array, shape (..., K)

    References
    ----------
    Eq. 2.3 of Ijspeert 2013, see `besman.motion.dmp`.
    """
    x = np.asarray(x, dtype=np.float64)
    return _near(x, n_weights, np.arange(n_weights))


def _near(x: FloatArray, n_weights: int, which: IntArray) -> FloatArray:
    """Evaluate some of the basis functions, as if there were no others.

    `which`, shape (K,) or (..., W), are their indices.
    """
    decay = np.log(LAST_PHASE)
    phase = np.exp(decay * x)[..., None]
    centres = np.exp(decay * np.linspace(0.0, 1.0, n_weights))
    gaps = np.diff(centres)
    widths = -np.log(OVERLAP) / np.append(gaps, gaps[-1]) ** 2
    # The nearest Gaussian is scaled to 1, so that none of the sums underflows.
    exponent = -widths[which] * (phase - centres[which]) ** 2
    activation = np.exp(exponent - exponent.max(axis=-1, keepdims=True))
    basis: FloatArray = phase * activation / activation.sum(axis=-1, keepdims=True)
    return basis


def quadrature(n_nodes: int) -> tuple[FloatArray, FloatArray]:
    """Give the places within each step between nodes, and what each counts in an integral.

    Returns
    -------
    x, shares : array, shape (n_nodes - 1, 6)
        Normalised time; shares are those of the integral of exp(RATE x) times a function.
    """
    nodes = np.linspace(0.0, 1.0, n_nodes)
    step = nodes[1]
    x = nodes[:-1, None] + 0.5 * step * (_POINTS + 1.0)
    return x, 0.5 * step * _SHARES * np.exp(RATE * x)


def spring(x: FloatArray) -> FloatArray:
    """Return what start and goal force at normalised times: shape (..., 2)."""
    phase = np.exp(np.log(LAST_PHASE) * x)[..., None]
    stiffness = ALPHA * BETA
    return np.concatenate([stiffness * phase, stiffness * (1.0 - phase)], axis=-1)


def integrate(
    impulse: FloatArray, moment: FloatArray, at_nodes: FloatArray, start: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Solve the critically damped system from the integrals of what forces it.

    Its impulse response is known in closed form, so the solution is an integral.

    Parameters
    ----------
    impulse, moment : array, shape (..., N - 1, c)
        Integral of exp(RATE x) f(x), and of x exp(RATE x) f(x), over each step between nodes.
    at_nodes : array, shape (..., N, c)
        f at the nodes.
    start : array, shape (..., 1, c)
        Where the movement starts, at rest.

    Returns
    -------
    position, velocity, acceleration : array, shape (..., N, c)
        Derivatives with respect to normalised time.
    """
    nodes = np.linspace(0.0, 1.0, at_nodes.shape[-2])
    zero = np.zeros((*impulse.shape[:-2], 1, impulse.shape[-1]))
    whole = np.concatenate([zero, np.cumsum(impulse, axis=-2)], axis=-2)
    moments = np.concatenate([zero, np.cumsum(moment, axis=-2)], axis=-2)
    decay, at = np.exp(-RATE * nodes)[:, None], nodes[:, None]
    position = decay * (at * whole - moments)
    velocity = decay * whole - RATE * position
    position += decay * (1.0 + RATE * at) * start
    velocity -= decay * RATE**2 * at * start
    acceleration = at_nodes - ALPHA * BETA * position - ALPHA * velocity
    return position, velocity, acceleration


@dataclass(frozen=True)
class _LocalForcing:
    """What each step and each node knows of the weights near it.

    Attributes
    ----------
    step_weights, node_weights : int array, shape (N - 1, W) and (N, W)
        Indices of the weights.
    impulse, moment : array, shape (N - 1, W)
        Integrals over a step, as in `integrate`, of each of its basis functions.
    forcing : array, shape (N, W)
        Basis functions at the nodes.
    of_spring : tuple of three arrays, shape (N - 1, 2), (N - 1, 2) and (N, 2)
        The same of start and goal.
    """

    step_weights: IntArray
    node_weights: IntArray
    impulse: FloatArray
    moment: FloatArray
    forcing: FloatArray
    of_spring: tuple[FloatArray, FloatArray, FloatArray]


@lru_cache(maxsize=16)
def _local_forcing(n_weights: int) -> _LocalForcing:
    """Evaluate the basis functions of so many weights, each where it counts."""
    n_nodes = count_nodes(n_weights)
    nodes = np.linspace(0.0, 1.0, n_nodes)
    width = min(2 * _REACH + 1, n_weights)

    def around(x: FloatArray) -> IntArray:
        nearest = np.rint(x * (n_weights - 1)).astype(np.int64)
        first = np.clip(nearest - _REACH, 0, n_weights - width)
        return first[:, None] + np.arange(width)

    x, shares = quadrature(n_nodes)
    of_steps, of_nodes = around(0.5 * (nodes[1:] + nodes[:-1])), around(nodes)
    basis = shares[..., None] * _near(x, n_weights, of_steps[:, None, :])
    pulled = shares[..., None] * spring(x)
    return _LocalForcing(
        of_steps,
        of_nodes,
        basis.sum(axis=1),
        (x[..., None] * basis).sum(axis=1),
        _near(nodes, n_weights, of_nodes),
        (pulled.sum(axis=1), (x[..., None] * pulled).sum(axis=1), spring(nodes)),
    )


def respond_locally(
    start: FloatArray, goal: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compute movements at the nodes, in time linear in the number of weights.

    Parameters
    ----------
    start, goal : array, shape (..., 1, c)
    weights : array, shape (..., K, c)

    Returns
    -------
    position, velocity, acceleration : array, shape (..., N, c)
        As `integrate` gives them, at `count_nodes` nodes.
    """
    local = _local_forcing(weights.shape[-2])
    pulls = [part[:, :1] * start + part[:, 1:] * goal for part in local.of_spring]
    impulse, moment, forcing = pulls
    # One by one, so that a movement is the same to the last bit whatever comes with it.
    for at in range(local.impulse.shape[1]):
        near = weights[..., local.step_weights[:, at], :]
        impulse += local.impulse[:, at, None] * near
        moment += local.moment[:, at, None] * near
        forcing += local.forcing[:, at, None] * weights[..., local.node_weights[:, at], :]
    return integrate(impulse, moment, forcing, start)
