"""What every source of a stream gives: names, a rate, and packets with a time and positions."""

from __future__ import annotations

import queue
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from besman.exceptions import BesmanError
from besman.records import FloatArray


@dataclass(frozen=True)
class StreamFormat:
    """What a stream says of itself before the first packet.

    Attributes
    ----------
    source : str
        Name for messages.
    names : tuple of str or None, length M
        Of its markers.
    rate_hz : float
        Frames a second.
    """

    source: str
    names: tuple[str | None, ...]
    rate_hz: float


class Packet(NamedTuple):
    """One frame as it came.

    Attributes
    ----------
    time_s : float
        On the source's clock.
    positions : array, shape (M, 3)
        Metres, z up; NaN where a marker was not seen.
    arrived_s : float
        When it was received, on the clock of `time.perf_counter`.
    number : int, optional
        Of the frame, where the source counts.
    """

    time_s: float
    positions: FloatArray
    arrived_s: float
    number: int | None = None


class Source(Protocol):
    """A stream to be read."""

    @property
    def ended(self) -> bool:
        """Whether no packet will come any more."""

    def open(self) -> StreamFormat:
        """Connect; say what will come.

        Raises
        ------
        BesmanError
            If nobody answers, or the stream cannot be used.
        """

    def start(self) -> None:
        """Have packets sent, or begin to take them: who reads them is ready."""

    def read(self, timeout_s: float) -> Packet | None:
        """Return the next packet; None if none came in that time.

        Raises
        ------
        BesmanError
            If the stream cannot be read any more.
        """

    def close(self) -> None:
        """Let the source go; to be called in any case."""


class Inbox:
    """Packets that a thread receives, so that none waits in a socket; one thread reads them.

    Parameters
    ----------
    quiet_s : float
        A source that had begun has ended when nothing came for so long.
    clock : callable
        Seconds.
    """

    def __init__(self, quiet_s: float, clock: Callable[[], float]) -> None:
        self._queue: queue.SimpleQueue[Packet | BesmanError | None] = queue.SimpleQueue()
        self._quiet_s, self._clock = quiet_s, clock
        self._last_s: float | None = None
        self.ended = False

    def put(self, packet: Packet | BesmanError | None) -> None:
        """Take a packet, what went wrong, or None at the end."""
        self._queue.put(packet)

    def get(self, timeout_s: float) -> Packet | None:
        """Return the next packet, as `Source.read`."""
        try:
            found = self._queue.get(timeout=timeout_s) if timeout_s > 0 else self._queue.get(False)
        except queue.Empty:
            # Who has not sent anything yet is waited for.
            if self._last_s is not None:
                self.ended |= self._clock() - self._last_s > self._quiet_s
            return None
        if isinstance(found, BesmanError):
            self.ended = True
            raise found
        self.ended |= found is None
        self._last_s = self._clock()
        return found
