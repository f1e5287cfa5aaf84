import http.client
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from web_session import enter, session

from besman.exceptions import SegmentationError, WebError
from besman.web.loopback import POLICY, Answer, LoopbackServer, find_assets, json_answer


def fail(request):
    raise SegmentationError("nothing moves")


def crash(request):
    raise RuntimeError("a bug")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "page").mkdir()
    (tmp_path / "page" / "index.html").write_text("<p>hello</p>")
    (tmp_path / "page" / "app.js").write_text("1")
    (tmp_path / "page" / "notes.py").write_text("secret")
    (tmp_path / "secret.js").write_text("secret")
    return tmp_path / "page"


@pytest.fixture
def server(folder):
    routes = {
        "GET data": lambda request: Answer(b"\0\1"),
        "GET name": lambda request: json_answer(request.query),
        "POST echo": lambda request: json_answer(request.json()),
        "GET fail": fail,
        "GET crash": crash,
    }
    server = LoopbackServer(find_assets(folder), routes, largest_body=64)
    server.start()
    yield server
    server.stop()


def ask(server, method, name, body=None, place=None, **headers):
    """Ask as a browser would, with the path as it stands."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    own, cookie = session(server)
    headers = {"Cookie": cookie} | {k.replace("_", "-"): v for k, v in headers.items()}
    connection.request(method, f"{own if place is None else place}{name}", body, headers)
    answer = connection.getresponse()
    return answer, answer.read().decode()


def test_page_and_its_files_are_served_under_a_strict_policy(server):
    for name, text in {"": "<p>hello</p>", "index.html": "<p>hello</p>", "app.js": "1"}.items():
        answer, body = ask(server, "GET", name)
        assert (answer.status, body) == (200, text)
    answer, _ = ask(server, "GET", "")
    assert answer.headers["Content-Security-Policy"] == POLICY
    assert "unsafe" not in POLICY
    assert "http" not in POLICY
    assert answer.headers["Content-Type"] == "text/html; charset=utf-8"
    assert answer.headers["X-Content-Type-Options"] == "nosniff"


def test_only_loopback_is_bound(server):
    assert server.url.startswith("http://127.0.0.1:")
    with (
        pytest.raises(ConnectionRefusedError),
        socket.create_connection(("127.0.0.2", server.port), timeout=1),
    ):
        pass


@pytest.mark.parametrize("place", ["/", "/wrong/", f"/{'x' * 32}/"])
def test_request_without_token_is_refused(server, place):
    for method, name in (("GET", ""), ("GET", "data"), ("POST", "echo")):
        answer, body = ask(server, method, name, place=place)
        assert answer.status == 403
        assert "lacks its token" in body


@pytest.mark.parametrize("cookie", ["", "besman=", "besman=x", "other=1", "besman", "=;", "\xe9=1"])
def test_request_without_the_cookie_is_refused(server, cookie):
    for method, name in (("GET", ""), ("GET", "data"), ("POST", "echo")):
        assert ask(server, method, name, Cookie=cookie)[0].status == 403


def test_an_address_opens_the_page_once_for_a_cookie_that_no_script_and_no_other_site_gets(server):
    url = server.url
    place, cookie = enter(url)
    path = f"/{url.split('/')[3]}/"
    for _ in range(2):
        answer, body = ask(server, "GET", "", place=path)
        assert answer.status == 403
        assert "was used already: each opens the page once" in body
    assert cookie.partition("=")[2] not in url
    assert server.url != url
    answer, _ = ask(server, "GET", "", place=f"/{server.url.split('/')[3]}/")
    assert answer.headers["Set-Cookie"] == f"{cookie}; Path={place}; HttpOnly; SameSite=Strict"
    # A token opens the page and nothing else.
    answer, _ = ask(server, "GET", "data", place=f"/{server.url.split('/')[3]}/", Cookie="")
    assert answer.status == 403


def test_two_who_come_with_one_address_do_not_both_get_in(server):
    path = f"/{server.url.split('/')[3]}/"
    with ThreadPoolExecutor(16) as threads:
        asked = [threads.submit(ask, server, "GET", "", None, path) for _ in range(16)]
        status = sorted(one.result()[0].status for one in asked)
    assert status == [303] + 15 * [403]


@pytest.mark.parametrize("address", ["http://[/", "http://[x/data"])
def test_an_address_that_is_none_is_refused_with_words(server, address):
    # As no client of a library would send it.
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as raw:
        raw.sendall(f"GET {address} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode())
        answer = raw.makefile().read()
    assert answer.startswith("HTTP/1.1 400")
    assert "is no address" in answer


@pytest.mark.parametrize("body", ["[" * 30 + "]" * 30, '"\\ud83d\\ude00"'])
def test_a_body_that_is_plain_json_is_taken(server, body):
    kind = {"Content_Type": "application/json"}
    assert ask(server, "POST", "echo", body, **kind)[0].status == 200


@pytest.mark.parametrize("body", ["[" * 64, '"\\ud800"', "1" * 30, "NaN", "{"])
def test_a_body_that_is_no_plain_json_is_refused_with_words(server, body):
    kind = {"Content_Type": "application/json"}
    answer, said = ask(server, "POST", "echo", body, **kind)
    assert answer.status == 422
    assert "is not JSON" in said


def test_many_requests_at_a_time_are_all_answered(server):
    # A hundred threads take turns, and it may be long until one asks that has connected.
    server._server.grace_s = 60.0
    with ThreadPoolExecutor(100) as threads:
        asked = [threads.submit(ask, server, "GET", "data") for _ in range(200)]
        assert {one.result()[0].status for one in asked} == {200}


def test_who_keeps_connections_open_and_says_nothing_is_cut_off_for_others(server):
    server._server.grace_s, before = 0.2, threading.active_count()
    silent = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(40)]
    try:
        assert ask(server, "GET", "data")[0].status == 200
        # Threads of servers before may be ending still.
        assert threading.active_count() - before < 40
    finally:
        for one in silent:
            one.close()


def test_a_request_that_drips_in_is_cut_off(server):
    server._server.reading_s = 0.3
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as slow:
        slow.sendall(b"GET / HTTP/1.1\r\n")
        slow.settimeout(0.05)
        got, until = None, time.monotonic() + 60
        while got is None and time.monotonic() < until:
            try:
                slow.sendall(b"X")
                got = slow.recv(100)
            except TimeoutError:
                continue
            except ConnectionError:
                got = b""
    assert got == b""
    assert ask(server, "GET", "data")[0].status == 200


@pytest.mark.parametrize("host", ["evil.example", "evil.example:{port}", "127.0.0.1", ""])
def test_foreign_host_is_refused(server, host):
    answer, body = ask(server, "GET", "data", Host=host.format(port=server.port))
    assert answer.status == 403
    assert "is not this server" in body


def test_localhost_is_the_same_machine(server):
    assert ask(server, "GET", "data", Host=f"localhost:{server.port}")[0].status == 200


def test_another_sites_page_may_not_post(server):
    answer, body = ask(
        server, "POST", "echo", "{}", Content_Type="application/json", Origin="http://evil.example"
    )
    assert answer.status == 403
    assert "may not ask this server" in body


@pytest.mark.parametrize(
    "name", ["../secret.js", "..%2fsecret.js", "%2e%2e/secret.js", "a/../../secret.js", "..\\a"]
)
def test_way_out_of_the_folder_is_refused(server, name):
    answer, body = ask(server, "GET", name)
    assert answer.status == 400
    assert "'..' is not allowed" in body


@pytest.mark.parametrize("name", ["notes.py", "/etc/passwd", "app.js/", "no.js", "echo"])
def test_only_what_is_listed_is_there(server, name):
    answer, body = ask(server, "GET", name)
    assert answer.status == 404
    assert "nothing at this address" in body


def test_routes_get_query_and_body(server):
    assert ask(server, "GET", "name?a=1&b=%3C")[1] == '{"a":"1","b":"<"}'
    json_type = {"Content_Type": "application/json"}
    assert ask(server, "POST", "echo", '{"a": [1]}', **json_type)[1] == '{"a":[1]}'
    answer, body = ask(server, "POST", "echo", "{", **json_type)
    assert answer.status == 422
    assert "not JSON" in body
    answer, body = ask(server, "POST", "echo", "a=1")
    assert answer.status == 415
    assert "expected application/json" in body


def test_body_is_bounded(server):
    # Headers alone: it is refused before anything of the body is read.
    kind = {"Content_Type": "application/json"}
    answer, body = ask(server, "POST", "echo", Content_Length="65", **kind)
    assert answer.status == 413
    assert "65 bytes, at most 64" in body
    answer, body = ask(server, "POST", "echo", Content_Length="9" * 5000, **kind)
    assert answer.status == 411
    answer, body = ask(server, "POST", "echo", Transfer_Encoding="chunked", **kind)
    assert answer.status == 411
    assert "how long it is" in body


def test_errors_are_answers(server, capfd):
    answer, body = ask(server, "GET", "fail")
    assert (answer.status, body) == (422, '{"error":"nothing moves"}')
    answer, body = ask(server, "GET", "crash")
    assert answer.status == 500
    assert "a bug" in body
    assert "see the terminal" in body
    assert "RuntimeError: a bug" in capfd.readouterr().err


def test_port_in_use_is_said(server, folder):
    with pytest.raises(WebError, match=f"--port {server.port}: is in use; give another one"):
        LoopbackServer(find_assets(folder), {}, port=server.port)


def test_port_out_of_range_is_said(folder):
    with pytest.raises(WebError, match="--port: got 70000, expected 1 to 65535"):
        LoopbackServer(find_assets(folder), {}, port=70000)


def test_port_that_cannot_be_opened_is_said(folder, monkeypatch):
    def refuse(*args):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("besman.web.loopback._Server", refuse)
    with pytest.raises(WebError, match="--port 80: cannot be opened: Permission denied"):
        LoopbackServer(find_assets(folder), {}, port=80)
