"""Datagrams of OptiTrack Motive's NatNet protocol, by unicast.

The extra ``optitrack``: ``natnet`` (MIT) reads what is in them. Its own client is not used: it
prints to the standard output, and a datagram that is none ends its thread.
"""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

from besman.exceptions import RecordingError, in_one_line

_CONNECT, _SERVER_INFO, _ASK_MODEL, _MODEL, _FRAME, _STILL_HERE = 0, 1, 4, 5, 7, 10
_HEAD = struct.Struct("<HH")
_LARGEST = 1 << 16
# How often Motive is asked again, and told that somebody listens.
_AGAIN_S, _STILL_HERE_S, _LISTEN_S = 0.2, 0.5, 0.1


class NatNetLink:
    """Asks Motive, and hands on what it sends.

    Parameters
    ----------
    host : str
        Where Motive runs.
    port : int
    local : str
        Address of this machine that is sent to.
    hear : callable
        Is given every datagram of that host, in a thread of the link.

    Raises
    ------
    OSError
        If there is no such host, or no such address here.
    """

    def __init__(self, host: str, port: int, local: str, hear: Callable[[bytes], None]) -> None:
        self._there = socket.gethostbyname(host), port
        self._hear, self._closing = hear, threading.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((local, 0))
        except OSError:
            self._socket.close()
            raise
        self._socket.settimeout(_LISTEN_S)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def ask(self, kind: int, answered: threading.Event, within_s: float) -> bool:
        """Ask until there was an answer; tell whether there was."""
        deadline = time.perf_counter() + within_s
        while not answered.is_set() and time.perf_counter() < deadline:
            self._send(kind)
            answered.wait(_AGAIN_S)
        return answered.is_set()

    def ask_who(self, answered: threading.Event, within_s: float) -> bool:
        """Ask who is there, and have frames sent here."""
        return self.ask(_CONNECT, answered, within_s)

    def ask_what(self, answered: threading.Event, within_s: float) -> bool:
        """Ask what markers there are."""
        return self.ask(_ASK_MODEL, answered, within_s)

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self._thread.join(10 * _LISTEN_S)
        self._socket.close()

    def _send(self, kind: int) -> None:
        text = b"Ping\0" if kind == _CONNECT else b"\0"
        self._socket.sendto(_HEAD.pack(kind, len(text)) + text, self._there)

    def _listen(self) -> None:
        told_s = time.perf_counter()
        while not self._closing.is_set():
            now = time.perf_counter()
            try:
                if now - told_s > _STILL_HERE_S:
                    told_s = now
                    self._send(_STILL_HERE)
                data, sender = self._socket.recvfrom(_LARGEST)
            except OSError:
                # Nothing came; or nobody is there, of which the source's silence tells.
                continue
            if sender[0] == self._there[0]:
                self._hear(data)


def read_datagram(data: bytes, version: Any) -> Any:
    """Return what a datagram says.

    Parameters
    ----------
    data : bytes
    version : natnet.Version, optional
        Of the protocol, once it is known.

    Returns
    -------
    natnet.ServerInfo, natnet.DataDescriptions, natnet.DataFrame or None
        None of what does not matter, or came before the version was known.

    Raises
    ------
    RecordingError
        If it is cut, or not what it says that it is.
    """
    from natnet.data_descriptions import DataDescriptions
    from natnet.data_frame import DataFrame
    from natnet.server_info import ServerInfo

    known = {_SERVER_INFO: ServerInfo, _MODEL: DataDescriptions, _FRAME: DataFrame}
    kind, size = _HEAD.unpack_from(data) if len(data) >= _HEAD.size else (_FRAME, _LARGEST)
    if kind not in known or (version is None and kind != _SERVER_INFO):
        return None
    try:
        if size > len(data) - _HEAD.size:
            raise ValueError(f"it says that it has {size}")
        return known[kind].read_from_buffer(_make_buffer(data), version)
    # Of datagrams that are none the library raises whatever comes of it.
    except Exception as error:
        raise RecordingError(
            f"a datagram of {len(data)} bytes cannot be read: {in_one_line(error):.100}"
        ) from None


def _make_buffer(data: bytes) -> Any:
    """Return a buffer of the library that is not read behind its end, nor allocates beyond it."""
    from natnet.packet_buffer import PacketBuffer

    class Bounded(PacketBuffer):  # type: ignore[misc]
        """Counts in a datagram may say anything."""

        def read_string(self, max_length: int | None = None, static_length: bool = False) -> str:
            """Return a text; see the library."""
            self._refuse(1)
            return str(super().read_string(max_length, static_length))

        def read_float32_array(self, count: int) -> tuple[float, ...]:
            """Return so many numbers; see the library."""
            self._refuse(4 * count)
            return tuple(super().read_float32_array(count))

        def _refuse(self, n_bytes: int) -> None:
            if self.pointer + n_bytes > len(self.data):
                raise ValueError(f"{n_bytes} bytes more at {self.pointer}")

    buffer = Bounded(data)
    buffer.pointer = _HEAD.size
    return buffer
