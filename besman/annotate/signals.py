"""What the page draws of a recording: positions and speeds, decimated to what a screen can show."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import WebError, nearest
from besman.records import FloatArray

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

    Parameters
    ----------
    values : array, shape (C, T)
        NaN where nothing is known.
    """

    def __init__(self, values: FloatArray | Float32) -> None:
        self._levels = [np.ascontiguousarray(values, dtype=np.float32)]
        low = high = self._levels[0]
        while low.shape[1] > _FEWEST_BINS:
            low, high = _reduce(low, np.fmin), _reduce(high, np.fmax)
            self._levels.append(np.stack((low, high), axis=2))

    @property
    def n_levels(self) -> int:
        """Levels, the samples themselves included."""
        return len(self._levels)

    def chunk(self, level: int, index: int) -> Float32:
        """Return a piece of a level.

        Returns
        -------
        array, shape (C, N) of level 0, (C, N, 2) of others
            The samples, or the least and greatest value of each bin; N is at most `CHUNK`.
        """
        return np.ascontiguousarray(self._levels[level][:, index * CHUNK : (index + 1) * CHUNK])


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
    time : array, shape (T,)
        Seconds.
    positions : array, shape (T, M, 3)
        Metres; NaN where not seen.
    rate_hz : float
    """

    def __init__(self, time: FloatArray, positions: FloatArray, rate_hz: float) -> None:
        self.n_samples, self.n_markers = positions.shape[:2]
        self._positions = positions
        self._time = time
        self._lag = max(1, round(_LAG_S * rate_hz))
        self._pyramids: dict[tuple[str, int], Pyramid] = {}
        self.n_levels = self.pyramid("speeds", 0).n_levels

    def frames(self, index: int) -> Float32:
        """Return the positions of all markers in a piece of the recording, shape (N, M, 3)."""
        return self._positions[index * CHUNK : (index + 1) * CHUNK].astype(np.float32)

    def sketch(self) -> tuple[Float32, int]:
        """Return every n-th sample of all markers, at most `CHUNK`, shape (N, M, 3), and n."""
        step = -(-self.n_samples // CHUNK)
        return self._positions[::step].astype(np.float32, order="C"), step

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
            values = {
                "positions": lambda: self._path(marker),
                "velocities": lambda: self._velocities(marker),
                "speeds": self._speeds,
            }[group]()
            self._pyramids[key] = Pyramid(values)
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

    def _path(self, marker: int) -> Float32:
        """Return the positions of one marker, shape (3, T)."""
        return self._positions[:, marker].T.astype(np.float32, order="C")

    def _velocities(self, marker: int) -> Float32:
        """Return central differences, shape (3, T); NaN where a position is missing."""
        x = self._path(marker)
        n, lag = x.shape[1], self._lag
        velocities: Float32 = np.empty_like(x)
        if n > 2 * lag:
            span = (self._time[2 * lag :] - self._time[: -2 * lag]).astype(np.float32)
            velocities[:, lag:-lag] = (x[:, 2 * lag :] - x[:, : -2 * lag]) / span
        rows = np.arange(n)
        # At both ends with what there is.
        ends = rows if n <= 2 * lag else np.concatenate([rows[:lag], rows[-lag:]])
        after, before = np.minimum(ends + lag, n - 1), np.maximum(ends - lag, 0)
        span = (self._time[after] - self._time[before]).astype(np.float32)
        velocities[:, ends] = (x[:, after] - x[:, before]) / span
        return velocities

    def _speeds(self) -> Float32:
        """Return the speeds of all markers and their sum, shape (M + 1, T).

        The sum is the mean of the markers seen, times their number, so that it does not fall where
        a marker is hidden.
        """
        speeds = np.empty((self.n_markers + 1, self.n_samples), dtype=np.float32)
        for marker in range(self.n_markers):
            x, y, z = self._velocities(marker)
            speeds[marker] = np.sqrt(x * x + y * y + z * z)
        for start in range(0, self.n_samples, CHUNK):
            some = speeds[:, start : start + CHUNK]
            seen = np.isfinite(some[:-1])
            count = seen.sum(axis=0)
            total = np.where(seen, some[:-1], 0).sum(axis=0)
            some[-1] = np.where(count > 0, total / np.maximum(count, 1) * self.n_markers, np.nan)
        return speeds
