r"""Which long spans may still win: an upper bound for many of them at once.

A span that spreads over many movements leaves much unexplained: over a stretch that is short beside
it, its bell is all but a straight line. So the recording is cut into cells of 4, 8, 16, ... samples
each, and of every cell the scatter about its own line is kept, which no weights can lower. With Q
the sum over the cells inside the span, C the scatter of the span about its mean, and cells of at
most 1/8 of it, the noise that its bell leaves is

.. math::

    N \succeq S + (1 - \gamma) Q - (1 / \gamma - 1) \frac{n \eta^2}{k} C, \qquad
    \eta = \frac{1}{8} \left(\frac{\text{cell}}{w n}\right)^2

for any :math:`0 < \gamma < 1`: the bell is :math:`\eta` off its line at most, its height squared is
at most C / k, k the centred square of the bell, and :math:`(A - B)'(A - B) \succeq (1 - \gamma) A'A
- (1 / \gamma - 1) B'B`. Q grows with the span and so does C, so that one bound holds for all spans
that hold an inner stretch and lie in an outer one; as a function of n alone the bound is convex and
takes its greatest value at an end. This gives the bound for all pairs of a block of starts and a
block of ends, which is divided into four while it is not low enough.

Low enough is what loses by `MARGIN` nats against a way through the same two valleys: from the start
to the next border of a chain of short spans, along the chain, and on to the end. No such span is
part of the most probable segmentation, and all of them together change no probability by 1e-9
(there are fewer than 1e10 of them, and exp(-45) is 3e-20).

References
----------
R. Killick, P. Fearnhead, I. A. Eckley: Optimal detection of changepoints with a linear
computational cost. JASA 107 (2012), doi:10.1080/01621459.2012.737745, drops starts that cannot win
likewise; its condition on the cost does not hold for an evidence with the noise integrated out, so
the bound stands in its place. The blocks are those of dual-tree branch and bound: A. G. Gray, A. W.
Moore: N-body problems in statistical learning. NIPS 2000.
"""

from __future__ import annotations

from math import erf, exp, pi, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.stages.segment.span_evidence import SpanEvidence

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# A span that loses by so many nats counts for nothing.
MARGIN = 45.0

# Starts and ends that are looked at together at last.
LEAF = 64

# Samples of the smallest cell, and cells in a span, at least.
_SMALLEST = 4
_LEAST_CELLS = 8

# Of the bound above; a smaller one would not change it.
_LEAST_GAMMA = 1e-6

_TINY = np.finfo(float).tiny


class SpanBounds:
    """Bounds the evidence of long spans from above, and drops those that cannot win.

    Parameters
    ----------
    evidence : SpanEvidence
        What the evidence depends on.
    n_least : int
        A long span has more samples.
    starts, ends : int array, shape (V,)
        Samples at which a span may start and end; both rise.
    leads, follows : array, shape (V,)
        There is a way of log-probability leads[i] + follows[k] from start i to end k.
    """

    def __init__(
        self,
        evidence: SpanEvidence,
        n_least: int,
        starts: IntArray,
        ends: IntArray,
        leads: FloatArray,
        follows: FloatArray,
    ) -> None:
        self._evidence, self._n_least = evidence, n_least
        self._starts, self._ends = starts, ends
        # Both sides of the comparison change by as much with the length of a span; taken off, they
        # differ little within a block.
        usable = np.isfinite(leads)
        self._slope = 0.0
        if usable.any():
            last = np.flatnonzero(usable)[-1]
            self._slope = -leads[last] / max(1, starts[last])
        self._leads = leads + self._slope * starts
        self._follows = follows - self._slope * ends
        self._spread = _least_spread(evidence, n_least)
        self._within = _sum_cells(evidence.speeds)
        speeds = evidence.speeds
        self._sums = _add_up(speeds)
        self._scatter = _add_up(speeds[:, :, np.newaxis] * speeds[:, np.newaxis])

    def find_blocks(self, first: IntArray, behind: IntArray) -> tuple[IntArray, IntArray]:
        """Find the blocks of `LEAF` ends and `LEAF` starts in which a long span may win.

        Parameters
        ----------
        first, behind : int array, shape (V,)
            The long spans that end at k start at first[k] to behind[k] - 1; both rise.

        Returns
        -------
        ends, starts : int array, shape (B,)
            Numbers of blocks, sorted by ends and then by starts.
        """
        n = len(first)
        height = max(0, int(np.ceil(np.log2(max(1, n / LEAF)))))
        leads, follows = (_least_by_block(x, height) for x in (self._leads, self._follows))
        k: IntArray = np.zeros(1, dtype=np.int64)
        i = k
        for level in range(height, -1, -1):
            size = LEAF << level
            if level < height:
                k, i = 2 * np.repeat(k, 4), 2 * np.repeat(i, 4)
                k, i = k + np.resize([0, 0, 1, 1], len(k)), i + np.resize([0, 1, 0, 1], len(i))
            inside = (k * size < n) & (i * size < n)
            k, i = k[inside], i[inside]
            k1, i1 = k * size, i * size
            k2, i2 = np.minimum(k1 + size, n) - 1, np.minimum(i1 + size, n) - 1
            keep = np.flatnonzero((first[k1] <= i2) & (behind[k2] > i1))
            reached = leads[level][i[keep]] + follows[level][k[keep]]
            most = self._bound(i1[keep], i2[keep], k1[keep], k2[keep])
            keep = keep[most >= reached - MARGIN]
            k, i = k[keep], i[keep]
        order = np.lexsort((i, k))
        return k[order], i[order]

    def keep(self, starts: IntArray, end: int) -> IntArray:
        """Keep the starts of long spans to one end that may win.

        Parameters
        ----------
        starts : int array, shape (K,)
            Numbers of starts.
        end : int
            Number of the end.

        Returns
        -------
        int array, shape (K',)
        """
        ends = np.full(len(starts), end)
        most = self._bound(starts, starts, ends, ends)
        kept: IntArray = starts[most >= self._leads[starts] + self._follows[end] - MARGIN]
        return kept

    def _bound(self, i1: IntArray, i2: IntArray, k1: IntArray, k2: IntArray) -> FloatArray:
        """Bound, less the slope, all long spans from starts i1 to i2 to ends k1 to k2."""
        if not self._spread > 0.0:
            return np.full(len(i1), np.inf)
        model, nu, s = self._evidence.model, self._evidence.nu, self._sums.shape[1]
        inner = self._starts[i2], self._ends[k1]
        outer = self._starts[i1], self._ends[k2]
        longest = len(self._evidence.factor) - 1
        n_low = np.clip(inner[1] - inner[0], self._n_least + 1, longest)
        n_outer = np.maximum(outer[1] - outer[0], 0)
        n_high = np.clip(n_outer, n_low, longest)
        sums = self._sums[outer[1]] - self._sums[outer[0]]
        scatter = self._scatter[outer[1]] - self._scatter[outer[0]]
        e = (n_outer + 1.0 / model.speed_weight_variance)[:, np.newaxis, np.newaxis]
        scatter -= sums[:, :, np.newaxis] * sums[:, np.newaxis] / e
        within, cell = self._within.between(*inner, n_low)
        bend = 0.125 * (cell / (model.bell_width * (n_low - 1))) ** 2
        bent = bend**2 / self._spread
        # The gamma that takes least off the traces; any holds.
        left = np.trace(within, axis1=1, axis2=2)
        off = bent * np.maximum(np.trace(scatter, axis1=1, axis2=2), 0.0)
        gamma = np.maximum(np.sqrt(off / np.maximum(left, off + _TINY)), _LEAST_GAMMA)
        kept, lost = 1.0 - gamma, (1.0 / gamma - 1.0) * bent
        noise = kept[:, np.newaxis, np.newaxis] * within
        noise -= lost[:, np.newaxis, np.newaxis] * scatter
        whole = _least_log_determinant(noise, model.noise_scale)
        most = np.full(len(i1), -np.inf)
        for n in (n_low, n_high):
            value = self._evidence.factor[n] - self._slope * n - 0.5 * (n + nu) * whole
            most = np.maximum(most, value - 0.5 * s * np.log(self._spread * n * n))
        return most


class _Cells(NamedTuple):
    """Scatter about a line of its own of every cell, summed up, for cells of all sizes.

    Attributes
    ----------
    sums : array, shape (sum of n_cells + 1, s, s)
        Running sums, one size after the other.
    offsets : int array, shape (sizes,)
        Where each size begins.
    """

    sums: FloatArray
    offsets: IntArray

    def between(
        self, start: IntArray, end: IntArray, n_low: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Sum over the cells inside a stretch; also their size in samples.

        The cells are as large as a span of n_low samples allows.
        """
        level = np.log2(np.maximum(n_low / (_LEAST_CELLS * _SMALLEST), 1.0)).astype(np.int64)
        level = np.minimum(level, len(self.offsets) - 1)
        cell = _SMALLEST << level
        high = end // cell
        low = np.minimum(-(-start // cell), high)
        at = self.offsets[level]
        return self.sums[at + high] - self.sums[at + low], cell.astype(np.float64)


def _sum_cells(speeds: FloatArray) -> _Cells:
    """Sum up the scatter of cells of 4, 8, 16, ... samples about a line of their own."""
    n, s = speeds.shape
    sums, offsets, cell = [], [0], _SMALLEST
    while True:
        x = np.arange(cell) - 0.5 * (cell - 1)
        line = np.stack([np.full(cell, cell**-0.5), x / np.linalg.norm(x)])
        parts = speeds[: n // cell * cell].reshape(-1, cell, s)
        parts = parts - line.T @ (line @ parts)
        sums.append(_add_up(parts.transpose(0, 2, 1) @ parts))
        cell *= 2
        if cell * _LEAST_CELLS > n:
            return _Cells(np.concatenate(sums), np.array(offsets))
        offsets.append(offsets[-1] + len(sums[-1]))


def _least_spread(evidence: SpanEvidence, n_least: int) -> float:
    """Bound the centred square of every bell over the length of its span from below.

    A sum over a span is off its integral by no more than the way that the bell goes up and down.
    """
    w, least = evidence.model.bell_width, np.inf
    for centre in evidence.centres:
        (area, way), (square, square_way) = (
            (
                0.5 * sqrt(pi) * v * (erf((1.0 - centre) / v) + erf(centre / v)),
                2.0 - exp(-((centre / v) ** 2)) - exp(-(((1.0 - centre) / v) ** 2)),
            )
            for v in (w, w / sqrt(2.0))
        )
        least = min(least, square - square_way / n_least - (area + way / n_least) ** 2)
    return least


def _least_log_determinant(noise: FloatArray, scale: float) -> FloatArray:
    """Log-determinant of the noise and its prior's scale; of that alone where it is more."""
    s = noise.shape[1]
    if s == 1:
        return np.log(scale + np.maximum(noise[:, 0, 0], 0.0))
    sizes = np.linalg.eigvalsh(noise)
    logs: FloatArray = np.log(scale + np.maximum(sizes, 0.0)).sum(axis=1)
    return logs


def _least_by_block(values: FloatArray, height: int) -> list[FloatArray]:
    """Return the least value in every block of LEAF, of 2 LEAF, ... of them."""
    padded = np.full(LEAF << height, np.inf)
    padded[: len(values)] = values
    levels = [padded.reshape(-1, LEAF).min(axis=1)]
    for _ in range(height):
        levels.append(levels[-1].reshape(-1, 2).min(axis=1))
    return levels


def _add_up(values: FloatArray) -> FloatArray:
    """Sum up along the first axis, from 0."""
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
