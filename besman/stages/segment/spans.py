"""The movements between the valleys that may be part of the most probable segmentation."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from besman.stages.segment.long_spans import REACH, LongSpans, longest_exact
from besman.stages.segment.span_bounds import LEAF, SpanBounds
from besman.stages.segment.span_evidence import SpanEvidence
from besman.stages.segment.vmci import trace_back

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_NONE = (np.empty(0, dtype=np.int64), np.empty(0), np.empty(0), np.empty(0))

# Short spans that are evaluated at once; bounds the memory.
_AT_ONCE = 2**20


class Spans:
    """The movements between valleys, by the valley that they end at.

    Short ones are evaluated and kept. Long ones are bounded when they are asked for; those that
    cannot win are left out.

    Parameters
    ----------
    evidence : SpanEvidence
        What the evidence of a movement depends on.
    starts, ends : int array, shape (V,)
        Movement (i, k), i < k, holds the samples starts[i] to ends[k] - 1. Both rise.
    rest : array, shape (V,)
        Log-evidence of what lies between ends[k] and starts[k].
    sure : bool array, shape (V,)
        Valleys that no movement leads past.
    given : dict of int to float
        Log-evidence of the movement from the valley before to each of these.

    Attributes
    ----------
    near, far : int array, shape (V,)
        Short movements to valley k start at near[k], ..., k - 1, long ones before, from far[k] on.
    """

    def __init__(
        self,
        evidence: SpanEvidence,
        starts: IntArray,
        ends: IntArray,
        rest: FloatArray,
        sure: BoolArray,
        given: dict[int, float],
    ) -> None:
        self.evidence, self.starts, self.ends, self.rest = evidence, starts, ends, rest
        n = len(starts)
        number = np.arange(n)
        limit = longest_exact(evidence.model.bell_width)
        # The last valley before k that may not be passed is the first start.
        last_sure = np.maximum.accumulate(np.where(sure, number, 0))
        first = np.concatenate([[0], last_sure[:-1]])
        first = np.maximum(first, np.searchsorted(starts, ends - len(evidence.factor) + 1))
        near = np.minimum(np.searchsorted(starts, ends - limit), number - 1)
        self.near = np.minimum(np.maximum(near, first), number)
        self.near[0] = 0
        self.far = np.minimum(first, self.near)
        self._offsets = np.concatenate([[0], np.cumsum(number - self.near)])
        self._values = self._evaluate()
        for k, value in given.items():
            if self.near[k] < k:
                self._values[self._offsets[k + 1] - 1] = value
        self._long: _LongOnes | None = None

    def _evaluate(self) -> FloatArray:
        """Evaluate the short movements, those to one end after the other."""
        values = np.empty(self._offsets[-1])
        counts = np.diff(self._offsets)
        steps = np.arange(0, len(values) + _AT_ONCE, _AT_ONCE)
        edges = np.unique(np.minimum(np.searchsorted(self._offsets, steps), len(counts)))
        for low, high in pairwise(edges):
            k = np.repeat(np.arange(low, high), counts[low:high])
            first = self._offsets[low]
            i = np.arange(first, self._offsets[high]) - self._offsets[k] + self.near[k]
            values[first : self._offsets[high]] = self.evidence.evaluate(
                self.starts[i], self.ends[k]
            )
        return values

    def short(self, k: int) -> FloatArray:
        """Return the log-evidence of the short movements from near[k], ..., k - 1 to k."""
        return self._values[self._offsets[k] : self._offsets[k + 1]]

    def short_between(self, i: IntArray, k: IntArray) -> FloatArray:
        """Return the log-evidence of short movements; any value where i = k."""
        at = self._offsets[k] + i - self.near[k]
        values: FloatArray = self._values[np.minimum(at, len(self._values) - 1)]
        return values

    def long(self, k: int) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Return the starts of the long movements to k that may win, and bounds of their evidence.

        Returns
        -------
        starts : int array, shape (K,)
            Rising, all before near[k].
        low, high, likely : array, shape (K,)
            Bounds, and what lies between them.
        """
        if self.far[k] == self.near[k]:
            return _NONE
        if self._long is None:
            self._long = _LongOnes(self)
        return self._long.to(k)

    def evaluate(self, i: int, k: int) -> float:
        """Evaluate one movement exactly."""
        if i >= self.near[k]:
            return float(self.short(k)[i - self.near[k]])
        return float(self.evidence.evaluate(self.starts[[i]], self.ends[[k]])[0])


class _LongOnes:
    """The long movements; most of them cannot win beside a chain of short ones."""

    def __init__(self, spans: Spans) -> None:
        self._spans = spans
        limit = longest_exact(spans.evidence.model.bell_width)
        leads, follows = _follow_chain(spans)
        self._bounds = SpanBounds(spans.evidence, limit, spans.starts, spans.ends, leads, follows)
        self._ends, self._starts = self._bounds.find_blocks(spans.far, spans.near)
        self._long = LongSpans(spans.evidence)

    def to(self, k: int) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Return what `Spans.long` does."""
        spans = self._spans
        block = slice(*np.searchsorted(self._ends, [k // LEAF, k // LEAF + 1]))
        starts = (self._starts[block, np.newaxis] * LEAF + np.arange(LEAF)).ravel()
        starts = starts[(starts >= spans.far[k]) & (starts < spans.near[k])]
        if starts.size:
            starts = self._bounds.keep(starts, k)
        if starts.size == 0:
            return _NONE
        end = int(spans.ends[k])
        origin = int(spans.ends[np.searchsorted(spans.ends, end + REACH, side="right") - 1])
        deepest = int(spans.starts[self._starts[block][0] * LEAF])
        return starts, *self._long.bound(spans.starts[starts], end, origin, deepest)


def _follow_chain(spans: Spans) -> tuple[FloatArray, FloatArray]:
    """Follow the best chain of short movements.

    Returns
    -------
    leads, follows : array, shape (V,)
        There is a way of log-probability leads[i] + follows[k] from valley i to valley k, if there
        is a valley of the chain between them, and there is where a movement from i to k is long.
    """
    n = len(spans.rest)
    best = np.full(n, -np.inf)
    best[0] = 0.0
    previous = np.zeros(n, dtype=np.int64)
    for k in range(1, n):
        near = spans.near[k]
        values = best[near:k] + spans.short(k)
        if values.size:
            last = int(np.argmax(values))
            previous[k], best[k] = near + last, spans.rest[k] + values[last]
    leads, follows = np.full(n, -np.inf), np.full(n, -np.inf)
    if best[-1] == -np.inf:
        return leads, follows
    chain = trace_back(previous)
    valley = np.arange(n)
    before = chain[np.searchsorted(chain, valley, side="right") - 1]
    behind = chain[np.searchsorted(chain, valley)]
    leads = spans.short_between(valley, behind) + spans.rest[behind] - best[behind]
    follows = best[before] + spans.short_between(before, valley)
    leads[chain], follows[chain] = -best[chain], best[chain] - spans.rest[chain]
    return leads, follows
