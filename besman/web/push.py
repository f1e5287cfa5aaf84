"""Lines that a page's server pushes over a WebSocket, to who may open the page.

The protocol (RFC 6455) is that of ``websockets``, without its input and output: the connection is
the server's own, so that address, cookie and Origin are checked as those of any request.
"""

from __future__ import annotations

import select
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator

# Twice as often as a page is drawn.
_WAIT_S = 1 / 60

Feed = Callable[[], Iterator[str | None]]
"""Gives lines for as long as there are some; None after a moment in which there was none."""


class Broadcast:
    """Lines that any number of listeners get, each as fast as it can.

    Parameters
    ----------
    n_kept : int
        Lines that who comes later still gets, and who is slow does not miss.
    """

    def __init__(self, n_kept: int = 2000) -> None:
        self._lines: deque[str] = deque(maxlen=n_kept)
        self._n_sent, self._ended = 0, False
        self._news = threading.Condition()

    def send(self, line: str) -> None:
        """Let everybody who listens have a line."""
        with self._news:
            self._lines.append(line)
            self._n_sent += 1
            self._news.notify_all()

    def end(self) -> None:
        """Let those who listen go, once they have what was sent."""
        with self._news:
            self._ended = True
            self._news.notify_all()

    def listen(self) -> Iterator[str | None]:
        """Yield the lines that are kept, then those that come; None when none came for a moment."""
        n_seen = 0
        while True:
            with self._news:
                if n_seen == self._n_sent and not self._ended:
                    self._news.wait(_WAIT_S)
                missed = min(self._n_sent - n_seen, len(self._lines))
                lines = list(self._lines)[len(self._lines) - missed :]
                n_seen, ended = self._n_sent, self._ended
            yield from lines
            if ended:
                return
            if not lines:
                yield None


def push_lines(request: bytes, connection: socket.socket, feed: Feed) -> None:
    """Answer a request for a WebSocket, and push lines until there are no more or it is closed.

    Parameters
    ----------
    request : bytes
        As it came.
    connection : socket
    feed : Feed

    Raises
    ------
    OSError
        If the other side has gone.
    """
    from websockets.http11 import Request
    from websockets.protocol import State
    from websockets.server import ServerProtocol

    protocol = ServerProtocol()
    protocol.receive_data(request)
    asked = next(iter(protocol.events_received()), None)
    if isinstance(asked, Request):
        protocol.send_response(protocol.accept(asked))
    _flush(protocol.data_to_send(), connection)
    if protocol.state is not State.OPEN:
        return
    for line in feed():
        if line is not None:
            protocol.send_text(line.encode())
        _receive(protocol.receive_data, protocol.receive_eof, connection)
        _flush(protocol.data_to_send(), connection)
        if protocol.state is not State.OPEN:
            return
    protocol.send_close(1000)
    _flush(protocol.data_to_send(), connection)


def _receive(
    take: Callable[[bytes], None], take_end: Callable[[], None], connection: socket.socket
) -> None:
    """Take what the other side has said, without waiting: that it goes, or is still there."""
    if not select.select([connection], [], [], 0)[0]:
        return
    data = connection.recv(4096)
    if data:
        take(data)
    else:
        take_end()


def _flush(parts: list[bytes], connection: socket.socket) -> None:
    for part in parts:
        if part:
            connection.sendall(part)
