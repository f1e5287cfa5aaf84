"""Markers of OptiTrack Motive by its NatNet protocol.

The extra ``optitrack``: ``natnet`` (MIT), which reads datagrams. A thread receives; who follows
the stream is not waited for. Tried on what `besman.live.play_natnet` serves, not on a Motive.
"""

from __future__ import annotations

import math
import threading
import time
from typing import Any

import numpy as np

from besman.exceptions import RecordingError, in_one_line, why_not_there
from besman.io.recordings.conventions import turn
from besman.live.natnet_link import NatNetLink, read_datagram
from besman.live.stream import Inbox, Packet, StreamFormat
from besman.records import Axis, FloatArray

PORT = 1510
"""Where Motive listens for commands."""

UNNAMED = 64
"""Most markers without a name in a packet; others are left out."""

_ANSWER_S = 5.0
# The protocol does not say the rate: it is measured on the first frames.
_RATE_FRAMES = 20
# Motive's own name for the set of all markers.
_ALL = "all"


class NatNetSource:
    """``natnet://HOST[:PORT]``.

    Parameters
    ----------
    host, port
        Where Motive runs; it has to stream by unicast.
    local : str
        Address of this machine that is sent to.
    up : str, optional
        Which axis points up; Motive's own setting is y.
    wait_s : float
        How long a stream that had begun may be silent, seconds.
    """

    def __init__(
        self,
        host: str,
        port: int = PORT,
        local: str = "127.0.0.1",
        up: Axis | None = None,
        wait_s: float = 10.0,
    ) -> None:
        self._host, self._port, self._local, self._up = host, port, local, up or "y"
        self._name = f"natnet://{host}:{port}"
        self._inbox = Inbox(wait_s, time.perf_counter)
        self._link: NatNetLink | None = None
        self._version: Any = None
        self._sets: tuple[tuple[str, int], ...] | None = None
        self._names: tuple[str | None, ...] = ()
        self._met, self._described = threading.Event(), threading.Event()
        self._measured = threading.Event()
        self._times: list[tuple[int, float]] = []
        self._problem = ""

    @property
    def ended(self) -> bool:
        """See `besman.live.stream.Source.ended`."""
        return self._inbox.ended

    def open(self) -> StreamFormat:
        """Connect, ask for names, and measure the rate; see `besman.live.stream.Source.open`."""
        try:
            import natnet  # noqa: F401
        except ImportError as error:
            reason = why_not_there(error, "natnet", "besman[optitrack]")
            raise RecordingError(f"{self._name}: {reason}") from None
        said = ""
        try:
            self._link = NatNetLink(self._host, self._port, self._local, self.hear)
            answers = self._link.ask_who(self._met, _ANSWER_S)
        except OSError as error:
            answers, said = False, f" ({in_one_line(error):.120})"
        if self._link is None or not answers:
            self.close()
            raise RecordingError(
                f"{self._name}: no answer within {_ANSWER_S:g} s{said}; expected Motive that "
                f"streams by unicast to {self._local}; ?local=ADDRESS says another of this machine"
            )
        if self._link.ask_what(self._described, _ANSWER_S):
            self._measured.wait(_ANSWER_S)
        try:
            return self.describe()
        except RecordingError:
            self.close()
            raise

    def describe(self) -> StreamFormat:
        """Return what comes, of what was heard.

        Raises
        ------
        RecordingError
            If that is not enough.
        """
        if not self._described.is_set():
            raise RecordingError(f"{self._name}: says nothing of its markers{self._why_not()}")
        if not self._measured.is_set():
            raise RecordingError(
                f"{self._name}: sends no frames, or none with a time that rises{self._why_not()}; "
                "expected Motive to be live, or to play"
            )
        (first, begun_s), (last, ended_s) = self._times[0], self._times[-1]
        rate_hz = (last - first) / (ended_s - begun_s)
        # Times are in steps of a microsecond or so: what is near a whole number is that.
        if rate_hz < math.inf and abs(rate_hz - round(rate_hz)) < 1e-3 * rate_hz:
            rate_hz = float(round(rate_hz))
        return StreamFormat(self._name, self._names, rate_hz)

    def start(self) -> None:
        """Do nothing: what came since the connection is there to be read."""

    def read(self, timeout_s: float) -> Packet | None:
        """Return the next packet; see `Source.read`."""
        return self._inbox.get(timeout_s)

    def close(self) -> None:
        """End the thread."""
        if self._link is not None:
            self._link.close()
            self._link = None

    def hear(self, data: bytes) -> None:
        """Take a datagram, in the thread of the link."""
        try:
            found = read_datagram(data, self._version)
        except RecordingError as error:
            self._problem = str(error)
            self._inbox.put(RecordingError(f"{self._name}: {error}"))
            return
        if hasattr(found, "nat_net_protocol_version"):
            self._version = found.nat_net_protocol_version
            self._met.set()
        elif hasattr(found, "marker_sets") and hasattr(found, "suffix"):
            self._take(found)
        elif found is not None and not self._described.is_set():
            self._read_names(found)

    def _why_not(self) -> str:
        return f" ({self._problem})" if self._problem else ""

    def _read_names(self, found: Any) -> None:
        """Read names out of a description."""
        sets = [one for one in found.marker_sets if one.name.lower() != _ALL and one.marker_names]
        several = len(sets) > 1
        self._names = tuple(
            f"{one.name}:{name}" if several else name for one in sets for name in one.marker_names
        )
        if not sets:
            self._names = (None,) * UNNAMED
        self._sets = tuple((one.name, len(one.marker_names)) for one in sets)
        self._described.set()

    def _take(self, frame: Any) -> None:
        """Take a frame."""
        arrived_s = time.perf_counter()
        if self._sets is None:
            return
        number, time_s = int(frame.prefix.frame_number), float(frame.suffix.timestamp)
        if not self._measured.is_set():
            self._measure(number, time_s)
        positions = read_frame(frame, self._sets)
        if positions is None:
            self._inbox.put(
                RecordingError(
                    f"{self._name}: other markers in a frame than in its description; expected "
                    f"{len(self._names)}: were assets changed while it streamed?"
                )
            )
            return
        if self._up != "z":
            positions = turn(positions, self._up)
        self._inbox.put(Packet(time_s, positions, arrived_s, number))

    def _measure(self, number: int, time_s: float) -> None:
        """Note when frames were, until their rate can be told."""
        if self._times and not (number > self._times[-1][0] and time_s > self._times[-1][1]):
            self._times = []
        self._times.append((number, time_s))
        if len(self._times) >= _RATE_FRAMES:
            self._measured.set()


def read_frame(frame: Any, sets: tuple[tuple[str, int], ...]) -> FloatArray | None:
    """Return the positions of a frame of ``natnet``.

    Parameters
    ----------
    frame : natnet.DataFrame
    sets : tuple of (str, int)
        Name and number of markers of each set that was described; none: markers without a name.

    Returns
    -------
    array, shape (M, 3), or None
        As the capture system has them, metres; NaN where not seen. None if the frame has others.
    """
    if not sets:
        positions = np.full((UNNAMED, 3), np.nan)
        seen = np.array(frame.unlabeled_marker_pos[:UNNAMED], dtype=np.float64).reshape(-1, 3)
        positions[: len(seen)] = seen
        return positions
    found = {one.model_name: one.marker_pos_list for one in frame.marker_sets}
    if any(len(found.get(name, ())) != n for name, n in sets):
        return None
    places = [place for name, _ in sets for place in found[name]]
    positions = np.array(places, dtype=np.float64).reshape(-1, 3)
    # A marker that is hidden is at the origin, to the last bit.
    positions[~positions.any(axis=1)] = np.nan
    return positions
