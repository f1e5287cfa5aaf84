"""Lines over a WebSocket, read by the client of a second implementation's own making."""

import socket
import threading

import pytest
from web_session import session
from websockets.exceptions import ConnectionClosedOK, InvalidStatus
from websockets.sync.client import connect

from besman.web.loopback import LoopbackServer
from besman.web.push import Broadcast


@pytest.fixture
def news():
    return Broadcast(n_kept=3)


@pytest.fixture
def server(news):
    server = LoopbackServer({}, {}, feeds={"news": news.listen})
    server.start()
    yield server
    news.end()
    server.stop()


def listen(server, **headers):
    place, cookie = session(server)
    own = {"Cookie": cookie} | headers
    return connect(f"ws://127.0.0.1:{server.port}{place}news", additional_headers=own)


def test_everybody_gets_every_line_and_who_comes_later_the_last_ones(server, news):
    with listen(server) as first:
        news.send("ä")
        assert first.recv(60) == "ä"
        for line in "bcd":
            news.send(line)
        assert [first.recv(60) for _ in "bcd"] == list("bcd")
        with listen(server) as second:
            assert [second.recv(60) for _ in "bcd"] == list("bcd")
        # That one went; the other listens on, until there is nothing more.
        news.send("e")
        assert first.recv(60) == "e"
        assert first.ping().wait(60)
        news.end()
        with pytest.raises(ConnectionClosedOK):
            first.recv(60)


def test_it_is_pushed_to_who_has_opened_the_page_alone(server):
    for headers in ({"Cookie": "besman=guessed"}, {"Origin": "http://elsewhere.example"}):
        with pytest.raises(InvalidStatus, match="403"), listen(server, **headers):
            pass


def test_what_asks_for_no_web_socket_is_refused(server):
    place, cookie = session(server)
    with socket.create_connection(("127.0.0.1", server.port), 60) as client:
        lines = [f"GET {place}news HTTP/1.1", f"Host: 127.0.0.1:{server.port}", f"Cookie: {cookie}"]
        client.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        answer = b"".join(iter(lambda: client.recv(4096), b""))
    assert answer.startswith(b"HTTP/1.1 426 ")


def test_who_is_slow_does_not_hold_up_who_sends(news):
    lines = news.listen()
    for k in range(10):
        news.send(str(k))
    assert [next(lines) for _ in range(3)] == ["7", "8", "9"]
    assert next(lines) is None
    threading.Timer(0.0, news.end).start()
    # None for every moment in which there was nothing, of which a busy machine has several.
    assert set(lines) <= {None}
