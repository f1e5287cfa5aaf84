"""A small server for pages on this machine: loopback only, and only for who has the address.

The address carries a token, ``http://127.0.0.1:PORT/TOKEN/``, that opens the page once: it is
exchanged for a cookie (`besman.web.access`). Every request is checked for the cookie and for its
Host, which another site's page cannot forge (DNS rebinding). Nothing is looked up on disk by a name
out of a request: assets are a fixed list, everything else is the work of the page's own routes.
"""

from __future__ import annotations

import errno
import json
import os
import sys
import threading
import traceback
import webbrowser
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import parse_qsl, unquote, urlsplit

from besman.exceptions import BesmanError, StoppedError, WebError
from besman.foreign.json_text import parse_json
from besman.web.access import Access
from besman.web.connections import BoundedServer
from besman.web.push import Feed, push_lines

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content-Security-Policy of every answer: nothing but what this server serves."""

_HOST = "127.0.0.1"
_HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
}
_LARGEST_BODY = 8 * 2**20
_IDLE_S = 60.0
# Of a number that a request holds.
_MOST_DIGITS = 18


class Request(NamedTuple):
    """What a route is asked.

    Attributes
    ----------
    query : dict of str
        Of the address.
    body : bytes
        Of a POST; b"" of a GET.
    """

    query: dict[str, str]
    body: bytes

    def json(self) -> Any:
        """Return the body as JSON.

        Raises
        ------
        WebError
            If it is none, or holds text that is no Unicode.
        """
        try:
            content = parse_json(self.body)
            # Half of a surrogate pair can be escaped in JSON, but not written to a file.
            json.dumps(content, ensure_ascii=False).encode()
        except ValueError as error:
            raise WebError(f"the request's body is not JSON: {error}") from None
        return content

    def whole(self, name: str) -> int:
        """Return a number of the address, from 0 on.

        Raises
        ------
        WebError
            If it is missing or none.
        """
        text = self.query.get(name, "")
        if not text.isdecimal() or len(text) > _MOST_DIGITS:
            raise WebError(f"{name}: got {text!r:.20}, expected a whole number from 0")
        return int(text)


class Answer(NamedTuple):
    """What a route answers; see `json_answer`."""

    body: bytes | memoryview
    kind: str = "application/octet-stream"
    status: int = 200
    headers: tuple[tuple[str, str], ...] = ()


Route = Callable[[Request], Answer]

_PUSHED = Answer(b"")


def json_answer(content: Any, status: int = 200) -> Answer:
    """Make an answer of what JSON can hold."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Answer(text.encode(), "application/json", status)


def find_assets(folder: Path, prefix: str = "") -> dict[str, Path]:
    """List the files of a folder that a page may load.

    Parameters
    ----------
    folder : Path
        Of the package; not searched deeper.
    prefix : str
        Before their names in addresses, e.g. ``web/``.

    Returns
    -------
    dict of str to Path
        By name; ``index.html`` is "" too.
    """
    assets = {prefix + path.name: path for path in folder.iterdir() if path.suffix in _KINDS}
    if f"{prefix}index.html" in assets:
        assets[prefix] = assets[f"{prefix}index.html"]
    return assets


class LoopbackServer:
    """Serve one page to this machine.

    Parameters
    ----------
    assets : mapping of str to Path
        Files that may be loaded, by their names in addresses; see `find_assets`.
    routes : mapping of str to Route
        ``"GET data"``, ``"POST save"``: what answers a request. An error of besman's becomes the
        status 422 and ``{"error": message}``.
    port : int, optional
        Any free one if not given.
    largest_body : int
        Bytes that a POST may have.
    feeds : mapping of str to Feed, optional
        ``"news"``: what is pushed over a WebSocket at that address; see `besman.web.push`.

    Attributes
    ----------
    port : int

    Raises
    ------
    WebError
        If the port is in use or not allowed.
    """

    def __init__(
        self,
        assets: Mapping[str, Path],
        routes: Mapping[str, Route],
        port: int | None = None,
        largest_body: int = _LARGEST_BODY,
        feeds: Mapping[str, Feed] | None = None,
    ) -> None:
        self._site = _Site(dict(assets), dict(routes), largest_body, dict(feeds or {}))
        self._server = _open_server(port, self._site)
        self.port = int(self._server.server_address[1])

    @property
    def url(self) -> str:
        """An address that opens the page once, another one each time; see `Access`."""
        return f"http://{_HOST}:{self.port}/{self._site.access.new_token()}/"

    def start(self) -> None:
        """Serve in a thread of its own, until `stop`."""
        threading.Thread(target=self._server.serve_forever, args=(0.1,), daemon=True).start()

    def stop(self) -> None:
        """Stop serving, and free the port."""
        self._server.shutdown()
        self._server.server_close()

    def serve(self, browser: bool = True) -> None:
        """Serve until interrupted (Ctrl+C); open the page if `browser`."""
        if browser:
            _open_browser(self.url)
        try:
            self._server.serve_forever(0.1)
        except (KeyboardInterrupt, StoppedError):
            pass
        finally:
            self._server.server_close()


class _Site:
    """What the handler of a request needs to know."""

    def __init__(
        self,
        assets: dict[str, Path],
        routes: dict[str, Route],
        largest_body: int,
        feeds: dict[str, Feed],
    ) -> None:
        self.assets, self.routes, self.largest_body = assets, routes, largest_body
        self.feeds = feeds
        self.access = Access()


class _Server(BoundedServer):
    site: _Site


def _open_server(port: int | None, site: _Site) -> _Server:
    """Bind the port, or say why it cannot be."""
    try:
        server = _Server((_HOST, port or 0), _Handler)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise WebError(
                f"--port {port}: is in use; give another one, or leave --port out for a free one"
            ) from None
        raise WebError(f"--port {port}: cannot be opened: {error.strerror}") from None
    except OverflowError:
        raise WebError(f"--port: got {port}, expected 1 to 65535") from None
    server.site = site
    return server


def _open_browser(url: str) -> None:
    """Open the page where there is a screen; a browser in the terminal would take it over."""
    if sys.platform == "linux" and not any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    ):
        return
    threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "besman", ""
    timeout = _IDLE_S
    disable_nagle_algorithm = True
    wbufsize = -1

    def do_GET(self) -> None:
        """Answer a GET."""
        self._answer("GET")

    def do_POST(self) -> None:
        """Answer a POST."""
        self._answer("POST")

    def handle_one_request(self) -> None:
        """Read a request and answer it, when one comes."""
        self.server.note(self.connection, "idle")
        try:
            self.rfile.peek(1)  # type: ignore[attr-defined]
        except (OSError, ValueError):
            self.close_connection = True
            return
        self.server.note(self.connection, "reading")
        super().handle_one_request()

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: requests are no news to the user."""

    def _answer(self, method: str) -> None:
        try:
            answer = self._open(method) or self._push(method) or self._find(method)
        except BesmanError as error:
            answer = json_answer({"error": str(error)}, 422)
        except (ConnectionError, TimeoutError):
            # Who asked has gone, or says no more.
            self.close_connection = True
            return
        except Exception as error:
            traceback.print_exc()
            answer = json_answer({"error": f"besman failed: {error!r}; see the terminal"}, 500)
        if answer is not _PUSHED:
            self._send(answer)

    def _open(self, method: str) -> Answer | None:
        """Return an answer to who may not ask or comes with a token, None to who may ask."""
        port = self.server.server_address[1]
        own = tuple(f"{name}:{port}" for name in (_HOST, "localhost"))
        host = self.headers.get("Host", "")
        if host not in own:
            return self._close(403, f"Host {host!r} is not this server; expected {own[0]}")
        origin = self.headers.get("Origin")
        if origin is not None and origin.removeprefix("http://") not in own:
            return self._close(403, f"Origin {origin!r} may not ask this server")
        try:
            path = urlsplit(self.path).path
        except ValueError as error:
            return self._close(400, f"{self.path!r:.80} is no address: {error}")
        access = self.server.site.access
        first, _, rest = path.removeprefix("/").partition("/")
        if first == access.place and access.admits(self.headers.get("Cookie", "")):
            return None
        cookie = access.exchange(first) if (method, rest) == ("GET", "") else None
        if cookie is None:
            return self._close(
                403,
                "the address lacks its token, or was used already: each opens the page once; "
                "open the one that besman printed, or start it again",
            )
        where = (("Location", f"/{access.place}/"), ("Set-Cookie", cookie))
        return Answer(b"", "text/plain", 303, where)

    def _push(self, method: str) -> Answer | None:
        """Push lines to who asks for a WebSocket, for as long as it lasts; None if nobody does."""
        place = f"/{self.server.site.access.place}/"
        feed = self.server.site.feeds.get(urlsplit(self.path).path.removeprefix(place))
        if feed is None or method != "GET":
            return None
        # Pages of other sites send an Origin, and were refused by it; programs need none.
        lines = [f"GET {self.path} HTTP/1.1", *(f"{k}: {v}" for k, v in self.headers.items())]
        self.server.note(self.connection, "pushing")
        self.close_connection = True
        push_lines(("\r\n".join(lines) + "\r\n\r\n").encode("latin-1"), self.connection, feed)
        return _PUSHED

    def _find(self, method: str) -> Answer:
        """Return the asset or what the route answers."""
        site = self.server.site
        address = urlsplit(self.path)
        name = unquote(address.path.removeprefix(f"/{site.access.place}/"))
        if ".." in name.replace("\\", "/").split("/"):
            return self._close(400, "'..' is not allowed in an address")
        if method == "GET" and name in site.assets:
            path = site.assets[name]
            return Answer(path.read_bytes(), _KINDS[path.suffix])
        route = site.routes.get(f"{method} {name}")
        if route is None:
            return self._close(404, "there is nothing at this address")
        body = b""
        if method == "POST":
            length = self.headers.get("Content-Length", "")
            if not length.isdecimal() or len(length) > _MOST_DIGITS:
                return self._close(411, "the request does not say how long it is")
            if int(length) > site.largest_body:
                return self._close(
                    413, f"the request has {length} bytes, at most {site.largest_body} are allowed"
                )
            if self.headers.get("Content-Type", "").partition(";")[0] != "application/json":
                return self._close(415, "expected application/json")
            body = self.rfile.read(int(length))
        self.server.note(self.connection, "working")
        return route(Request(dict(parse_qsl(address.query)), body))

    def _close(self, status: int, message: str) -> Answer:
        """Refuse, and end the connection: what follows on it was not read."""
        self.close_connection = True
        return json_answer({"error": message}, status)

    def _send(self, answer: Answer) -> None:
        self.server.note(self.connection, "sending")
        self.send_response(answer.status)
        headers = {"Content-Type": answer.kind, "Content-Length": str(len(answer.body)), **_HEADERS}
        if self.close_connection:
            headers["Connection"] = "close"
        for name, value in (*headers.items(), *answer.headers):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(answer.body)
        self.wfile.flush()
