"""Messages of a growing bag as frames: which topics, what is called how, at what rate."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from besman.exceptions import RecordingError, in_one_line
from besman.io.recordings.clock import whole_if_near
from besman.io.ros_messages import Definition, RawMessage, make_message_decoder
from besman.io.ros_points import UNNAMED, Points, Reader, choose_topics, name_topics
from besman.live.stream import StreamFormat
from besman.records import FloatArray

# The rate is not said: it is measured on so many frames.
_RATE_FRAMES = 20

Timed = tuple[int, FloatArray, int | None]
"""A frame: when, in nanoseconds, where, and the number that the source gave it."""


class RosFrames:
    """Makes frames of messages.

    Parameters
    ----------
    where : str
        For messages.
    asked : tuple of str
        Topics that are meant.

    Attributes
    ----------
    format : StreamFormat or None
        Known once there were enough messages, see `describe`.
    """

    def __init__(self, where: str, asked: tuple[str, ...]) -> None:
        self._where, self._asked = where, asked
        self.format: StreamFormat | None = None
        self._readers: dict[str, Reader] = {}
        self._called: dict[str, str] = {}
        self._decoders: dict[str, Callable[[bytes], Any]] = {}
        self._columns: dict[str, int] = {}
        self._frame: str | None = None
        self._is_stamped, self._is_whole, self._apart_ns = True, False, 0
        self._row: dict[int, tuple[float, float, float]] = {}
        self._row_ns = 0

    def describe(
        self, messages: Iterable[RawMessage], definitions: dict[str, Definition]
    ) -> StreamFormat | None:
        """Tell from messages what comes; None if there are too few yet.

        Raises
        ------
        RecordingError
            If none of their topics has markers, or not in one frame of reference.
        """
        messages = list(messages)
        kinds = {one.topic: one.kind for one in messages}
        if not kinds:
            return None
        try:
            self._readers, self._is_whole = choose_topics(kinds, self._asked, self._where)
        except RecordingError:
            if len(messages) < 10 * _RATE_FRAMES:
                # Others may come.
                return None
            raise
        self._called = name_topics(list(self._readers))
        self._decoders = {
            kinds[topic]: self._find_decoder(kinds[topic], definitions) for topic in self._readers
        }
        points = [(one.log_ns, found) for one in messages for found in self._read(one)]
        self._is_stamped = all(found.stamp_ns > 0 for _, found in points)
        rate_hz = self._measure(points)
        if rate_hz is None:
            return None
        names = tuple(dict.fromkeys(name for _, one in points for name in one.known))
        self._columns = {name: column for column, name in enumerate(names)}
        self._apart_ns = round(0.5e9 / rate_hz)
        topics = ", ".join(self._readers)
        self.format = StreamFormat(
            f"{self._where} ({topics:.100})", names or (None,) * UNNAMED, rate_hz
        )
        return self.format

    def take(self, message: RawMessage) -> Iterator[Timed]:
        """Take a message; yield the frames that are complete by it.

        Raises
        ------
        RecordingError
            If it is none, or in another frame of reference than those before.
        """
        if message.topic not in self._readers:
            return
        for one in self._read(message):
            stamp = one.stamp_ns if self._is_stamped else message.log_ns
            if self._is_whole:
                yield stamp, self._place_all(one), one.number
            else:
                yield from self._add(stamp, one)

    def flush(self) -> Iterator[Timed]:
        """Yield what is there of a frame that is not complete."""
        if self._row:
            assert self.format is not None
            positions = np.full((len(self.format.names), 3), np.nan)
            for column, place in self._row.items():
                positions[column] = place
            self._row = {}
            yield self._row_ns, positions, None

    def _find_decoder(self, kind: str, definitions: dict[str, Definition]) -> Callable[..., Any]:
        try:
            return make_message_decoder(kind, definitions.get(kind))
        except RecordingError as error:
            raise RecordingError(f"{self._where}: {error}") from None

    def _read(self, message: RawMessage) -> Iterator[Points]:
        """Read a message of a topic that is taken."""
        reader = self._readers.get(message.topic)
        if reader is None:
            return
        try:
            found = list(
                reader(self._decoders[message.kind](message.data), self._called[message.topic])
            )
        # Of a message that is not what its type says the library raises whatever comes of it.
        except Exception as error:
            raise RecordingError(
                f"{self._where}: {message.topic}: a message is no {message.kind:.100}: "
                f"{in_one_line(error):.100}"
            ) from None
        for one in found:
            if self._frame is None:
                self._frame = one.frame
            if one.frame != self._frame:
                raise RecordingError(
                    f"{self._where}: {message.topic}: places in the frames {self._frame!r:.40} and "
                    f"{one.frame!r:.40}; expected one: say which topics: ?topic=NAME,NAME"
                )
        yield from found

    def _measure(self, points: list[tuple[int, Points]]) -> float | None:
        """Return the rate of what came most often."""
        stamps: dict[tuple[str, ...], list[int]] = {}
        for log_ns, one in points:
            key = () if self._is_whole else one.known
            stamps.setdefault(key, []).append(one.stamp_ns if self._is_stamped else log_ns)
        times = np.unique(max(stamps.values(), key=len, default=[]))
        if len(times) < _RATE_FRAMES:
            return None
        return whole_if_near(1e9 / float(np.median(np.diff(times))))

    def _place_all(self, one: Points) -> FloatArray:
        assert self.format is not None
        positions = np.full((len(self.format.names), 3), np.nan)
        if isinstance(one.places, dict):
            for name, place in one.places.items():
                column = self._columns.get(name)
                if column is not None:
                    positions[column] = place
        elif None in self.format.names:
            positions[: len(one.places)] = one.places
        return positions

    def _add(self, stamp: int, one: Points) -> Iterator[Timed]:
        """Add a body to the frame of its time."""
        assert isinstance(one.places, dict)
        for name, place in one.places.items():
            column = self._columns.get(name)
            if column is None:
                continue
            if self._row and stamp < self._row_ns - self._apart_ns:
                # Of a frame that is past.
                continue
            if self._row and (column in self._row or stamp > self._row_ns + self._apart_ns):
                yield from self.flush()
            if not self._row:
                self._row_ns = stamp
            self._row[column] = place
            if len(self._row) == len(self._columns):
                yield from self.flush()
