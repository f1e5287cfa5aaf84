"""Forward filtering and backward sampling of hidden states, compiled."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def filter_states(
    log_likelihood: FloatArray, weights: FloatArray, active: IntArray, filtered: FloatArray
) -> float:  # pragma: no cover
    """Filter forwards over the active states; the first state is any of them.

    Parameters
    ----------
    log_likelihood : array, shape (T, K)
        Of every sample in every state.
    weights : array, shape (K, K)
        Transition weights; rows are normalised over the active states.
    active : int array, shape (a,)
        States that may occur.
    filtered : array, shape (T, a)
        Filled with the probability of every active state given the samples up to it.

    Returns
    -------
    float
        Log-probability of all samples, -inf without an active state.
    """
    a = active.shape[0]
    if a == 0:
        return -math.inf
    transition = np.empty((a, a))
    for j in range(a):
        total = 0.0
        for k in range(a):
            transition[j, k] = weights[active[j], active[k]]
            total += transition[j, k]
        for k in range(a):
            transition[j, k] /= total
    result = 0.0
    for t in range(log_likelihood.shape[0]):
        highest = -math.inf
        for k in range(a):
            highest = max(highest, log_likelihood[t, active[k]])
        total = 0.0
        for k in range(a):
            predicted = 1.0 / a
            if t > 0:
                predicted = 0.0
                for j in range(a):
                    predicted += filtered[t - 1, j] * transition[j, k]
            value = predicted * math.exp(log_likelihood[t, active[k]] - highest)
            filtered[t, k] = value
            total += value
        # The likeliest state may be out of reach so far that nothing is left.
        if total < 1e-300:
            return -math.inf
        for k in range(a):
            filtered[t, k] /= total
        result += highest + math.log(total)
    return result


@njit(cache=True, nogil=True)
def draw_states(
    weights: FloatArray, active: IntArray, filtered: FloatArray, uniform: FloatArray
) -> IntArray:  # pragma: no cover
    """Draw a sequence of states backwards.

    Parameters
    ----------
    weights, active, filtered
        As in `filter_states`, which has filled `filtered`.
    uniform : array, shape (T,)
        Random numbers between 0 and 1.

    Returns
    -------
    int array, shape (T,)
        States.
    """
    n_samples, a = filtered.shape
    states = np.empty(n_samples, dtype=np.int64)
    totals = np.zeros(a)
    for j in range(a):
        for k in range(a):
            totals[j] += weights[active[j], active[k]]
    share = np.empty(a)
    following = -1
    for t in range(n_samples - 1, -1, -1):
        total = 0.0
        for j in range(a):
            share[j] = filtered[t, j]
            if following >= 0:
                share[j] *= weights[active[j], active[following]] / totals[j]
            total += share[j]
        left = uniform[t] * total
        chosen = a - 1
        for j in range(a):
            left -= share[j]
            if left < 0.0:
                chosen = j
                break
        states[t] = active[chosen]
        following = chosen
    return states
