"""What the page draws of a recording: positions and speeds, decimated to what a screen can show."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from besman.exceptions import WebError, nearest
from besman.stages.label.joined_trajectories import WovenRecording

IntArray = npt.NDArray[np.int64]
Float32 = npt.NDArray[np.float32]

FACTOR = 8
"""Samples of a level that one bin of the next level stands for."""

CHUNK = 4096
"""Samples or bins that are sent at once."""

GROUPS = ("positions", "velocities", "speeds")

# Differences over so many seconds to both sides: noise of the cameras is no movement.
_LAG_S = 0.02
_FEWEST_BINS = 1024


class Pyramid:
    """Channels with their least and greatest values over ever longer stretches.

    The samples themselves are asked for, `CHUNK` at a time, and not kept.

    Parameters
    ----------
    samples : callable
        Takes half-open rows; returns the channels there, float32 array, shape (C, N), NaN where
        nothing is known.
    n_samples : int
    """

    def __init__(self, samples: Callable[[int, int], Float32], n_samples: int) -> None:
        self._samples, self._n_samples = samples, n_samples
        self._levels: list[Float32] = []
        if n_samples > _FEWEST_BINS:
            self._levels.append(self._first_level())
        while self._levels and self._levels[-1].shape[1] > _FEWEST_BINS:
            low, high = np.moveaxis(self._levels[-1], 2, 0)
            self._levels.append(np.stack((_reduce(low, np.fmin), _reduce(high, np.fmax)), axis=2))

    def _first_level(self) -> Float32:
        """Return the least and greatest of each `FACTOR` samples, shape (C, N, 2)."""
        level = np.empty((0, 0, 2), dtype=np.float32)
        for start in range(0, self._n_samples, CHUNK):
            some = self._samples(start, min(start + CHUNK, self._n_samples))
            if start == 0:
                n_bins = -(-self._n_samples // FACTOR)
                level = np.empty((len(some), n_bins, 2), dtype=np.float32)
            bins = slice(start // FACTOR, (start + CHUNK) // FACTOR)
            level[:, bins, 0] = _reduce(some, np.fmin)
            level[:, bins, 1] = _reduce(some, np.fmax)
        return level

    @property
    def n_levels(self) -> int:
        """Levels, the samples themselves included."""
        return 1 + len(self._levels)

    def chunk(self, level: int, index: int) -> Float32:
        """Return a piece of a level.

        Returns
        -------
        array, shape (C, N) of level 0, (C, N, 2) of others
            The samples, or the least and greatest value of each bin; N is at most `CHUNK`.
        """
        start, stop = index * CHUNK, (index + 1) * CHUNK
        if level == 0:
            start, stop = min(start, self._n_samples), min(stop, self._n_samples)
            return np.ascontiguousarray(self._samples(start, stop))
        return np.ascontiguousarray(self._levels[level - 1][:, start:stop])


def _reduce(values: Float32, function: np.ufunc) -> Float32:
    """Take `FACTOR` values together; NaN only where all are."""
    n = values.shape[1]
    starts = np.arange(0, n, FACTOR)
    return np.asarray(function.reduceat(values, starts, axis=1), dtype=np.float32)


class SignalPyramids:
    """The signals of one recording, by groups.

    ``positions`` of a marker are x, y, z in metres, ``velocities`` those in metres per second,
    ``speeds`` the speed of every marker and, last, of all together.

    Parameters
    ----------
    recording : WovenRecording
        T samples of M markers.
    """

    def __init__(self, recording: WovenRecording) -> None:
        self.n_samples, self.n_markers = len(recording.time), len(recording.names)
        self._recording = recording
        self._lag = max(1, round(_LAG_S * recording.rate_hz))
        self._pyramids: dict[tuple[str, int], Pyramid] = {}
        self.n_levels = self.pyramid("speeds", 0).n_levels

    def frames(self, index: int) -> Float32:
        """Return the positions of all markers in a piece of the recording, shape (N, M, 3)."""
        start, stop = (min(max(0, k) * CHUNK, self.n_samples) for k in (index, index + 1))
        return self._recording.rows(start, stop).astype(np.float32)

    def sketch(self) -> tuple[Float32, int]:
        """Return every n-th sample of all markers, at most `CHUNK`, shape (N, M, 3), and n."""
        step = -(-self.n_samples // CHUNK)
        return self._recording.rows(0, self.n_samples, step=step).astype(np.float32), step

    def pyramid(self, group: str, marker: int) -> Pyramid:
        """Return a group's signals, of one marker where they are of markers.

        Raises
        ------
        WebError
            If there is no such group or marker.
        """
        if group not in GROUPS:
            raise WebError(f"no group of signals {group!r}; {nearest(group, GROUPS)}")
        if not 0 <= marker < self.n_markers:
            raise WebError(f"no marker {marker}; expected 0 to {self.n_markers - 1}")
        key = (group, 0 if group == "speeds" else marker)
        if key not in self._pyramids:
            samples = {
                "positions": lambda start, stop: self._paths([marker], start, stop)[0],
                "velocities": lambda start, stop: self._velocities([marker], start, stop)[0],
                "speeds": self._speeds,
            }[group]
            self._pyramids[key] = Pyramid(samples, self.n_samples)
        return self._pyramids[key]

    def chunk(self, group: str, marker: int, level: int, index: int) -> Float32:
        """Return a piece of a level of `pyramid`.

        Raises
        ------
        WebError
            If there is no such piece.
        """
        pyramid = self.pyramid(group, marker)
        if not 0 <= level < pyramid.n_levels or not 0 <= index * CHUNK < self.n_samples:
            raise WebError(
                f"no piece {index} of level {level}; there are {pyramid.n_levels} levels"
            )
        return pyramid.chunk(level, index)

    def _paths(self, markers: Sequence[int], start: int, stop: int) -> Float32:
        """Return the positions of some markers, shape (K, 3, N)."""
        places = self._recording.rows(start, stop, markers)
        return places.transpose(1, 2, 0).astype(np.float32, order="C")

    def _velocities(self, markers: Sequence[int], start: int, stop: int) -> Float32:
        """Return central differences, shape (K, 3, N); NaN where a position is missing."""
        low, high = max(0, start - self._lag), min(self.n_samples, stop + self._lag)
        x, time = self._paths(markers, low, high), self._recording.time[low:high]
        after: slice | IntArray = slice(2 * self._lag, None)
        before: slice | IntArray = slice(None, -2 * self._lag)
        if high - low < stop - start + 2 * self._lag:
            # At both ends with what there is.
            rows = np.arange(start, stop)
            after = np.minimum(rows + self._lag, self.n_samples - 1) - low
            before = np.maximum(rows - self._lag, 0) - low
        span = (time[after] - time[before]).astype(np.float32)
        # In one order, because sums over others round differently.
        return np.ascontiguousarray((x[..., after] - x[..., before]) / span)

    def _speeds(self, start: int, stop: int) -> Float32:
        """Return the speeds of all markers and their sum, shape (M + 1, N).

        The sum is the mean of the markers seen, times their number, so that it does not fall where
        a marker is hidden.
        """
        speeds = np.full((self.n_markers + 1, stop - start), np.nan, dtype=np.float32)
        # Of the others nothing is seen: what has no name is there for moments.
        markers = self._recording.columns_in(start - self._lag, stop + self._lag)
        x, y, z = np.moveaxis(self._velocities(markers, start, stop), 1, 0)
        some = np.sqrt(x * x + y * y + z * z)
        speeds[markers] = some
        seen = np.isfinite(some)
        count = seen.sum(axis=0)
        total = np.where(seen, some, 0).sum(axis=0)
        known = count > 0
        speeds[-1, known] = (total / np.maximum(count, 1) * self.n_markers)[known]
        return speeds
