"""The compiled recursion of `besman.stages.segment.vmci`; its oracle is `vmci_plain`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]

# Ends that are worked on together: long enough to share a bell, short enough for the cache.
BLOCK = 512

# Ends whose triangular roots are turned together: they fit into the first cache.
_LANE = 64


@njit(cache=True, nogil=True)
def run_viterbi(
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
) -> tuple[FloatArray, npt.NDArray[np.int64]]:  # pragma: no cover
    """Run the recursion of eq. (4.7) and (4.8) in the log domain.

    Parameters
    ----------
    paths : array, shape (2 * d, L + T)
        Scaled positions of the sample before and of the sample, after L zeros, so that windows
        that reach beyond the first sample need no case of their own.
    padded : array, shape (s, L + T)
        Scaled speeds after L zeros, one row for each sensor.
    factor : array, shape (L + 1,)
        What depends on nothing but the length of a segment, see `besman.stages.segment.vmci`; L is
        the longest.
    n_centres, bell_width, weight_variance, speed_weight_variance, noise_scale
        See `besman.stages.segment.vmci.VmciModel`.
    nu_position, nu_speed : float
        Degrees of freedom of the noise of positions and speeds.

    Returns
    -------
    best : array, shape (T + 1,)
        Log-probability of the best segmentation of the first t samples.
    previous : int array, shape (T + 1,)
        Start of its last segment.
    """
    longest = factor.shape[0] - 1
    n_samples = paths.shape[1] - longest
    block = min(BLOCK, n_samples)
    evidence = np.empty((block, longest + 1))
    best = np.full(n_samples + 1, -np.inf)
    best[0] = -math.log(n_centres)
    previous = np.zeros(n_samples + 1, dtype=np.int64)
    for first in range(0, n_samples, block):
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
            False,
            evidence,
        )
        for b in range(width):
            end = first + 1 + b
            for n in range(1, min(longest, end) + 1):
                value = best[end - n] + evidence[b, n]
                if value > best[end]:
                    best[end] = value
                    previous[end] = end - n
    return best, previous


@njit(cache=True, nogil=True)
def evaluate_block(
    paths: FloatArray,
    padded: FloatArray,
    first: int,
    width: int,
    factor: FloatArray,
    n_centres: int,
    bell_width: float,
    weight_variance: float,
    speed_weight_variance: float,
    noise_scale: float,
    nu_position: float,
    nu_speed: float,
    marginal: bool,
    evidence: FloatArray,
) -> None:  # pragma: no cover
    """Fill the log-evidence of all segments that end in a block.

    ``evidence[b, n]`` belongs to the n samples before sample ``first + 1 + b``. The rest as
    `run_viterbi`; `marginal` sums over the centres of the bell instead of taking the best.
    """
    longest = factor.shape[0] - 1
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
        marginal,
        evidence,
    )
    for lane in range(0, width, _LANE):
        _add_positions(
            paths,
            first + lane,
            min(_LANE, width - lane),
            factor,
            weight_variance,
            noise_scale,
            nu_position,
            evidence[lane:],
        )


@njit(cache=True, nogil=True, error_model="numpy")
def _add_positions(
    paths: FloatArray,
    first: int,
    width: int,
    factor: FloatArray,
    weight_variance: float,
    noise_scale: float,
    nu: float,
    evidence: FloatArray,
) -> None:  # pragma: no cover
    """Add the log-evidence of the positions, eq. (A.16), for a few ends at once.

    The start moves backwards, so that each segment is the one before and one sample more: one
    Givens rotation of the triangular root for each row. Its upper left triangle is then the root of
    M^-1, the lower right one the root of Y'PY + S: the evidence needs only their diagonals, and
    nothing large is ever subtracted. The inner loops run over the ends, so that they vectorise
    without reordering any sum.
    """
    size = paths.shape[0]
    d = size // 2
    longest = factor.shape[0] - 1
    one = np.empty((size, size))
    start_root(one, weight_variance, noise_scale)
    root = np.empty((size, size, width))
    for i in range(size):
        for k in range(size):
            root[i, k] = one[i, k]
    row = np.empty((size, width))
    cosine = np.empty(width)
    sine = np.empty(width)
    for n in range(1, min(longest, first + width) + 1):
        at = longest + first + 1 - n
        for k in range(size):
            for b in range(width):
                row[k, b] = paths[k, at + b]
        for i in range(size):
            for b in range(width):
                length = math.sqrt(root[i, i, b] * root[i, i, b] + row[i, b] * row[i, b])
                cosine[b] = root[i, i, b] / length
                sine[b] = row[i, b] / length
                root[i, i, b] = length
            for k in range(i + 1, size):
                for b in range(width):
                    rotated = cosine[b] * root[i, k, b] + sine[b] * row[k, b]
                    row[k, b] = cosine[b] * row[k, b] - sine[b] * root[i, k, b]
                    root[i, k, b] = rotated
        for b in range(width):
            weights = 1.0
            noise = 1.0
            for k in range(d):
                weights *= root[k, k, b]
                noise *= root[d + k, d + k, b]
            evidence[b, n] += factor[n] - d * math.log(weights) - (n + nu) * math.log(noise)


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
    marginal: bool,
    evidence: FloatArray,
) -> None:  # pragma: no cover
    """Fill the log-evidence of the best centre or of all, eq. (A.17), for a block of ends."""
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
                    before = evidence[b, n]
                    evidence[b, n] = max(before, value)
                    if marginal and before > -np.inf:
                        evidence[b, n] += math.log1p(math.exp(-abs(value - before)))


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
