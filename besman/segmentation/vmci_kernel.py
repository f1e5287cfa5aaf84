"""The compiled recursion of `besman.segmentation.vmci`; its oracle is `vmci_plain`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]

# Ends that are worked on together: long enough to share a bell, short enough for the cache.
_BLOCK = 512


@njit(cache=True, nogil=True)
def run_viterbi(
    positions: FloatArray,
    padded: FloatArray,
    factor: FloatArray,
    n_centres: int,
    bell_width: float,
    weight_variance: float,
    speed_weight_variance: float,
    noise_scale: float,
    nu_position: float,
    nu_speed: float,
) -> tuple[FloatArray, npt.NDArray[np.int64]]:  # pragma: no cover
    """Run the recursion of eq. (4.7) and (4.8) in the log domain.

    Parameters
    ----------
    positions : array, shape (T, d)
        Scaled positions.
    padded : array, shape (s, L + T)
        Scaled speeds after L zeros, one row for each sensor, so that windows that reach beyond the
        first sample need no case of their own.
    factor : array, shape (L + 1,)
        What depends on nothing but the length of a segment, see `besman.segmentation.vmci`; L is
        the longest.
    n_centres, bell_width, weight_variance, speed_weight_variance, noise_scale
        See `besman.segmentation.vmci.VmciModel`.
    nu_position, nu_speed : float
        Degrees of freedom of the noise of positions and speeds.

    Returns
    -------
    best : array, shape (T + 1,)
        Log-probability of the best segmentation of the first t samples.
    previous : int array, shape (T + 1,)
        Start of its last segment.
    """
    n_samples, d = positions.shape
    longest = factor.shape[0] - 1
    block = min(_BLOCK, n_samples)
    evidence = np.empty((block, longest + 1))
    root = np.empty((2 * d, 2 * d))
    row = np.empty(2 * d)
    best = np.full(n_samples + 1, -np.inf)
    best[0] = -math.log(n_centres)
    previous = np.zeros(n_samples + 1, dtype=np.int64)
    for first in range(0, n_samples, block):
        width = min(block, n_samples - first)
        _speed_evidence(
            padded,
            first,
            width,
            longest,
            n_centres,
            bell_width,
            speed_weight_variance,
            noise_scale,
            nu_speed,
            evidence,
        )
        for b in range(width):
            end = first + 1 + b
            start_root(root, weight_variance, noise_scale)
            best[end], previous[end] = _search_starts(
                positions, end, best, factor, evidence[b], nu_position, root, row
            )
    return best, previous


@njit(cache=True, nogil=True)
def _search_starts(
    positions: FloatArray,
    end: int,
    best: FloatArray,
    factor: FloatArray,
    speed_evidence: FloatArray,
    nu: float,
    root: FloatArray,
    row: FloatArray,
) -> tuple[float, int]:  # pragma: no cover
    """Find the most probable start of a segment that ends before sample `end`, eq. (4.8).

    The start moves backwards, so that each segment is the one before and one sample more.
    """
    d = positions.shape[1]
    highest, at = -math.inf, 0
    for n in range(1, min(factor.shape[0] - 1, end) + 1):
        start = end - n
        for k in range(d):
            row[k] = positions[max(start - 1, 0), k]
            row[d + k] = positions[start, k]
        rotate_into(root, row)
        weights = 1.0
        noise = 1.0
        for k in range(d):
            weights *= root[k, k]
            noise *= root[d + k, d + k]
        value = best[start] + factor[n] + speed_evidence[n]
        value -= d * math.log(weights) + (n + nu) * math.log(noise)
        if value > highest:
            highest, at = value, start
    return highest, at


@njit(cache=True, nogil=True)
def start_root(
    root: FloatArray, weight_variance: float, noise_scale: float
) -> None:  # pragma: no cover
    """Start the triangular root of [H Y]'[H Y] + diag(1/D, S) from the prior alone."""
    d = root.shape[0] // 2
    for i in range(2 * d):
        for k in range(2 * d):
            root[i, k] = 0.0
    for k in range(d):
        root[k, k] = 1.0 / math.sqrt(weight_variance)
        root[d + k, d + k] = math.sqrt(noise_scale)


@njit(cache=True, nogil=True)
def rotate_into(root: FloatArray, row: FloatArray) -> None:  # pragma: no cover
    """Add one sample to the triangular root by Givens rotations.

    The upper left triangle is then the root of M^-1, the lower right one the root of Y'PY + S:
    the evidence needs only their diagonals, and nothing large is ever subtracted.
    """
    size = root.shape[0]
    for i in range(size):
        length = math.sqrt(root[i, i] * root[i, i] + row[i] * row[i])
        cosine = root[i, i] / length
        sine = row[i] / length
        root[i, i] = length
        for k in range(i + 1, size):
            rotated = cosine * root[i, k] + sine * row[k]
            row[k] = cosine * row[k] - sine * root[i, k]
            root[i, k] = rotated


@njit(cache=True, nogil=True)
def _speed_evidence(
    padded: FloatArray,
    first: int,
    width: int,
    longest: int,
    n_centres: int,
    bell_width: float,
    variance: float,
    noise_scale: float,
    nu: float,
    evidence: FloatArray,
) -> None:  # pragma: no cover
    """Fill the best log-evidence over the centres, eq. (A.17), for a block of ends.

    ``evidence[b, n]`` belongs to the n samples before sample ``first + 1 + b``.
    """
    n_sensors = padded.shape[0]
    sums = np.zeros((n_sensors, width))
    squares = np.zeros((n_sensors, n_sensors, width))
    products = np.empty((n_sensors, width))
    bell = np.empty(longest)
    noise = np.empty((n_sensors, n_sensors))
    for n in range(1, min(longest, first + width) + 1):
        at = longest + first + 1 - n
        for m in range(n_sensors):
            for b in range(width):
                sums[m, b] += padded[m, at + b]
            for other in range(m + 1):
                for b in range(width):
                    squares[m, other, b] += padded[m, at + b] * padded[other, at + b]
        for b in range(width):
            evidence[b, n] = -np.inf if n_sensors else 0.0
        for c in range(n_centres if n_sensors else 0):
            total, total_squares = shape_bell(bell, n, (c + 1) / (n_centres + 1), bell_width)
            for m in range(n_sensors):
                _correlate(padded[m], at, bell, n, products[m])
            a = total_squares + 1.0 / variance
            e = n + 1.0 / variance
            determinant = a * e - total * total
            for b in range(width):
                hangs = False
                for m in range(n_sensors):
                    height = e * products[m, b] - total * sums[m, b]
                    hangs = hangs or height < 0.0
                    for other in range(m + 1):
                        p = products[other, b]
                        q = sums[other, b]
                        level = a * sums[m, b] - total * products[m, b]
                        noise[m, other] = (
                            squares[m, other, b] - (height * p + level * q) / determinant
                        )
                    noise[m, m] += noise_scale
                if not hangs:
                    value = -0.5 * n_sensors * math.log(determinant)
                    value -= 0.5 * (n + nu) * log_determinant(noise)
                    if value > evidence[b, n]:
                        evidence[b, n] = value


@njit(cache=True, nogil=True)
def shape_bell(
    bell: FloatArray, n: int, centre: float, bell_width: float
) -> tuple[float, float]:  # pragma: no cover
    """Write the bell of eq. (4.2) over n samples; return its sum and its sum of squares."""
    radius = bell_width * (n - 1) if n > 1 else 1.0
    total = 0.0
    total_squares = 0.0
    for i in range(n):
        offset = (i - centre * (n - 1)) / radius
        bell[i] = math.exp(-offset * offset)
        total += bell[i]
        total_squares += bell[i] * bell[i]
    return total, total_squares


@njit(cache=True, nogil=True)
def _correlate(
    signal: FloatArray, at: int, bell: FloatArray, n: int, products: FloatArray
) -> None:  # pragma: no cover
    """Correlate a signal with the bell for all ends of a block at once.

    Four samples a pass: the inner loop runs over the ends, so that it vectorises without
    reordering any sum.
    """
    width = products.shape[0]
    for b in range(width):
        products[b] = 0.0
    fours = n - n % 4
    for i in range(0, fours, 4):
        w0, w1, w2, w3 = bell[i], bell[i + 1], bell[i + 2], bell[i + 3]
        window = signal[at + i : at + i + width + 3]
        for b in range(width):
            products[b] += (
                w0 * window[b] + w1 * window[b + 1] + w2 * window[b + 2] + w3 * window[b + 3]
            )
    for i in range(fours, n):
        w0 = bell[i]
        window = signal[at + i : at + i + width]
        for b in range(width):
            products[b] += w0 * window[b]


@njit(cache=True, nogil=True)
def log_determinant(matrix: FloatArray) -> float:  # pragma: no cover
    """Log-determinant of a small symmetric matrix given by its lower triangle, which it spoils."""
    size = matrix.shape[0]
    product = 1.0
    for i in range(size):
        for k in range(i):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, i + 1):
                matrix[i, j] -= factor * matrix[j, k]
        product *= matrix[i, i]
    return math.log(product)
