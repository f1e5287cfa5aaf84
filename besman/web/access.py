"""Who may open a page: whoever has an address that was not used yet gets a cookie for it.

Addresses can be read by other users of the machine: they stand in the command line of the browser.
So each opens the page once, and what it is exchanged for is never in an address.
"""

from __future__ import annotations

import hmac
import secrets
import threading
from http.cookies import CookieError, SimpleCookie

_NAME = "besman"


class Access:
    """The addresses of a page and the cookie that they are exchanged for.

    Attributes
    ----------
    place : str
        First part of the addresses that the cookie is sent to: no other server on this machine
        is asked for it, so that a browser shows the cookie to none of them.
    """

    def __init__(self) -> None:
        self.place = secrets.token_urlsafe(12)
        self._cookie = secrets.token_urlsafe(24)
        self._tokens: set[str] = set()
        self._lock = threading.Lock()

    def new_token(self) -> str:
        """Return the first part of an address that opens the page once."""
        token = secrets.token_urlsafe(24)
        with self._lock:
            self._tokens.add(token)
        return token

    def exchange(self, token: str) -> str | None:
        """Return the header ``Set-Cookie`` for a token, None if it is none or was used."""
        with self._lock:
            known = [one for one in self._tokens if hmac.compare_digest(one, token)]
            self._tokens.difference_update(known)
        if not known:
            return None
        return f"{_NAME}={self._cookie}; Path=/{self.place}/; HttpOnly; SameSite=Strict"

    def admits(self, header: str) -> bool:
        """Tell whether a request with this header ``Cookie`` comes from who opened the page."""
        try:
            cookie = SimpleCookie(header).get(_NAME)
        except CookieError:
            return False
        return cookie is not None and hmac.compare_digest(
            cookie.value.encode(), self._cookie.encode()
        )
