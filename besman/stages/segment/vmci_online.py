"""Exact vMCI, sample by sample, in bounded memory.

The recursion of `besman.stages.segment.vmci` needs, at every sample, the segments that end there:
the last L samples, L the longest segment. A border is final when all segmentations that may still
win share it. They all start their next segment within the last L samples; where the ways back from
these starts meet, nothing that comes later can change what lies before.

A start that stays 50 nats behind the best one for a second is given up, which lets the ways meet
sooner. That is measured, not proven: the borders stay those of the whole recording on 12 real
recordings and on an hour of reaches, with 30 nats as well, while with 20 nats some change. With
segments of at most 10 s a border is final after 16 s in the median and 127 s at most; what is most
probable now is known at once (`OnlineVmci.pending`).

Should the ways not meet within 64 times L, the most probable one is taken for good, so that memory
stays bounded. That takes an L shorter than most movements: cuts of all phases then compete.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import SegmentationError
from besman.stages.segment.signals import Scaling
from besman.stages.segment.vmci import VmciModel, tabulate_lengths

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# A start is given up after being so many nats behind the best one for so long.
_LEAD = 50.0
_PATIENCE_S = 1.0

# Times L that are remembered for ways that have not met.
_MEMORY = 64


class OnlineVmci:
    """Segments a stream of positions.

    Parameters
    ----------
    scaling : Scaling
        Of earlier movements at `rate_hz`, see `besman.stages.segment.signals.measure_scaling`: what
        is to come cannot be measured. With the scaling of the whole recording the borders are those
        of `besman.stages.segment.vmci.find_change_points`.
    border_probability : float
        Probability of a border at a sample of the method.
    sample_rate_hz : float
        Samples per second that are given.
    rate_hz : float
        Samples per second of the method, at most `sample_rate_hz`.
    longest_s : float
        Greatest duration of a segment, seconds. Time and latency grow with it.
    model : VmciModel, optional
        Prior and shape of the models of a segment.

    Raises
    ------
    SegmentationError
        If a parameter is out of its range or no marker moves.
    """

    def __init__(
        self,
        scaling: Scaling,
        border_probability: float,
        sample_rate_hz: float,
        rate_hz: float = 20.0,
        longest_s: float = 10.0,
        model: VmciModel | None = None,
    ) -> None:
        if not sample_rate_hz > 0 or not rate_hz > 0:
            raise SegmentationError(
                f"rates must be positive, got {sample_rate_hz:g} Hz and {rate_hz:g} Hz"
            )
        if not np.isfinite(scaling.step).any():
            raise SegmentationError("the scaling comes from markers that do not move")
        self._scaling = scaling
        self._n_markers = len(scaling.step)
        self._model = model or VmciModel()
        self._sample_rate_hz = sample_rate_hz
        self._rate_hz = min(rate_hz, sample_rate_hz)
        self._longest = max(2, round(longest_s * self._rate_hz))
        d = 3 * self._n_markers
        self._factor = tabulate_lengths(
            self._longest, d, self._n_markers, border_probability, self._longest, self._model
        )
        capacity = (_MEMORY + 1) * self._longest + 1
        # Data of the last samples after L zeros, and the recursion since the last final border.
        self._paths = np.zeros((2 * d, 3 * self._longest))
        self._speeds = np.zeros((self._n_markers, 3 * self._longest))
        self._n_held = 0
        self._best = np.full(capacity, -np.inf)
        self._best[0] = -np.log(self._model.n_centres)
        self._previous = np.zeros(capacity, dtype=np.int64)
        self._behind = np.zeros(capacity, dtype=np.int64)
        self._patience = max(1, round(_PATIENCE_S * self._rate_hz))
        self._row = np.empty((1, self._longest + 1))
        self._base = 0
        self._n_seen = 0
        self._final = 0
        self._recent: list[FloatArray] = []
        self._n_given = 0
        self._resampled: list[FloatArray] = []
        self._n_resampled = 0
        self._last_border = 0
        self._open_border: int | None = None
        self._done = False

    def update(self, sample: npt.ArrayLike) -> list[int]:
        """Take one sample.

        Parameters
        ----------
        sample : array, shape (m, 3)
            Positions of the markers, metres.

        Returns
        -------
        list of int
            Borders that became final, rising: numbers of samples given before each.

        Raises
        ------
        SegmentationError
            If the sample has another shape or is not finite, or `finish` was called.
        """
        if self._done:
            raise SegmentationError("the segmentation is finished; start a new one")
        self._recent.append(check_sample(sample, self._n_markers, self._n_given))
        self._n_given += 1
        half = 0.5 * self._sample_rate_hz / self._rate_hz
        centre = self._n_resampled * self._sample_rate_hz / self._rate_hz
        if self._n_given - 0.5 < centre + half - 1e-9:
            return []
        return self._take(self._average(centre, half))

    def finish(self) -> list[int]:
        """End the stream; return the borders that were not final yet, without the end itself.

        Raises
        ------
        SegmentationError
            If fewer than two samples of the method were given.
        """
        settled: list[int] = []
        ratio = self._sample_rate_hz / self._rate_hz
        while self._n_resampled * ratio <= self._n_given - 1 + 1e-6 * ratio:
            settled += self._take(self._average(self._n_resampled * ratio, 0.5 * ratio))
        if self._n_resampled < 2:
            raise SegmentationError(
                f"a segmentation needs at least 2 samples at {self._rate_hz:g} Hz, "
                f"got {self._n_resampled}"
            )
        self._done = True
        before, last = self._resampled
        borders = self._step(before, last, last - before)
        for border in self._trace(self._n_seen)[:-1]:
            borders += self._settle(border)
        if self._open_border is not None and self._n_seen - self._open_border >= 2:
            borders.append(self._open_border)
        self._open_border = None
        return settled + self._to_samples(borders)

    @property
    def pending(self) -> list[int]:
        """Borders of the most probable segmentation so far that are not final yet."""
        borders = [] if self._open_border is None else [self._open_border]
        return self._to_samples(borders + self._trace(self._n_seen)[:-1])

    def _average(self, centre: float, half: float) -> FloatArray:
        """Return the mean over a window of samples, as `besman.stages.segment.signals.resample`."""
        n_gone = self._n_given - len(self._recent)
        low, high = max(centre - half, -0.5), min(centre + half, self._n_given - 0.5)
        at = n_gone + np.arange(len(self._recent))
        weights = np.minimum(at + 0.5, high) - np.maximum(at - 0.5, low)
        weights = np.maximum(weights, 0.0) / (high - low)
        mean: FloatArray = np.tensordot(weights, np.stack(self._recent), axes=1)
        keep = int(np.floor(high + 0.5 + 1e-9)) - n_gone
        del self._recent[: max(0, min(keep, len(self._recent) - 1))]
        self._n_resampled += 1
        return mean

    def _take(self, sample: FloatArray) -> list[int]:
        """Take a sample of the method: the one before it has its central difference now."""
        self._resampled.append(sample)
        if len(self._resampled) == 1:
            return []
        if len(self._resampled) == 2:
            first, second = self._resampled
            return self._to_samples(self._step(first, first, second - first))
        before, at, after = self._resampled
        del self._resampled[0]
        return self._to_samples(self._step(before, at, 0.5 * (after - before)))

    def _step(self, before: FloatArray, at: FloatArray, difference: FloatArray) -> list[int]:
        """Go on by one sample with its speed; return new borders in samples of the method."""
        from besman.stages.segment.online_kernel import choose_start, find_agreed

        self._evaluate_row(before, at, difference)
        self._n_seen += 1
        self._make_room()
        now = self._n_seen - self._base
        choose_start(
            self._best, self._previous, self._behind, now, self._row[0], _LEAD, self._patience
        )
        if self._n_seen - self._final > (_MEMORY - 1) * self._longest:
            self._force()
        low = self._final - self._base
        agreed, next_one = find_agreed(self._best, self._previous, low, now, self._longest)
        borders: list[int] = []
        if agreed > low:
            for border in self._trace(self._base + agreed):
                borders += self._settle(border)
            self._final = self._base + agreed
        if self._open_border == self._base + agreed and next_one - agreed >= 2:
            borders.append(self._open_border)
            self._open_border = None
        return borders

    def _evaluate_row(self, before: FloatArray, at: FloatArray, difference: FloatArray) -> None:
        """Evaluate the segments that end with one more sample."""
        from besman.stages.segment.vmci_kernel import evaluate_block

        if self._n_held == 2 * self._longest:
            kept = slice(self._n_held, self._n_held + self._longest)
            for data in (self._paths, self._speeds):
                data[:, self._longest : 2 * self._longest] = data[:, kept].copy()
            self._n_held = self._longest
        column = self._longest + self._n_held
        scaled = np.stack([before, at]) - self._scaling.centre
        self._paths[:, column] = (scaled / self._scaling.step[:, np.newaxis]).ravel()
        self._speeds[:, column] = np.linalg.norm(difference, axis=1) / self._scaling.change
        model = self._model
        evaluate_block(
            self._paths,
            self._speeds,
            self._n_held,
            1,
            self._factor,
            model.n_centres,
            model.bell_width,
            model.weight_variance,
            model.speed_weight_variance,
            model.noise_scale,
            model.nu(3 * self._n_markers),
            model.nu(self._n_markers),
            False,
            self._row,
        )
        self._n_held += 1

    def _make_room(self) -> None:
        """Forget what lies before the last final border and the longest segment."""
        if self._n_seen - self._base < len(self._best):
            return
        first = min(self._final, self._n_seen - self._longest) - self._base
        kept = len(self._best) - first
        self._best[:kept] = self._best[first:].copy()
        self._previous[:kept] = self._previous[first:].copy() - first
        self._behind[:kept] = self._behind[first:].copy()
        self._base += first

    def _force(self) -> None:
        """Drop every start whose way back does not share the oldest border of the best one."""
        now = self._n_seen
        shared = [b for b in self._trace(now) if b <= now - self._longest]
        for node in range(now - self._longest + 1, now + 1):
            if shared[-1] not in self._trace(node):
                self._best[node - self._base] = -np.inf

    def _trace(self, node: int) -> list[int]:
        """Return the borders from the last final one, without it, to a node."""
        borders = []
        while node > self._final:
            borders.append(node)
            node = int(self._previous[node - self._base]) + self._base
        return borders[::-1]

    def _settle(self, border: int) -> list[int]:
        """Merge segments of one sample, as `besman.stages.segment.vmci.merge_single_samples`."""
        settled = []
        if border - self._last_border >= 2:
            if self._open_border is not None:
                settled.append(self._open_border)
            self._last_border = self._open_border = border
        elif self._last_border > 0:
            self._last_border = self._open_border = border
        return settled

    def _to_samples(self, borders: list[int]) -> list[int]:
        """Bring borders to the number of samples given."""
        ratio = self._sample_rate_hz / self._rate_hz
        return [int(np.round(border * ratio)) for border in borders]


def check_sample(sample: npt.ArrayLike, n_markers: int, number: int) -> FloatArray:
    """Return a sample of a stream as an array, shape (m, 3), metres.

    Parameters
    ----------
    sample : array, shape (m, 3)
    n_markers : int
        How many are expected.
    number : int
        Which sample it is, for the message.

    Raises
    ------
    SegmentationError
        If it has another shape or is not finite.
    """
    x: FloatArray = np.asarray(sample, dtype=np.float64)
    if x.shape != (n_markers, 3) or not np.isfinite(x).all():
        raise SegmentationError(
            f"sample {number}: expected {n_markers} finite positions of shape ({n_markers}, 3), "
            f"got {np.array2string(x, threshold=6)}"
        )
    return x
