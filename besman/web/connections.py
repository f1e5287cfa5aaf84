"""Connections of a page's server: so many at a time, and none for longer than it may take."""

from __future__ import annotations

import socket
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from typing import Any

# Browsers open six connections to a server; several windows and a benchmark fit.
_THREADS = 32
# Of connections that wait to be accepted.
_BACKLOG = 256
_READING_S = 10.0
_SENDING_S = 60.0
# A request is on its way when its connection is made; a busy machine may be slow to send it.
_GRACE_S = 2.0


class BoundedServer(HTTPServer):
    """A server whose threads are bounded.

    A client that is slow to ask is cut off, and a connection that is only kept open goes where
    another one waits for its thread.

    Attributes
    ----------
    reading_s, sending_s : float
        How long a request may take to come in and its answer to go out, seconds.
    grace_s : float
        How long a connection is left alone that says nothing while another waits, seconds.
    """

    request_queue_size = _BACKLOG
    allow_reuse_address = True

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self.reading_s, self.sending_s, self.grace_s = _READING_S, _SENDING_S, _GRACE_S
        self._pool = ThreadPoolExecutor(_THREADS, thread_name_prefix="page")
        self._lock = threading.Lock()
        self._waiting = 0
        # Connection: what it is doing, and since when.
        self._doing: dict[socket.socket, tuple[str, float]] = {}
        # Last: a port that is in use closes the server at once.
        super().__init__(address, handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Give a connection to a thread, when there is one."""
        with self._lock:
            self._waiting += 1
        self._pool.submit(self._serve, request, client_address)

    def _serve(self, request: Any, client_address: Any) -> None:
        with self._lock:
            self._waiting -= 1
        try:
            self.finish_request(request, client_address)
        except Exception:
            self.handle_error(request, client_address)
        finally:
            with self._lock:
                self._doing.pop(request, None)
            self.shutdown_request(request)

    def note(self, connection: socket.socket, doing: str) -> None:
        """Take note of what a connection is doing now.

        It is ``idle``, ``reading``, ``working``, ``sending``; or ``pushing``, as long as it may.
        """
        with self._lock:
            self._doing[connection] = (doing, time.monotonic())

    def service_actions(self) -> None:
        """Cut off who takes too long, and who keeps a thread that another waits for."""
        now = time.monotonic()
        limits = {"reading": self.reading_s, "sending": self.sending_s}
        with self._lock:
            late = [
                connection
                for connection, (doing, since) in self._doing.items()
                if doing in limits and now - since > limits[doing]
            ]
            idle = [
                (since, connection)
                for connection, (doing, since) in self._doing.items()
                if doing == "idle" and now - since > self.grace_s
            ]
            idle.sort(key=lambda one: one[0])
            late += [connection for _, connection in idle[: self._waiting]]
            for connection in late:
                _hang_up(connection)

    def server_close(self) -> None:
        """Free the port and end all connections."""
        super().server_close()
        with self._lock:
            for connection in self._doing:
                _hang_up(connection)
        self._pool.shutdown(wait=False, cancel_futures=True)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that went away in the middle of an answer."""
        if not isinstance(sys.exc_info()[1], ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


def _hang_up(connection: socket.socket) -> None:
    """End a connection; whoever reads from it or writes to it notices."""
    # It may have ended by itself in this moment.
    with suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
