"""Open a page's server as a browser does: the address opens it once, for a cookie."""

import http.client
from functools import lru_cache
from urllib.parse import urlsplit


def enter(url):
    """Use an address up; return where the page is and the cookie for it."""
    address = urlsplit(url)
    connection = http.client.HTTPConnection(address.hostname, address.port, timeout=60)
    connection.request("GET", address.path)
    answer = connection.getresponse()
    answer.read()
    assert answer.status == 303, answer.status
    return answer.headers["Location"], answer.headers["Set-Cookie"].partition(";")[0]


@lru_cache(maxsize=8)
def session(server):
    """Return where a server's page is and the cookie for it."""
    return enter(server.url)
