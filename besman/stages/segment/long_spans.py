r"""The evidence of long spans between two bounds, at a cost that does not grow with their length.

What the evidence needs of a span are sums of speeds, of their products, and of speeds times a
bell. The first two are differences of running sums. For the third the span is cut into 8 pieces, on
each of which a polynomial of degree 5 follows the bell, so that the moments of the speed up to the
fifth, differences of running sums as well, give

.. math::

    p_c = \sum_t b_c(t) v_t = \hat p_c + \epsilon \sum_t v_t, \qquad
    |\epsilon| \le \frac{\max |b^{(6)}| r^6}{2^5 6!} + \text{rounding}

with r half of a piece. A speed is never negative, so this bounds the share of the variance that a
bell explains, and with it the evidence, from below and from above, to within a nat for a span of an
hour; what lies between is off by less than a hundredth of that. Derivatives of the bell are
bounded by Cramér's inequality, :math:`|H_m(x)| e^{-x^2} \le 1.0865 \sqrt{2^m m!}`, and the sums of
the bell itself are those of Euler and Maclaurin.

References
----------
NIST Digital Library of Mathematical Functions, 2.10(i) (Euler-Maclaurin) and 18.14(i) (Cramér's
inequality); L. N. Trefethen, *Approximation Theory and Approximation Practice*, theorem 6.2
(interpolation at Chebyshev points).
"""

from __future__ import annotations

from math import comb, erf, factorial, pi, sqrt

import numpy as np
import numpy.typing as npt

from besman.stages.segment.span_evidence import SpanEvidence, log_determinants

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_PIECES = 8
_DEGREE = 5
# Ends that share running sums lie this many samples apart at most.
REACH = 128
# Running sums are taken in blocks, so that rounding grows with the root of their length.
_BLOCK = 512
# Spans that are bounded at once: they fit into the cache.
_AT_ONCE = 512
# Samples of a bell's width from which on Euler and Maclaurin's sums are exact.
_LEAST_WIDTH = 64


def longest_exact(bell_width: float) -> int:
    """Return how many samples a span may have that is evaluated sample by sample."""
    return max(2 * REACH, int(np.ceil(_LEAST_WIDTH / bell_width)))


class LongSpans:
    """Bounds the evidence of long spans that end at one sample.

    Parameters
    ----------
    evidence : SpanEvidence
        What the evidence depends on.
    """

    def __init__(self, evidence: SpanEvidence) -> None:
        self._evidence = evidence
        n_least = longest_exact(evidence.model.bell_width)
        self._weights, self._miss = _follow_bells(evidence, n_least)
        self._bells = BellSums(evidence.centres, evidence.model.bell_width)
        # A running sum is that much off at most, for each unit in the last place.
        reach = (np.arange(1, _PIECES + 1) / _PIECES + 2 * REACH / n_least)[:, np.newaxis]
        grown = np.abs(self._weights) * (reach ** np.arange(_DEGREE + 1))[..., np.newaxis]
        self._unsure = 2.0 * np.finfo(float).eps * float(grown.sum(axis=(0, 1)).max())
        self._origin = self._first = -1
        self._moments = np.empty((0, 0, 0))
        self._scatter = np.empty((0, 0, 0))

    def bound(
        self, starts: IntArray, end: int, origin: int, first: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Bound the log-evidence of spans from below and from above.

        Parameters
        ----------
        starts : int array, shape (K,)
            Span k holds the samples starts[k] to end - 1, more than `longest_exact`.
        end : int
            Where all of them end.
        origin, first : int
            If no running sums serve, new ones are taken from origin, an end at most `REACH` samples
            later, back to first, which is not after the starts; they serve the ends between. Going
            backwards, they are taken from the end itself.

        Returns
        -------
        low, high : array, shape (K,)
        likely : array, shape (K,)
            Between the two, as if the products were right.
        """
        serves = self._origin - REACH <= end <= self._origin and self._first <= starts.min()
        if not serves:
            self._sum_up(first, end if end < self._origin else origin)
        found = np.empty((3, len(starts)))
        for k in range(0, len(starts), _AT_ONCE):
            n = end - starts[k : k + _AT_ONCE]
            found[:, k : k + _AT_ONCE] = self._weigh(n, *self._measure(n, self._origin - end))
        return found[0], found[1], found[2]

    def _sum_up(self, first: int, origin: int) -> None:
        """Take the running sums back from an end, with the moments of time about it."""
        self._origin, self._first = origin, first
        speeds = self._evidence.speeds[first:origin][::-1]
        powers = np.vander(np.arange(float(len(speeds))), _DEGREE + 1, increasing=True)
        self._moments = _running_sums(speeds[:, :, np.newaxis] * powers[:, np.newaxis])
        self._scatter = _running_sums(speeds[:, :, np.newaxis] * speeds[:, np.newaxis])

    def _measure(self, n: IntArray, after: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Sum speeds (K, s), speeds times bells (K, s, C) and products of speeds (K, s, s).

        The spans have n samples and end `after` samples before the origin of the running sums.
        """
        pieces = np.arange(1, _PIECES + 1)
        bounds = (2 * n[:, np.newaxis] * pieces + _PIECES) // (2 * _PIECES) + after
        moments = self._moments[bounds] - self._moments[after]
        sums = moments[:, -1, :, 0]
        degrees = range(_DEGREE + 1)
        if after:
            # From moments about the origin to moments about the end.
            moved = [
                [comb(m, k) * float(-after) ** (m - k) if k <= m else 0.0 for m in degrees]
                for k in degrees
            ]
            flat = moments.reshape(-1, _DEGREE + 1) @ np.array(moved)
            moments = flat.reshape(moments.shape)
        scale = np.vander(1.0 / (n - 1.0), _DEGREE + 1, increasing=True)
        moments = (moments * scale[:, np.newaxis, np.newaxis]).transpose(0, 2, 1, 3)
        products = moments.reshape(len(n), -1, self._weights[..., 0].size) @ self._weights.reshape(
            -1, self._weights.shape[-1]
        )
        return sums, products, self._scatter[n + after] - self._scatter[after]

    def _weigh(
        self, n: IntArray, sums: FloatArray, products: FloatArray, scatter: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Bound the evidence, given how far the products may be off.

        With the constant taken out, the noise is C - h h' / k, h the centred products and k the
        centred square of the bell; its determinant is that of C times 1 - h' C^-1 h / k.
        """
        model, nu = self._evidence.model, self._evidence.nu
        s = sums.shape[1]
        total, squares = self._bells.over(n)
        a, e = squares + 1.0 / model.speed_weight_variance, n + 1.0 / model.speed_weight_variance
        spread = a - total**2 / e[:, np.newaxis]
        mean = sums / e[:, np.newaxis]
        centred = products - mean[..., np.newaxis] * total[:, np.newaxis]
        depth = _BLOCK + len(self._moments) / _BLOCK
        miss = ((self._miss + self._unsure * depth) * sums)[..., np.newaxis]
        noise = scatter - mean[:, :, np.newaxis] * sums[:, np.newaxis]
        noise = noise + model.noise_scale * np.eye(s)
        inverse = np.linalg.inv(np.linalg.cholesky(noise)) if s > 1 else noise**-0.5
        size, wide = _size(inverse, centred), _size(np.abs(inverse), miss)
        weight = 0.5 * (n + nu)[:, np.newaxis]
        whole = log_determinants(noise)[:, np.newaxis]
        # No noise is smaller than its prior alone.
        floor = np.exp(s * np.log(model.noise_scale) - whole)
        least = np.maximum(1.0 - (size + wide) ** 2 / spread, floor)
        most = np.maximum(1.0 - np.maximum(size - wide, 0.0) ** 2 / spread, floor)
        high = self._evidence.factor[n][:, np.newaxis] - weight * (whole + np.log(least))
        high -= 0.5 * s * np.log(spread * e[:, np.newaxis])
        low = high - weight * (most / least - 1.0)
        likely = 0.5 * (low + high)
        for value, off in ((low, -miss), (high, miss), (likely, 0.0)):
            value[(centred + off < 0.0).any(axis=1)] = -np.inf
        parallel = _size(inverse, sums[..., np.newaxis])[:, 0] ** 2 / e
        rounding = 4 * np.finfo(float).eps * depth * (n + nu) * (s + parallel)
        return low.max(axis=1) - rounding, high.max(axis=1) + rounding, likely.max(axis=1)


def _size(inverse: FloatArray, vectors: FloatArray) -> FloatArray:
    """Length of vectors (K, s, C) after a change of unit (K, s, s), shape (K, C)."""
    if vectors.shape[1] == 1:
        return np.abs(inverse[:, 0] * vectors[:, 0])
    lengths: FloatArray = np.linalg.norm(inverse @ vectors, axis=1)
    return lengths


class BellSums:
    """Sums of the bells over a span and of their squares, by Euler and Maclaurin.

    Parameters
    ----------
    centres : array, shape (C,)
        Shares of the span.
    width : float
        Share of the span.
    """

    def __init__(self, centres: FloatArray, width: float) -> None:
        shares = []
        for w in (width, width / sqrt(2.0)):
            low, high = -centres / w, (1.0 - centres) / w
            area = [erf(b) - erf(a) for a, b in zip(low, high, strict=True)]
            first, last = _derive_bell(low, w), _derive_bell(high, w)
            shares.append(
                [
                    0.5 * sqrt(pi) * w * np.array(area),
                    0.5 * (first[0] + last[0]),
                    (last[1] - first[1]) / 12.0,
                    (last[2] - first[2]) / -720.0,
                    (last[3] - first[3]) / 30240.0,
                ]
            )
        self._shares = np.array(shares)

    def over(self, n: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the sums over spans of n samples, shape (K,), and those of squares: (K, C) each.

        The width of a bell covers dozens of samples.
        """
        steps = n - 1.0
        powers = np.stack([steps, np.ones(len(n)), 1 / steps, 1 / steps**3, 1 / steps**5], axis=1)
        return powers @ self._shares[0], powers @ self._shares[1]


def _derive_bell(x: FloatArray, w: float) -> tuple[FloatArray, ...]:
    """Return the bell exp(-x^2), x = (u - c) / w, and its derivatives by u: 1st, 3rd and 5th."""
    bell = np.exp(-(x**2))
    third = -8.0 * x**3 + 12.0 * x
    fifth = -32.0 * x**5 + 160.0 * x**3 - 120.0 * x
    return bell, -2.0 * x * bell / w, third * bell / w**3, fifth * bell / w**5


def _follow_bells(evidence: SpanEvidence, n_least: int) -> tuple[FloatArray, float]:
    """Interpolate the bells by pieces, at Chebyshev points.

    Returns
    -------
    weights : array, shape (pieces, degree + 1, C)
        Of the moments summed up to the end of each piece; time runs back from the end, in shares of
        the span.
    miss : float
        Greatest difference from the bells.
    """
    # Pieces end between samples; their ends are rounded.
    half = 0.5 / _PIECES + 0.5 / (n_least - 1)
    n_points = _DEGREE + 1
    points = np.cos((np.arange(n_points) + 0.5) * pi / n_points)
    width, centres = evidence.model.bell_width, 1.0 - evidence.centres
    pieces = np.zeros((_PIECES + 1, n_points, len(centres)))
    for piece in range(_PIECES):
        middle = (piece + 0.5) / _PIECES
        bells = np.exp(-((((middle + half * points)[:, np.newaxis] - centres) / width) ** 2))
        local = np.linalg.solve(np.vander(points, increasing=True), bells)
        for k in range(n_points):
            for m in range(k + 1):
                moved = comb(k, m) * (-middle) ** (k - m) / half**k
                pieces[piece, m] += moved * local[k]
    slope = 1.0865 * sqrt(2.0**n_points * factorial(n_points))
    miss = slope * (half / width) ** n_points / (2**_DEGREE * factorial(n_points))
    return pieces[:-1] - pieces[1:], miss


def _running_sums(values: FloatArray) -> FloatArray:
    """Sum up along the first axis, shape (N + 1, ...), in blocks, which rounds less."""
    n = len(values)
    padded = np.zeros((-(-n // _BLOCK) * _BLOCK, *values.shape[1:]))
    padded[:n] = values
    blocks = np.cumsum(padded.reshape(-1, _BLOCK, *values.shape[1:]), axis=1)
    before = np.cumsum(blocks[:, -1], axis=0)
    blocks[1:] += before[:-1, np.newaxis]
    return np.concatenate([np.zeros((1, *values.shape[1:])), blocks.reshape(padded.shape)[:n]])
