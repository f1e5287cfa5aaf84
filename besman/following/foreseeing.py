"""What comes next in a stream, looked at again every tenth of a second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.following.beginnings import end_rows
from besman.following.foresight import Foresight, Outlook

FloatArray = npt.NDArray[np.float64]

_EVERY_S = 0.1


@dataclass(frozen=True)
class BlockForecast:
    """What a stream is expected to do.

    Attributes
    ----------
    of : str
        Name of the arm.
    row : int
        Sample after which it was told.
    start : int
        Row at which the present block began: the last border that is known.
    label, probability : str and float
        What that block most probably is.
    next_label, next_probability : str and float
        The movement that most probably follows; a rest is none.
    next_row : int, optional
        Row at which that movement starts, in the median; None if no movement ever followed.
    """

    of: str
    row: int
    start: int
    label: str
    probability: float
    next_label: str
    next_probability: float
    next_row: int | None


class BlockForeseer:
    """Keeps the outlook of one arm current.

    Parameters
    ----------
    of : str
        Name of the arm.
    foresight : Foresight
    markers : sequence of str, length M
    rate_hz : float
    source : str
        Named in errors.

    Attributes
    ----------
    forecast : BlockForecast, optional
        The last one.

    Raises
    ------
    RecognitionError
        If there is no person among the markers.
    """

    def __init__(
        self, of: str, foresight: Foresight, markers: Sequence[str], rate_hz: float, source: str
    ) -> None:
        self._of, self._foresight, self._rate_hz = of, foresight, rate_hz
        self._parts = foresight.parts(markers, source)
        self._every = max(1, round(_EVERY_S * rate_hz))
        self._due = 0
        self._before: tuple[str, ...] | None = None
        self._start = 0
        self.forecast: BlockForecast | None = None

    @property
    def n_ahead(self) -> int:
        """How many rows before a border are looked at."""
        return end_rows(self._rate_hz)

    @property
    def columns(self) -> list[int]:
        """Columns of the markers that are looked at."""
        return self._parts.columns

    def is_due(self, n_blocks: int, now: int) -> bool:
        """Tell whether a look would say anything new: another block, or a tenth of a second."""
        return now >= self._due or self._before is None or n_blocks != len(self._before)

    def update(
        self,
        blocks: Sequence[tuple[int, int, str]],
        now: int,
        positions: FloatArray,
        first: int = 0,
    ) -> bool:
        """Look again, if it is time.

        Parameters
        ----------
        blocks : sequence of (int, int, str)
            Blocks so far: half-open rows and label.
        now : int
            Samples so far.
        positions : array, shape (k, M, 3)
            Rows `first` to `now` - 1, metres; NaN where a marker is not seen.
        first : int
            Row of the first of them; not after the last border, and `n_ahead` rows before it, if
            they are there: they tell whether the hand has come to rest.

        Returns
        -------
        bool
            Whether another block, or another that follows, is the most probable now.
        """
        if not self.is_due(len(blocks), now):
            return False
        before = tuple(label for _, _, label in blocks)
        self._start = blocks[-1][1] if blocks else 0
        if before != self._before:
            ending = positions[: max(0, self._start - first)]
            speed_m_s = self._parts.end_speed(ending, self._rate_hz)
            self._expected = self._foresight.expect(before, speed_m_s)
            starts_s = [start / self._rate_hz for start, _, _ in blocks]
            self._pace = self._foresight.pace(before, starts_s)
        self._before, self._due = before, now + self._every
        seen = self._parts.extract(positions[max(0, self._start - first) :], self._rate_hz)
        return self._keep(self._foresight.weigh(self._expected, seen), now)

    def _keep(self, outlook: Outlook, now: int) -> bool:
        """Make the forecast; tell whether it says something else than the last one."""
        elapsed_s = (now - self._start) / self._rate_hz
        wait_s = self._foresight.seconds_to_next(outlook.label, elapsed_s, self._pace)
        last = self.forecast
        self.forecast = BlockForecast(
            self._of,
            now,
            self._start,
            outlook.label,
            float(outlook.now.max()),
            outlook.next_label,
            float(outlook.following.max()),
            None if np.isnan(wait_s) else now + round(wait_s * self._rate_hz),
        )
        said = (self.forecast.start, self.forecast.label, self.forecast.next_label)
        return last is None or said != (last.start, last.label, last.next_label)
