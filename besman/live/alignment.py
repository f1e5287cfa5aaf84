"""Packets of a network as frames at an even rate: in order, none twice, a gap where one is lost."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from besman.live.stream import Packet
from besman.records import FloatArray

# How much of the time by which a packet is early or late moves the clock, of a source that does
# not count its frames.
_DRIFT = 0.02
# A packet that is nearer than so many frames to the one that is due is that one.
_SHAKEN = 0.8
# No clock counts farther, not even from 1970 on.
_LATEST_S = 1e12
# So many rows are remembered, to tell packets that come twice from those that come too late.
_REMEMBERED = 1000


class Frame(NamedTuple):
    """One row of the stream.

    Attributes
    ----------
    positions : array, shape (M, 3)
        Metres; NaN where a marker was not seen, and in a frame that was lost.
    arrived_s : float
        As of the packet; of a frame that was lost when it was given up.
    sent_s : float
        The packet's time on the source's clock; NaN of a frame that was lost.
    """

    positions: FloatArray
    arrived_s: float
    sent_s: float


@dataclass
class Delivery:
    """What became of the packets.

    Attributes
    ----------
    packets : int
        That came.
    lost : int
        Frames that never came, or later than could be waited for.
    late : int
        Packets that came after their frame had been given up.
    doubled : int
        Packets whose frame was there.
    restarts : int
        How often the source began to count, or its clock to run, anew.
    left_out_s : float
        Silence beyond the longest that is kept, seconds.
    """

    packets: int = 0
    lost: int = 0
    late: int = 0
    doubled: int = 0
    restarts: int = 0
    left_out_s: float = 0.0


class Aligner:
    """Puts packets in order.

    A packet that is next in order is passed on at once. Where one is missing the others wait for
    it up to `patience_s`; then its frame is a gap. A source whose count goes back begins anew: the
    time between, by the clock of this machine, is a gap.

    Parameters
    ----------
    rate_hz : float
    n_markers : int
    patience_s : float
        How long to wait for what is missing.
    longest_s : float
        Longest silence that becomes a gap; what is longer is cut to it.
    """

    def __init__(
        self, rate_hz: float, n_markers: int, patience_s: float = 0.06, longest_s: float = 10.0
    ) -> None:
        self.delivery = Delivery()
        self._rate_hz, self._patience_s = rate_hz, patience_s
        self._longest = math.ceil(longest_s * rate_hz)
        self._most_late = max(3, math.ceil(patience_s * rate_hz))
        self._gap = np.full((n_markers, 3), np.nan)
        self._held: dict[int, Packet] = {}
        self._seen: set[int] = set()
        self._next = 0
        self._first: int | None = None
        self._origin_s: float | None = None
        self._last_s, self._last_time_s, self._last_number = 0.0, -math.inf, -1
        self._n_back = 0

    @property
    def waits(self) -> bool:
        """Whether packets wait for one that is missing."""
        return bool(self._held)

    def take(self, packet: Packet) -> list[Frame]:
        """Take a packet; return the frames that are complete."""
        self.delivery.packets += 1
        number = packet.number if packet.number is not None else self._count(packet.time_s)
        if self._first is None:
            self._first = number
        frames: list[Frame] = []
        row = number - self._first
        if row < self._next:
            self._n_back += 1
            if self._next - row > 10 * self._most_late or self._n_back > self._most_late:
                frames = self.flush()
                row = self._begin_anew(number, packet)
        if row < self._next or row in self._held:
            is_doubled = row in self._held or row in self._seen
            self.delivery.doubled += is_doubled
            self.delivery.late += not is_doubled
            return frames
        self._n_back = 0
        if row - self._next > self._longest:
            frames += self.flush()
        beyond = row - self._next - self._longest
        if beyond > 0:
            self.delivery.left_out_s += beyond / self._rate_hz
            self._first += beyond
            row -= beyond
        self._held[row] = packet
        self._last_s = packet.arrived_s
        return frames + self.release(packet.arrived_s)

    def release(self, now_s: float) -> list[Frame]:
        """Return the frames that are complete, and those that are given up at this time."""
        frames = []
        while self._held:
            packet = self._held.pop(self._next, None)
            if packet is not None:
                frames.append(Frame(packet.positions, packet.arrived_s, packet.time_s))
                self._seen.add(self._next)
                self._seen.discard(self._next - _REMEMBERED)
            else:
                waited_s = now_s - min(one.arrived_s for one in self._held.values())
                if waited_s < self._patience_s and len(self._held) < self._longest:
                    break
                given_up_s = now_s if now_s < math.inf else self._last_s
                frames.append(Frame(self._gap, given_up_s, math.nan))
                self.delivery.lost += 1
            self._next += 1
        return frames

    def flush(self) -> list[Frame]:
        """Return all frames that wait; what is missing between them is given up."""
        return self.release(math.inf)

    def _begin_anew(self, number: int, packet: Packet) -> int:
        """Let a number be that of the row that is due now; return the row."""
        self.delivery.restarts += 1
        silent = max(0, round((packet.arrived_s - self._last_s) * self._rate_hz) - 1)
        row = self._next + min(silent, self._longest)
        if packet.number is None:
            number = row
            self._first, self._last_number = 0, row
            self._origin_s, self._last_time_s = None, -math.inf
            if abs(packet.time_s) <= _LATEST_S:
                self._origin_s = packet.time_s - row / self._rate_hz
                self._last_time_s = packet.time_s
        else:
            self._first = number - row
        self._seen.clear()
        self._n_back = 0
        return row

    def _count(self, time_s: float) -> int:
        """Return the number of a frame by its time; the clock follows what drifts slowly."""
        if not abs(time_s) <= _LATEST_S:
            # A clock that says nothing: the packet is the next one.
            self._last_number += 1
            return self._last_number
        if self._origin_s is None:
            self._origin_s = time_s - (self._last_number + 1) / self._rate_hz
        exact = (time_s - self._origin_s) * self._rate_hz
        number, due = round(exact), self._last_number + 1
        if abs(exact - due) < _SHAKEN and time_s > self._last_time_s:
            number = due
        if number >= due:
            self._origin_s += _DRIFT * (exact - number) / self._rate_hz
            self._last_number, self._last_time_s = number, time_s
        return number
