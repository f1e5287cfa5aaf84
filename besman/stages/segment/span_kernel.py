"""The compiled evidence of chosen segments; see `besman.stages.segment.valley_vmci`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from besman.stages.segment.vmci_kernel import log_determinant, shape_bell

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def evaluate_spans(
    speeds: FloatArray,
    starts: IntArray,
    ends: IntArray,
    factor: FloatArray,
    n_centres: int,
    bell_width: float,
    speed_weight_variance: float,
    noise_scale: float,
    nu: float,
) -> FloatArray:  # pragma: no cover
    """Evaluate the log-evidence of the speed between chosen samples, eq. (A.17).

    Parameters
    ----------
    speeds : array, shape (s, T)
        Scaled.
    starts, ends : int array, shape (V,)
        Segment (i, j) holds the samples starts[i] to ends[j] - 1. Both rise.
    factor : array, shape (L + 1,)
        See `besman.stages.segment.vmci.tabulate_lengths`.
    n_centres, bell_width, speed_weight_variance, noise_scale
        See `besman.stages.segment.vmci.VmciModel`.
    nu : float
        Degrees of freedom of the noise.

    Returns
    -------
    array, shape (V, V)
        -inf where j <= i, or the segment is shorter than two samples or too long.
    """
    n_spans = len(starts)
    longest = factor.shape[0] - 1
    bell = np.empty(longest)
    evidence = np.full((n_spans, n_spans), -np.inf)
    for i in range(n_spans - 1):
        for j in range(i + 1, n_spans):
            n = ends[j] - starts[i]
            if n > longest:
                break
            if n >= 2:
                evidence[i, j] = factor[n] + _evaluate_bells(
                    speeds[:, starts[i] : ends[j]],
                    bell,
                    n_centres,
                    bell_width,
                    speed_weight_variance,
                    noise_scale,
                    nu,
                )
    return evidence


@njit(cache=True, nogil=True)
def _evaluate_bells(
    speeds: FloatArray,
    bell: FloatArray,
    n_centres: int,
    bell_width: float,
    variance: float,
    noise_scale: float,
    nu: float,
) -> float:  # pragma: no cover
    """Evaluate the best bell of one segment; a bell may not hang down."""
    n_sensors, n = speeds.shape
    noise = np.empty((n_sensors, n_sensors))
    products = np.empty(n_sensors)
    sums = np.empty(n_sensors)
    for m in range(n_sensors):
        sums[m] = speeds[m].sum()
    best = -np.inf
    for c in range(n_centres):
        total, total_squares = shape_bell(bell, n, (c + 1) / (n_centres + 1), bell_width)
        a = total_squares + 1.0 / variance
        e = n + 1.0 / variance
        determinant = a * e - total * total
        hangs = False
        for m in range(n_sensors):
            products[m] = 0.0
            for i in range(n):
                products[m] += bell[i] * speeds[m, i]
            height = e * products[m] - total * sums[m]
            level = a * sums[m] - total * products[m]
            hangs = hangs or height < 0.0
            for other in range(m + 1):
                square = 0.0
                for i in range(n):
                    square += speeds[m, i] * speeds[other, i]
                explained = (height * products[other] + level * sums[other]) / determinant
                noise[m, other] = square - explained
            noise[m, m] += noise_scale
        if not hangs:
            value = -0.5 * n_sensors * math.log(determinant)
            value -= 0.5 * (n + nu) * log_determinant(noise)
            best = max(best, value)
    return best
