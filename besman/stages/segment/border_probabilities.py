"""Ways through the valleys: the most probable one, and how probable each valley is in all."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from besman.stages.segment.span_bounds import MARGIN
from besman.stages.segment.spans import Spans
from besman.stages.segment.vmci import trace_back

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Long movements that are kept for the way back; bounds the memory.
_MOST_KEPT = 2**21

_NONE = (np.empty(0, dtype=np.int64), np.empty(0))


class Ways:
    """All ways through the valleys, followed from the first to the last.

    Long movements are bounded. Where the bounds leave open which way to a valley is best, those in
    question are evaluated, so that the most probable way is the one of exact evidence.

    Parameters
    ----------
    spans : Spans
        The movements.

    Attributes
    ----------
    best : int array, shape (W,)
        Valleys of the most probable way.
    log_probability : float
        Of that way.
    """

    def __init__(self, spans: Spans) -> None:
        n = len(spans.rest)
        self._spans = spans
        # Bounds of the best way to each valley, the valley before it there, and the sum of all.
        self._low, self._high = np.full(n, -np.inf), np.full(n, -np.inf)
        self._previous = np.zeros(n, dtype=np.int64)
        self._sum = np.full(n, -np.inf)
        self._low[0] = self._high[0] = self._sum[0] = 0.0
        # Long movements that count, for the way back; those beyond the limit are bounded once more.
        self._kept: list[tuple[IntArray, FloatArray] | None] = [_NONE] * n
        self._n_kept = 0
        for k in range(1, n):
            self._reach(k)
        self.best: IntArray = trace_back(self._previous)
        self.log_probability = self._settle(n - 1)

    def _reach(self, k: int) -> None:
        """Find the best way to valley k, and the sum of all."""
        spans = self._spans
        starts, *long = spans.long(k)
        near, short = np.arange(spans.near[k], k), spans.short(k)
        low = high = evidence = short
        if starts.size:
            near = np.concatenate([starts, near])
            low, high, evidence = (np.concatenate([values, short]) for values in long)
        most = self._high[near] + high
        if most.size == 0 or most.max() == -np.inf:
            return
        least = self._low[near] + low
        ahead = np.flatnonzero(most >= least.max())
        if len(ahead) > 1 and np.any(least[ahead] < most[ahead]):
            for one in ahead:
                i = int(near[one])
                least[one] = most[one] = self._settle(i) + spans.evaluate(i, k)
            if least[ahead].max() == -np.inf:
                return
        best = ahead[np.argmax(least[ahead])]
        self._previous[k] = near[best]
        self._low[k], self._high[k] = spans.rest[k] + least[best], spans.rest[k] + most[best]
        parts = self._sum[near] + evidence
        whole = _log_sum(parts)
        self._sum[k] = spans.rest[k] + whole
        counts = np.flatnonzero(parts[: len(starts)] >= whole - MARGIN)
        self._n_kept += len(counts)
        if len(counts):
            kept = starts[counts], evidence[counts]
            self._kept[k] = kept if self._n_kept <= _MOST_KEPT else None

    def _long(self, k: int) -> tuple[IntArray, FloatArray]:
        """Return the starts of the long movements to valley k, and their log-evidence."""
        kept = self._kept[k]
        if kept is not None:
            return kept
        starts, _, _, evidence = self._spans.long(k)
        return starts, evidence

    def _settle(self, k: int) -> float:
        """Evaluate the best way to a valley."""
        way = [k]
        while self._low[way[-1]] < self._high[way[-1]]:
            way.append(int(self._previous[way[-1]]))
        for i, j in pairwise(way[::-1]):
            value = self._low[i] + self._spans.evaluate(i, j) + self._spans.rest[j]
            self._low[j] = self._high[j] = value
        return float(self._low[k])

    def weigh(self) -> FloatArray:
        """Return the posterior probability of every valley, shape (V,).

        Forward and backward sums of the same terms.
        """
        spans, n = self._spans, len(self._sum)
        total = self._sum[-1]
        if not np.isfinite(total):
            return np.zeros(n)
        behind = np.full(n, -np.inf)
        behind[-1] = 0.0
        for k in range(n - 1, 0, -1):
            near = slice(spans.near[k], k)
            value = behind[k] + spans.rest[k]
            behind[near] = np.logaddexp(behind[near], value + spans.short(k))
            starts, long = self._long(k)
            if starts.size:
                behind[starts] = np.logaddexp(behind[starts], value + long)
        weights: FloatArray = np.exp(self._sum + behind - total)
        return np.minimum(weights, 1.0)


def _log_sum(values: FloatArray) -> float:
    """Log of the sum of exponentials; one of the values is finite."""
    greatest = values.max()
    return float(greatest + np.log(np.exp(values - greatest).sum()))
