"""Movements and rests of a stream, final as soon as nothing that comes can change them.

`besman.stages.segment.valley_vmci` looks at a whole recording, but what it decides is decided by
what lies near:

- Of the minima of the speed between two hills that are high enough for a movement the lowest is
  left, whatever comes after the second. One that is deeper than a valley need be stays one, since
  the peaks beside it only grow.
- Where a rest in a valley begins and ends is told by the movements before and after it: it is known
  with the next valley.
- No movement leads past a sure valley, so that the ways up to it do not depend on those behind.

So the stretch from the valley before the last final border up to the present is segmented again
every tenth of a second, by the same functions, and borders up to the last sure valley that has
another behind it are final. The beginning of a rest is final too once that lasts for 0.7 s: then it
is one beside movements of up to 3 s, of which the next may have begun slowly. That is measured, not
proven, on real recordings (``benchmarks/segmentation_online.py``).

What is to come cannot be measured: how fast this person moves has to be known, of earlier movements
(`measure_pace`). With the pace of the whole recording the borders are those of `find_movements`.
Who walks is looked at as from the laboratory, not from the person's back.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import SegmentationError
from besman.geometry.cubic_spline import interpolate_cubic
from besman.stages.segment.signals import measure_scaling, resample
from besman.stages.segment.stillness import least_speed
from besman.stages.segment.straightness import speed_ahead
from besman.stages.segment.valley_vmci import (
    EVIDENCE_HZ,
    MODEL,
    WaysThrough,
    find_ways,
    first_sample,
)
from besman.stages.segment.valleys import (
    GRID_HZ,
    Valley,
    ValleyShape,
    path_speed,
    smooth_grid,
    smooth_path,
    typical_speed,
)
from besman.stages.segment.vmci_online import check_sample

FloatArray = npt.NDArray[np.float64]

_STEP_S = 0.1
# How far low-pass and differences look ahead; the straightness looks on from there.
_REACH_S, _BEND_S = 0.22, 0.2
# What a stretch needs before it, to begin as in the whole: a spline forgets in 16 samples.
_BEFORE_S, _BEFORE_SAMPLES = 1.0, 24
_LONG_REST_S = 0.7
# Of a rest that lasts no more than this is looked at again and again.
_STILL_S = 5.0
# Who stirs without a sure valley is cut where it is most probable, so that memory stays bounded.
_LONGEST_S = 60.0


class Pace(NamedTuple):
    """How fast somebody moves, as far as borders depend on it.

    Attributes
    ----------
    typical : float
        Speed below which half of the way is covered, m/s.
    least : float
        Speed below which nothing but noise need be at work, m/s.
    change : array, shape (m,)
        Unit of the speed of each marker in the evidence, metres a sample; infinite of one that does
        not move.
    """

    typical: float
    least: float
    change: FloatArray


def measure_pace(
    time: npt.ArrayLike, paths: npt.ArrayLike, shape: ValleyShape | None = None
) -> Pace:
    """Measure the pace of paths, shape (T, m, 3), metres, at times (T,), seconds, T at least 4."""
    t, x = np.asarray(time, dtype=np.float64), np.asarray(paths, dtype=np.float64)
    shape = shape or ValleyShape()
    rate_hz = min(EVIDENCE_HZ, (len(t) - 1) / (t[-1] - t[0]))
    change = measure_scaling(resample(t, x, rate_hz)).change
    speed = path_speed(smooth_path(t, x, shape.smoothing_s))
    least = max(shape.least, least_speed(t, x, shape.smoothing_s))
    return Pace(typical_speed(speed) if speed.any() else 0.0, least, change)


def pool_paces(paces: Sequence[Pace]) -> Pace:
    """Return one pace for what is like several recordings; at least one."""
    squares = np.square([one.change for one in paces])
    moved = np.isfinite(squares)
    mean = np.where(moved, squares, 0.0).sum(axis=0) / np.maximum(moved.sum(axis=0), 1)
    return Pace(
        float(np.median([one.typical for one in paces])),
        float(np.median([one.least for one in paces])),
        np.where(moved.any(axis=0), np.sqrt(mean), np.inf),
    )


class OnlineMovements:
    """Segments a stream of positions into movements and rests.

    Parameters
    ----------
    pace : Pace
        Of earlier movements of the same markers; see `measure_pace`.
    sample_rate_hz : float
        Samples per second that are given.
    longest_s : float, optional
        Greatest duration of a movement, seconds.
    shape : ValleyShape, optional
        What counts as a valley and as a rest.

    Attributes
    ----------
    pending : list of int
        Borders that are most probable and not final: numbers of samples given before each.

    Raises
    ------
    SegmentationError
        If the rate is not positive, or the pace is of markers that do not move.
    """

    def __init__(
        self,
        pace: Pace,
        sample_rate_hz: float,
        longest_s: float | None = None,
        shape: ValleyShape | None = None,
    ) -> None:
        if not sample_rate_hz > 0:
            raise SegmentationError(f"rates must be positive, got {sample_rate_hz:g} Hz")
        if not np.isfinite(pace.change).any():
            raise SegmentationError("the pace comes from markers that do not move")
        self._pace, self._rate_hz = pace, sample_rate_hz
        self._shape = (shape or ValleyShape())._replace(least=pace.least)
        self._evidence_hz = min(EVIDENCE_HZ, sample_rate_hz)
        self._longest = None if longest_s is None else max(2, round(longest_s * self._evidence_hz))
        self._samples: list[FloatArray] = []
        self._n_gone = 0
        self._n_given = 0
        self._step = max(1, round(_STEP_S * sample_rate_hz))
        # On the grid: where the stretch begins, and up to where borders are final.
        self._first, self._final = 0, 0
        self._ahead = np.empty(0)
        self.pending: list[int] = []
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
        self._samples.append(check_sample(sample, len(self._pace.change), self._n_given))
        self._n_given += 1
        return self._segment() if self._n_given % self._step == 0 else []

    def finish(self) -> list[int]:
        """End the stream; return the borders that were not final yet, without the end itself.

        Raises
        ------
        SegmentationError
            If fewer than two samples were given.
        """
        if self._n_given < 2:
            raise SegmentationError(f"a segmentation needs at least 2 samples, got {self._n_given}")
        self._done = True
        return self._segment()

    def _segment(self) -> list[int]:
        """Segment the stretch since the last final border; return what became final."""
        found = self._find_ways()
        if found is None:
            self._forget(None)
            return []
        borders = [one + self._first for one in found.borders()[0] if one > 0]
        limit = self._n_grid if self._done else self._find_limit(found)
        borders = [one for one in borders if one > self._final]
        final = [one for one in borders if one <= limit]
        self.pending = self._to_rows([one for one in borders if one > limit])
        self._final = max([self._final, *final])
        if not self._done:
            self._forget(found)
        return self._to_rows(final)

    @property
    def _n_grid(self) -> int:
        return int(np.floor((self._n_given - 1) / self._rate_hz * GRID_HZ + 1e-6)) + 1

    def _find_limit(self, found: WaysThrough) -> int:
        """Return up to where no border can change any more, on the grid of the stream."""
        valleys, sure = found.valleys, found.sure
        n_whole = len(valleys)
        if valleys and valleys[-1].last == found.n_grid:
            rest = valleys[-1]
            if sure[-1] and rest.last - rest.first >= _LONG_REST_S * GRID_HZ:
                return rest.first + self._first
            n_whole -= 1
        while n_whole and not self._is_behind(valleys[n_whole - 1]):
            n_whole -= 1
        # Of the last one it is not known yet where its rest ends.
        known = np.flatnonzero(sure[: max(0, n_whole - 1)])
        if len(known):
            return int(valleys[known[-1]].last + self._first)
        return found.n_grid + self._first if found.n_grid > _LONGEST_S * GRID_HZ else 0

    def _is_behind(self, valley: Valley) -> bool:
        """Tell whether the peak after a valley makes it one, whatever comes."""
        known = self._ahead[: len(self._ahead) - round(_BEND_S * GRID_HZ)]
        floor = self._ahead[valley.first : valley.last + 1].min()
        least = max(self._shape.hill * self._pace.typical, self._shape.least)
        peak = known[valley.last :].max(initial=0.0)
        return bool(peak >= least and floor < self._shape.depth * peak)

    def _forget(self, found: WaysThrough | None) -> None:
        """Let the next stretch begin later, and forget the samples that it does not need."""
        self._first += self._find_beginning(found)
        before_s = max(_BEFORE_S, _BEFORE_SAMPLES / self._rate_hz)
        n_gone = int((self._first / GRID_HZ - before_s) * self._rate_hz) - self._n_gone
        if n_gone > 0:
            del self._samples[:n_gone]
            self._n_gone += n_gone

    def _find_beginning(self, found: WaysThrough | None) -> int:
        """Return where in the stretch the next one begins."""
        n = len(self._ahead)
        valleys = [] if found is None else found.valleys
        # Within a rest it does not matter where it begins.
        still = n if found is None else 0
        if valleys and valleys[-1].last == n and valleys[-1].first + self._first <= self._final:
            still = n - valleys[-1].first
        if still > 2 * _STILL_S * GRID_HZ:
            return n - round(_STILL_S * GRID_HZ)
        passed = [one for one in valleys if one.first > 0 and one.last + self._first <= self._final]
        if len(passed) > 1:
            first, last = passed[-2]
            return last - int(np.argmin(self._ahead[first : last + 1][::-1]))
        return n - round(_STILL_S * GRID_HZ) if n > 2 * _LONGEST_S * GRID_HZ else 0

    def _find_ways(self) -> WaysThrough | None:
        """Find the ways through what is known of the stretch; None if that is too little."""
        paths = np.stack(self._samples)
        rows = np.arange(self._n_gone, self._n_given) / self._rate_hz
        grid = int(np.ceil(rows[0] * GRID_HZ - 1e-6)) if self._n_gone else 0
        path = self._to_grid(rows, paths, np.arange(grid, self._n_grid, dtype=np.float64))
        speed = path_speed(path)
        ahead = speed_ahead(path, speed, GRID_HZ)
        cut = slice(
            self._first - grid, len(path) - (0 if self._done else round(_REACH_S * GRID_HZ))
        )
        speed, self._ahead = speed[cut], ahead[cut]
        if len(speed) < 2 or speed.max() < self._shape.least:
            return None
        speeds = self._take_speeds(rows, paths, len(speed))
        return find_ways(
            speed,
            self._ahead,
            speeds,
            self._evidence_hz,
            self._shape,
            self._longest,
            MODEL,
            self._pace.typical,
            self._first,
        )

    def _to_grid(self, rows: FloatArray, paths: FloatArray, grid: FloatArray) -> FloatArray:
        """Return the low-passed path at places of the grid, as `smooth_path` of the whole."""
        flat = (paths - paths[0]).reshape(len(paths), -1)
        if self._rate_hz > GRID_HZ * (1 + 1e-6):
            values = resample(rows, flat, GRID_HZ, grid[0] / GRID_HZ - rows[0])
        elif abs(self._rate_hz / GRID_HZ - 1) < 1e-9:
            values = flat
        else:
            values = interpolate_cubic(rows, flat, grid / GRID_HZ)
        return smooth_grid(values, self._shape.smoothing_s)

    def _take_speeds(self, rows: FloatArray, paths: FloatArray, n_grid: int) -> FloatArray:
        """Return the scaled speeds of the stretch for the evidence, shape (T, s)."""
        first = first_sample(self._first, self._evidence_hz)
        begin = int(np.ceil(rows[0] * self._evidence_hz - 1e-6)) if self._n_gone else 0
        samples = resample(rows, paths, self._evidence_hz, begin / self._evidence_hz - rows[0])
        moving = np.isfinite(self._pace.change)
        speeds = np.linalg.norm(np.gradient(samples[:, moving], axis=0), axis=2)
        speeds = speeds[first - begin :] / self._pace.change[moving]
        if self._done:
            return np.asarray(speeds)
        last = int(np.ceil((self._first + n_grid) / GRID_HZ * self._evidence_hz)) + 1 - first
        return np.asarray(speeds[:last])

    def _to_rows(self, borders: list[int]) -> list[int]:
        """Return borders on the grid as numbers of samples."""
        return [int(np.round(one / GRID_HZ * self._rate_hz)) for one in borders]
