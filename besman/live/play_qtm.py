"""A recording, served as Qualisys Track Manager serves a measurement: over loopback, to its client.

For trying what follows a stream without a laboratory. What it speaks is as much of the real-time
protocol as a client that streams 3D markers asks for.
"""

from __future__ import annotations

import asyncio
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np

from besman.exceptions import WebError
from besman.geometry.gaps import find_seen
from besman.live.playing import schedule_frames
from besman.live.qtm_source import PORT, UNNAMED_MARKER
from besman.records import Recording

_HOST = "127.0.0.1"
_ERROR, _COMMAND, _XML, _DATA, _NO_MORE = range(5)
_HEAD = struct.Struct("<II")
# Time in microseconds, frame, components; size and type of the one component; markers, two rates.
_FRAME = struct.Struct("<qIIIIIhh")
_TYPE_3D, _TYPE_UNNAMED = 1, 2
_VERSIONS = ("1.8", "1.25")
_LARGEST_COMMAND = 1 << 16
_LEAVE_S = 0.2


@dataclass(frozen=True)
class Delays:
    """What the network does: arguments of `besman.live.playing.schedule_frames`."""

    pace: float = 1.0
    lose: float = 0.0
    late_s: float = 0.0
    seed: int = 0


AS_SENT = Delays()
"""Nothing is lost, nothing late."""


def play_as_qtm(
    recording: Recording,
    delays: Delays = AS_SENT,
    port: int = PORT,
    say: Callable[[str], None] = lambda line: None,
) -> None:
    """Serve a recording to the first client that asks for frames; return when it is over.

    Of one without names there are no labels: every unbroken trajectory has a number of its own.

    Times in packets are those of this machine's clock (`time.perf_counter`) when a frame was due at
    the recording's own pace.

    Parameters
    ----------
    recording : Recording
    delays : Delays
    port : int
        0 for any that is free.
    say : callable
        Is told where it listens, and when it plays.

    Raises
    ------
    WebError
        If the port is taken.
    """
    asyncio.run(_Server(recording, delays, say).serve(port))


class _Server:
    """Answers clients; plays once."""

    def __init__(self, recording: Recording, delays: Delays, say: Callable[[str], None]) -> None:
        self._recording, self._say = recording, say
        self._times, self._rows = schedule_frames(
            len(recording.time),
            recording.rate_hz,
            delays.pace,
            delays.lose,
            delays.late_s,
            delays.seed,
        )
        self._listeners: list[asyncio.StreamWriter] = []
        self._asked, self._writers = asyncio.Event(), set[asyncio.StreamWriter]()

    async def serve(self, port: int) -> None:
        try:
            server = await asyncio.start_server(self._talk, _HOST, port)
        except OSError as error:
            raise WebError(f"port {port}: cannot be listened at: {error.strerror}") from None
        async with server:
            found = server.sockets[0].getsockname()[1]
            self._say(f"waiting at qtm://{_HOST}:{found}")
            await self._asked.wait()
            self._say(f"playing {len(self._recording.time) / self._recording.rate_hz:.1f} s")
            await self._play()
            server.close()
            for writer in list(self._writers):
                writer.close()
            # Those that talk notice it, and end.
            await asyncio.sleep(_LEAVE_S)

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one client until it leaves."""
        self._writers.add(writer)
        _send(writer, _COMMAND, b"QTM RT Interface connected\0")
        try:
            while True:
                size, kind = _HEAD.unpack(await reader.readexactly(_HEAD.size))
                if not _HEAD.size < size < _LARGEST_COMMAND:
                    break
                text = await reader.readexactly(size - _HEAD.size)
                if kind == _COMMAND:
                    self._answer(text.rstrip(b"\0").decode("ascii", "replace"), writer)
        except (asyncio.IncompleteReadError, ConnectionError):
            self._say("a client has left")
        finally:
            self._writers.discard(writer)
            if writer in self._listeners:
                self._listeners.remove(writer)
            writer.close()

    def _answer(self, command: str, writer: asyncio.StreamWriter) -> None:
        """Answer one command, as QTM does."""
        word, _, rest = command.strip().lower().partition(" ")
        if word == "version":
            low, high = (tuple(map(int, one.split("."))) for one in _VERSIONS)
            try:
                asked = tuple(map(int, rest.split(".")))
            except ValueError:
                asked = ()
            if low <= asked <= high:
                _send(writer, _COMMAND, f"Version set to {rest}\0".encode())
            else:
                _send(writer, _ERROR, b"Version is not supported\0")
        elif word == "getparameters":
            _send(writer, _XML, self._parameters().encode() + b"\0")
        elif word == "streamframes" and rest.startswith("stop"):
            if writer in self._listeners:
                self._listeners.remove(writer)
        elif word == "streamframes":
            self._listeners.append(writer)
            self._asked.set()
        elif word == "qtmversion":
            _send(writer, _COMMAND, b"besman play\0")
        elif word == "byteorder":
            _send(writer, _COMMAND, b"Byte order is little endian\0")
        else:
            _send(writer, _ERROR, b"Parse error\0")

    def _parameters(self) -> str:
        given = self._recording.names if any(self._recording.names) else ()
        names = "".join(f"<Label><Name>{escape(name or '')}</Name></Label>" for name in given)
        return (
            "<QTM_Parameters_Ver_1.19><General><Frequency>"
            f"{self._recording.rate_hz:.10g}</Frequency></General><The_3D>"
            f"<AxisUpwards>+Z</AxisUpwards><Labels>{len(given)}</Labels>{names}"
            "</The_3D></QTM_Parameters_Ver_1.19>"
        )

    async def _play(self) -> None:
        begun = time.perf_counter()
        named = any(self._recording.names)
        frames = _named_frames(self._recording) if named else _unnamed_frames(self._recording)
        kind = _TYPE_3D if named else _TYPE_UNNAMED
        for at, row in zip(self._times.tolist(), self._rows.tolist(), strict=True):
            wait = begun + at - time.perf_counter()
            if wait > 0:
                await asyncio.sleep(wait)
            due = begun + row / self._recording.rate_hz
            n, body = frames[row]
            size = 2 * _HEAD.size + len(body)
            head = _FRAME.pack(round(due * 1e6), row + 1, 1, size, kind, n, 0, 0)
            for writer in self._listeners:
                _send(writer, _DATA, head + body)
        for writer in self._listeners:
            _send(writer, _NO_MORE, b"")


def _named_frames(recording: Recording) -> list[tuple[int, bytes]]:
    """Return how many markers each frame has, and their places, millimetres."""
    millimetres = (recording.positions * 1e3).astype("<f4")
    return [(len(row), row.tobytes()) for row in millimetres]


def _unnamed_frames(recording: Recording) -> list[tuple[int, bytes]]:
    """Return how many points each frame has, and their places and numbers."""
    seen = find_seen(recording.positions)
    begins = seen & ~np.vstack([np.zeros_like(seen[:1]), seen[:-1]])
    numbers = np.maximum.accumulate(np.cumsum(begins).reshape(begins.shape) * begins, axis=0)
    points = np.empty(seen.shape, UNNAMED_MARKER)
    points["place"], points["number"] = recording.positions * 1e3, numbers
    return [
        (int(there.sum()), row[there].tobytes()) for row, there in zip(points, seen, strict=True)
    ]


def _send(writer: asyncio.StreamWriter, kind: int, body: bytes) -> None:
    writer.write(_HEAD.pack(_HEAD.size + len(body), kind) + body)
