"""The compiled sums over all segmentations, see `besman.stages.segment.vmci.weigh_borders`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from besman.stages.segment.vmci_kernel import BLOCK, evaluate_block

FloatArray = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def run_forward_backward(
    paths: FloatArray,
    padded: FloatArray,
    factor: FloatArray,
    n_centres: int,
    bell_width: float,
    weight_variance: float,
    speed_weight_variance: float,
    noise_scale: float,
    nu_position: float,
    nu_speed: float,
) -> tuple[FloatArray, FloatArray]:  # pragma: no cover
    """Sum over all segmentations, from both ends.

    The arguments are those of `besman.stages.segment.vmci_kernel.run_viterbi`.

    Only one block of evidence is held at a time: the backward pass evaluates it again.

    Returns
    -------
    forward : array, shape (T + 1,)
        Log of the joint probability of the first t samples and a border behind them.
    backward : array, shape (T + 1,)
        Log-probability of the samples from t on, given a border before them.
    """
    longest = factor.shape[0] - 1
    n_samples = paths.shape[1] - longest
    block = min(BLOCK, n_samples)
    evidence = np.empty((block, longest + 1))
    forward = np.full(n_samples + 1, -np.inf)
    forward[0] = -math.log(n_centres)
    backward = np.full(n_samples + 1, -np.inf)
    backward[n_samples] = 0.0
    summed = np.zeros(n_samples + 1)
    firsts = np.arange(0, n_samples, block)
    for turn in range(2 * len(firsts)):
        forwards = turn < len(firsts)
        first = firsts[turn] if forwards else firsts[2 * len(firsts) - 1 - turn]
        width = min(block, n_samples - first)
        evaluate_block(
            paths,
            padded,
            first,
            width,
            factor,
            n_centres,
            bell_width,
            weight_variance,
            speed_weight_variance,
            noise_scale,
            nu_position,
            nu_speed,
            True,
            evidence,
        )
        for step in range(width):
            b = step if forwards else width - 1 - step
            end = first + 1 + b
            longest_here = min(longest, end)
            if forwards:
                _gather_starts(forward, evidence[b], end, longest_here)
            else:
                _scatter_end(backward, summed, evidence[b], end, longest_here)
    backward[0] += math.log(summed[0])
    return forward, backward


@njit(cache=True, nogil=True)
def _gather_starts(
    forward: FloatArray, evidence: FloatArray, end: int, longest: int
) -> None:  # pragma: no cover
    """Sum over the starts of the segments that end before sample `end`."""
    highest = -np.inf
    for n in range(1, longest + 1):
        highest = max(highest, forward[end - n] + evidence[n])
    if highest > -np.inf:
        total = 0.0
        for n in range(1, longest + 1):
            total += math.exp(forward[end - n] + evidence[n] - highest)
        forward[end] = highest + math.log(total)


@njit(cache=True, nogil=True)
def _scatter_end(
    backward: FloatArray, summed: FloatArray, evidence: FloatArray, end: int, longest: int
) -> None:  # pragma: no cover
    """Add the segments that end before sample `end` to the sums of their starts.

    While a sum is open, `backward` holds its greatest term and `summed` the sum over it.
    """
    if summed[end] > 0.0:
        backward[end] += math.log(summed[end])
    if backward[end] == -np.inf:
        return
    for n in range(1, longest + 1):
        start = end - n
        value = evidence[n] + backward[end]
        if value > backward[start]:
            summed[start] = summed[start] * math.exp(backward[start] - value) + 1.0
            backward[start] = value
        elif value > -np.inf:
            summed[start] += math.exp(value - backward[start])
