"""The real-time protocol of Qualisys Track Manager, spoken by its maker's client.

The extra ``qualisys``: ``qtm-rt``. A thread receives; who follows the stream is not waited for.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from typing import Any
from xml.etree import ElementTree

import numpy as np

from besman.exceptions import RecordingError, in_one_line, why_not_there
from besman.io.recordings.conventions import turn
from besman.io.recordings.lengths import in_metres
from besman.live.stream import Inbox, Packet, StreamFormat
from besman.records import Axis, FloatArray

PORT = 22223
"""Where QTM listens for clients that want little-endian numbers."""

VERSION = "1.19"
"""Of the protocol that is asked for: known to QTM from 2019 on; markers came as now long before."""

UNNAMED = 64
"""Most trajectories without a name in a packet, of a QTM that names none; others are left out."""

# For each answer, and for all that are needed to begin.
_ANSWER_S, _OPENED_S = 5.0, 20.0
_RETRY_S, _POLL_S = 0.3, 0.005
_MM = 1e-3
# Of 3D coordinates in a packet: how many markers, and two rates of faults, stand before them.
_HEAD_BYTES = 8
# Of a marker with a name: x, y, z.
_NAMED_BYTES = 12
UNNAMED_MARKER = np.dtype([("place", "<f4", 3), ("number", "<i4")])
"""As a trajectory without a name stands in a packet: millimetres, and QTM's number of it."""


class QtmSource:
    """``qtm://HOST[:PORT]``.

    Parameters
    ----------
    host, port
        Where QTM runs.
    version : str
        Of the protocol.
    wait_s : float
        How long a stream that had begun may be silent, seconds; until then a new connection is
        tried where it broke.
    """

    def __init__(self, host: str, port: int = PORT, version: str = VERSION, wait_s: float = 10.0):
        self._host, self._port, self._version, self._wait_s = host, port, version, wait_s
        self._name = f"qtm://{host}:{port}"
        self._inbox = Inbox(wait_s, time.perf_counter)
        self._format: StreamFormat | None = None
        self._up: Axis = "z"
        # Columns of the trajectories that QTM did not name, by the numbers that it gives them.
        self._columns: dict[int, int] = {}
        self._opened, self._wanted = threading.Event(), threading.Event()
        self._closing = False
        self._problem: RecordingError | None = None
        self._log = _LastWords()

    @property
    def ended(self) -> bool:
        """See `besman.live.stream.Source.ended`."""
        return self._inbox.ended

    def open(self) -> StreamFormat:
        """Connect, ask for names and rate, and have markers sent; see `Source.open`."""
        try:
            import qtm_rt  # noqa: F401
        except ImportError as error:
            reason = why_not_there(error, "qtm-rt", "besman[qualisys]")
            raise RecordingError(f"{self._name}: {reason}") from None
        thread = threading.Thread(target=self._receive, daemon=True)
        thread.start()
        self._opened.wait(_OPENED_S)
        if self._problem is not None or self._format is None:
            raise self._problem or RecordingError(f"{self._name}: does not answer as QTM would")
        return self._format

    def start(self) -> None:
        """Have markers sent."""
        self._wanted.set()

    def read(self, timeout_s: float) -> Packet | None:
        """Return the next packet; see `Source.read`."""
        return self._inbox.get(timeout_s)

    def close(self) -> None:
        """Have the connection closed by its thread."""
        self._closing = True

    def _receive(self) -> None:
        """Keep a connection until the source is closed."""
        logger = logging.getLogger("qtm_rt")
        logger.addHandler(self._log)
        logger.propagate = False
        try:
            asyncio.run(self._keep_connected())
        except RecordingError as error:
            self._problem = error
            self._inbox.put(error)
        except Exception as error:
            self._problem = RecordingError(f"{self._name}: {in_one_line(error):.200}")
            self._inbox.put(self._problem)
        finally:
            logger.removeHandler(self._log)
            self._opened.set()

    async def _keep_connected(self) -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, about: self._log.note(about))
        while not self._closing:
            lost = asyncio.Event()
            try:
                connection = await self._connect(lost)
            except RecordingError:
                if self._format is None:
                    raise
                # It was there before: its user may be starting it again.
                if self._inbox.ended:
                    return
                await asyncio.sleep(_RETRY_S)
                continue
            while not (lost.is_set() or self._closing):
                await asyncio.sleep(10 * _POLL_S)
            if not lost.is_set():
                connection.disconnect()

    async def _connect(self, lost: asyncio.Event) -> Any:
        """Connect, and begin to stream."""
        import qtm_rt

        self._log.text = ""
        try:
            connection = await asyncio.wait_for(
                qtm_rt.connect(
                    self._host,
                    self._port,
                    version=self._version,
                    on_disconnect=lambda _: lost.set(),
                    timeout=_ANSWER_S,
                ),
                _ANSWER_S,
            )
            if connection is None:
                raise RecordingError(f"{self._name}: {self._why_refused()}")
            found = self._read_format(await connection.get_parameters(["general", "3d"]))
            if self._format is not None and found != self._format:
                raise RecordingError(
                    f"{self._name}: came back with other markers or another rate; expected "
                    f"{len(self._format.names)} markers at {self._format.rate_hz:g} Hz as before"
                )
            self._format = found
            self._opened.set()
            while not (self._wanted.is_set() or self._closing):
                await asyncio.sleep(_POLL_S)
            components = ["3dnolabels"] if None in found.names else ["3d"]
            await connection.stream_frames(components=components, on_packet=self._take)
        except TimeoutError:
            said = f" ({self._log.text})" if self._log.text else ""
            raise RecordingError(
                f"{self._name}: no answer within {_ANSWER_S:g} s{said}; expected QTM with its "
                "real-time server, which listens at port 22223"
            ) from None
        except qtm_rt.QRTCommandException as error:
            raise RecordingError(f"{self._name}: QTM says {in_one_line(error):.200}") from None
        return connection

    def _why_refused(self) -> str:
        """Say why the client gave no connection: it writes that to its log alone."""
        text = self._log.text
        if "version" in text.lower():
            return (
                f"QTM does not speak version {self._version} of its protocol ({text:.120}); say "
                f"which it does: {self._name}?version=1.8"
            )
        return (
            f"cannot be connected to ({text:.120}); expected QTM with its real-time server, which "
            "listens at port 22223"
        )

    def _read_format(self, answer: bytes | str) -> StreamFormat:
        """Read names, rate and axis out of QTM's settings."""
        text = answer.decode("utf-8", "replace") if isinstance(answer, bytes) else answer
        try:
            if "<!" in text:
                raise ValueError("a document type")
            tree = ElementTree.fromstring(text)  # noqa: S314
            rate_hz = float(tree.findtext("General/Frequency") or "nan")
            up = (tree.findtext("The_3D/AxisUpwards") or "+Z").strip().lower().removeprefix("+")
            labels = [one.text for one in tree.iterfind("The_3D/Label/Name")]
        except (ElementTree.ParseError, ValueError) as error:
            raise RecordingError(
                f"{self._name}: QTM's settings cannot be read: {in_one_line(error):.120}"
            ) from None
        if not rate_hz > 0:
            raise RecordingError(
                f"{self._name}: got 3D markers at {rate_hz:g} Hz; expected 3D tracking at some rate"
            )
        axes: dict[str, Axis] = {s + a: s + a for s in ("", "-") for a in "xyz"}  # type: ignore[misc]
        if up not in axes:
            raise RecordingError(f"{self._name}: axis upwards: got {up!r:.20}; expected +Z, -Y, ..")
        self._up = axes[up]
        return StreamFormat(self._name, tuple(labels) or (None,) * UNNAMED, rate_hz)

    def _take(self, packet: Any) -> None:
        """Take a packet of the client, in its thread."""
        arrived_s = time.perf_counter()
        is_unnamed = self._format is not None and None in self._format.names
        try:
            positions = read_unnamed(packet, self._columns) if is_unnamed else read_markers(packet)
        except RecordingError as error:
            self._inbox.put(RecordingError(f"{self._name}: {error}"))
            return
        if positions is None or self._format is None or self._closing:
            return
        if len(positions) != len(self._format.names):
            self._inbox.put(
                RecordingError(
                    f"{self._name}: {len(positions)} markers in a packet; expected the "
                    f"{len(self._format.names)} that QTM named"
                )
            )
            return
        if self._up != "z":
            positions = turn(positions, self._up)
        self._inbox.put(
            Packet(packet.timestamp * 1e-6, positions, arrived_s, int(packet.framenumber))
        )


def read_markers(packet: Any) -> FloatArray | None:
    """Return the positions (M, 3) in metres of a packet of ``qtm_rt``; None if it holds none.

    The client's own getter makes a tuple of every marker; this is one view of the same bytes.

    Raises
    ------
    RecordingError
        If the packet is shorter than the markers that it counts.
    """
    from qtm_rt.packet import QRTComponentType

    at = packet.components.get(QRTComponentType.Component3d)
    if at is None:
        return None
    n = _count_whole(packet, at, _NAMED_BYTES)
    values = np.frombuffer(packet.data, "<f4", 3 * n, at + _HEAD_BYTES).reshape(n, 3)
    return in_metres(values, _MM)


def read_unnamed(packet: Any, columns: dict[int, int]) -> FloatArray | None:
    """Return the positions of a packet's trajectories without a name.

    Parameters
    ----------
    packet : packet of ``qtm_rt``
    columns : dict of int to int
        Column of each trajectory that was seen before; brought up to date.

    Returns
    -------
    array, shape (UNNAMED, 3), or None
        Metres, NaN where there is none; None if the packet holds nothing of the kind.

    Raises
    ------
    RecordingError
        If the packet is shorter than the markers that it counts.
    """
    from qtm_rt.packet import QRTComponentType

    at = packet.components.get(QRTComponentType.Component3dNoLabels)
    if at is None:
        return None
    n = _count_whole(packet, at, UNNAMED_MARKER.itemsize)
    found = np.frombuffer(packet.data, UNNAMED_MARKER, n, at + _HEAD_BYTES)
    numbers = found["number"].tolist()[:UNNAMED]
    for gone in columns.keys() - set(numbers):
        del columns[gone]
    free = sorted(set(range(UNNAMED)) - set(columns.values()), reverse=True)
    for number in numbers:
        if number not in columns:
            columns[number] = free.pop()
    positions = np.full((UNNAMED, 3), np.nan)
    positions[[columns[number] for number in numbers]] = in_metres(found["place"][:UNNAMED], _MM)
    return positions


def _count_whole(packet: Any, at: int, each: int) -> int:
    """Return how many markers of so many bytes a part of a packet has."""
    n = int.from_bytes(packet.data[at : at + 4], "little")
    expected = at + _HEAD_BYTES + each * n
    if expected > len(packet.data):
        raise RecordingError(
            f"a packet of {len(packet.data)} bytes says that it has {n} markers; expected "
            f"{expected} bytes at least"
        )
    return n


class _LastWords(logging.Handler):
    """Keeps what the client logged last: the only place where it says why."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.text = ""

    def emit(self, record: logging.LogRecord) -> None:
        self.text = in_one_line(record.getMessage().splitlines())

    def note(self, about: dict[str, Any]) -> None:
        """Take what the event loop says of a callback that failed."""
        error = about.get("exception")
        self.text = in_one_line(error) if isinstance(error, Exception) else str(about["message"])
