"""Where a hand is slow, while the recording runs."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.compose.borders import REST_S, REST_SHARE, SMOOTH_S

FloatArray = npt.NDArray[np.float64]

# As scipy.ndimage.gaussian_filter1d: the kernel ends at so many standard deviations.
_TRUNCATE = 4.0


class ValleyStream:
    """Finds valleys of a hand's speed sample by sample, as `find_valleys` in a recording.

    A valley is known a quarter of a second later, as far as the smoothing reaches ahead; one that
    may begin a rest, once that has lasted long enough to be one.

    Parameters
    ----------
    rate_hz : float
        Samples per second.
    brisk_m_s : float
        Brisk speed of the hand, of earlier movements: see
        `besman.stages.compose.borders.measure_brisk`.
    """

    def __init__(self, rate_hz: float, brisk_m_s: float) -> None:
        self._rate_hz = rate_hz
        self._slow = REST_SHARE * brisk_m_s
        sigma = SMOOTH_S * rate_hz
        self._radius = int(_TRUNCATE * sigma + 0.5)
        weights = np.exp(-0.5 * (np.arange(-self._radius, self._radius + 1) / sigma) ** 2)
        self._weights = weights / weights.sum()
        self._window = np.empty((len(weights), 3))
        self._n_pushed = 0
        self._smooth: list[FloatArray] = []
        self._speeds: list[float] = []
        self._n_speeds = 0
        # Where the hand became slow, whether it rests, and minima of the speed since then.
        self._run: int | None = None
        self._rests = False
        self._held: list[int] = []
        self._rest_end: int | None = None
        self.valleys: list[int] = []

    @property
    def known_row(self) -> int:
        """Up to this row all valleys are known; negative at first."""
        if self._run is not None and not self._rests:
            return self._run - 1
        return self._n_speeds - 2

    def add(self, position: FloatArray) -> None:
        """Take the position of the hand, shape (3,), metres."""
        if self._n_pushed == 0:
            self._window[:] = position
        self._window[:-1] = self._window[1:]
        self._window[-1] = position
        self._n_pushed += 1
        if self._n_pushed > self._radius:
            self._take_smooth(self._weights @ self._window)

    def finish(self) -> None:
        """End the stream; all valleys are known then."""
        if self._n_pushed == 0:
            return
        last = self._window[-1].copy()
        for _ in range(self._radius):
            self.add(last)
        if len(self._smooth) > 1:
            self._take_speed(self._smooth[-2], self._smooth[-1], 1)
        self.valleys += self._held
        self._held, self._run = [], None

    def _take_smooth(self, position: FloatArray) -> None:
        """Take a smoothed row: the one before it has its central difference now."""
        self._smooth = [*self._smooth[-2:], position]
        if len(self._smooth) > 1:
            n_steps = len(self._smooth) - 1
            self._take_speed(self._smooth[0], position, n_steps)

    def _take_speed(self, one: FloatArray, two: FloatArray, n_steps: int) -> None:
        """Go on by one row, whose speed is that between two positions."""
        speed = float(np.linalg.norm(two - one)) / n_steps * self._rate_hz
        row = self._n_speeds
        self._n_speeds += 1
        before = self._speeds
        self._speeds = [*before[-1:], speed]
        if len(before) == 2 and before[1] < before[0] and before[1] <= speed:
            self._take_minimum(row - 1)
        if self._rest_end is not None:
            self.valleys.append(self._rest_end)
            self._rest_end = None
        if speed < self._slow:
            self._run = row if self._run is None else self._run
        if self._run is not None:
            self._go_on_slowly(row, speed < self._slow)

    def _take_minimum(self, row: int) -> None:
        """Take a minimum of the speed; whether one in a short run counts is told by its end."""
        if self._run is None:
            self.valleys.append(row)
        elif not self._rests:
            self._held.append(row)

    def _go_on_slowly(self, row: int, slow: bool) -> None:
        """Tell a rest from a run that is too short to be one."""
        assert self._run is not None
        lasted = row + 1 - self._run if slow else row - self._run
        if not self._rests and row > self._run and lasted >= REST_S * self._rate_hz:
            self._rests, self._held = True, []
            if self._run > 1:
                self.valleys.append(self._run)
        if slow:
            return
        if self._rests:
            self._rest_end = row if row > 1 else None
        self.valleys += self._held
        self._held, self._run, self._rests = [], None, False
