"""The run as one file: it needs nothing else, stays small, and shows names as they are."""

import html
import json
import re
import shutil
import urllib.error
import urllib.request
from dataclasses import replace

import pytest
from browser import settle
from command_line import besman
from web_session import enter

from besman.exceptions import RunError, WebError
from besman.records.files import load_record, save_record
from besman.view import export
from besman.view.live import open_view
from besman.view.run_content import RunContent

HOSTILE = "</script><script>hit=1</script><img src=x onerror=hit=1>'\"&.tsv"


@pytest.fixture(scope="module")
def hostile(small_run, tmp_path_factory):
    """The run of a recording, of markers and of a run with names that are markup."""
    folder = shutil.copytree(small_run, tmp_path_factory.mktemp("hostile") / "run")
    for path in folder.glob("*_*/record.npz"):
        record = load_record(path)
        if path.parent.name.endswith("_label"):
            markers = tuple(
                "<b>stick</b>" if name == "stick" else name for name in record[0].markers
            )
            record = tuple(replace(one, source=HOSTILE, markers=markers) for one in record)
        elif path.parent.name.endswith("_select"):
            record = tuple(replace(one, name=renamed(one.name)) for one in record)
        elif path.parent.name.endswith("_map"):
            record = replace(
                record,
                trajectories=tuple(
                    replace(one, name=renamed(one.name)) for one in record.trajectories
                ),
            )
        elif path.parent.name.endswith("_refine"):
            record = tuple(
                replace(one, plan=replace(one.plan, name=renamed(one.plan.name))) for one in record
            )
        save_record(record, path)
    state = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(state | {"name": "<i>run</i>"}))
    return RunContent(folder)


def renamed(name):
    return f"{HOSTILE}:{name.rpartition(':')[2]}"


def test_the_file_needs_nothing_else_and_is_small(content, replay, tmp_path):
    text = replay.read_text("utf-8")
    assert len(text) < 300_000
    assert not re.findall(r"https?://|url\(|@import", text)
    assert re.findall(r"<(?:script|img|iframe|link)[^>]*(?:src|href)=[^>]*>", text) == [
        '<link rel="icon" href="data:,">'
    ]
    assert "import " not in "".join(re.findall(r'<script type="module">(.*?)</script>', text, re.S))
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text)[1]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in policy
    assert "connect-src" not in policy
    again = tmp_path / "deep" / "again.html"
    assert export.write_replay(RunContent(content.folder), again) == (3, 3)
    assert again.read_bytes() == replay.read_bytes()


def test_the_file_asks_for_nothing(replay, open_page):
    page, asked = open_page("about:blank"), []
    page.on("request", lambda request: asked.append(request.url))
    page.context.set_offline(True)
    try:
        page.goto(replay.as_uri())
        page.wait_for_selector("html[data-ready]")
        shown = page.input_value("#demonstration")
        # The page begins with the motion in the middle, which may be the last of the list.
        page.keyboard.press("ArrowUp" if int(shown) else "ArrowDown")
        page.wait_for_function("shown => demonstration.value !== shown", arg=shown)
        page.wait_for_selector("#demonstration:not([aria-busy])")
        settle(page)
    finally:
        page.context.set_offline(False)
    assert replay.as_uri() in asked
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def test_a_place_that_cannot_be_is_refused_before_the_work(content, tmp_path, monkeypatch):
    monkeypatch.setattr(content, "find", None)
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(RunError, match=r"folder\.html: is a folder; expected the name of a file"):
        export.write_replay(content, tmp_path / "folder.html", "a")


@pytest.mark.parametrize("live", [True, False])
def test_names_are_text(request, hostile, tmp_path, open_page, live):
    if live:
        server = open_view(hostile)
        server.start()
        request.addfinalizer(server.stop)
        page = open_page(server.url)
    else:
        export.write_replay(hostile, tmp_path / "replay.html")
        assert HOSTILE not in (tmp_path / "replay.html").read_text("utf-8")
        page = open_page((tmp_path / "replay.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    page.keyboard.press("n")
    assert page.inner_text("#title") == "<i>run</i>"
    assert page.locator("#demonstration option").first.text_content().startswith(HOSTILE)
    assert page.evaluate("typeof hit") == "undefined"
    assert page.locator("img").count() == 0


def test_one_motion_alone(content, tmp_path, open_page):
    name = content.names[-1]
    path = tmp_path / "one.html"
    assert export.write_replay(content, path, name) == (1, 3)
    page = open_page(path.as_uri())
    page.wait_for_selector("html[data-ready]")
    assert page.locator("#demonstration option").count() == 1
    assert name in page.locator("#demonstration option").inner_text()
    assert "1 of 3 in this file" in page.inner_text("#subtitle")
    with pytest.raises(RunError, match="--motion: no motion 'nobody'"):
        export.write_replay(content, path, "nobody")


def test_a_large_run_is_thinned_out_to_the_limit(content, replay, tmp_path, monkeypatch):
    size = replay.stat().st_size
    monkeypatch.setattr(export, "_WANTED_BYTES", size - 1000)
    slower = tmp_path / "slower.html"
    assert export.write_replay(content, slower) == (3, 3)
    assert slower.stat().st_size < 0.95 * size
    monkeypatch.setattr(export, "_LARGEST_BYTES", slower.stat().st_size - 1000)
    fewer = tmp_path / "fewer.html"
    shown, total = export.write_replay(content, fewer)
    assert 1 <= shown < total
    assert fewer.stat().st_size <= slower.stat().st_size - 1000
    assert export._evenly(list(range(100)), 37, 5) == [0, 37, 50, 74, 99]


def test_the_command_exports_and_the_report_links(small_run, tmp_path, monkeypatch, capsys):
    folder = shutil.copytree(small_run, tmp_path / "run")
    assert besman(monkeypatch, "view", folder, "--export", folder / "replay.html") == 0
    assert re.search(
        r"wrote .*replay\.html: 3 of 3 demonstrations, 0\.\d\d MB", capsys.readouterr().out
    )
    report = html.unescape((folder / "report.html").read_text("utf-8"))
    assert '<a href="replay.html">replay.html</a>' in report


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--export", "x.txt"], r"--export: got x\.txt, expected a name that ends in \.html"),
        (["--motion", "nobody"], "--motion: no motion 'nobody'; .*allowed: subject1"),
    ],
)
def test_what_cannot_be(small_run, monkeypatch, capsys, arguments, message):
    assert besman(monkeypatch, "view", small_run, *arguments) == 2
    assert re.search(message, capsys.readouterr().err)


def test_a_file_that_cannot_be_written(content, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match=r"file/replay\.html: cannot be written: "):
        export.write_replay(content, tmp_path / "file" / "replay.html")


def answer(url, **headers):
    """Ask the server; return status and body."""
    request = urllib.request.Request(url, headers=headers)
    try:
        with urllib.request.urlopen(request) as found:
            return found.status, found.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def test_only_who_has_the_address_is_answered(content):
    server = open_view(content)
    server.start()
    base = f"http://127.0.0.1:{server.port}/"
    place, cookie = enter(server.url)
    inside, own = base + place.strip("/") + "/", {"Cookie": cookie}
    assert answer(inside + "overview", **own)[0] == 200
    assert answer(inside + "demonstration?index=0", **own)[0] == 200
    for page in ("", "index.html", "view.js", "web/camera.js"):
        assert answer(inside + page, **own)[0] == 200
    assert answer(base + "overview")[0] == 403
    assert answer(base + "x" * 32 + "/demonstration?index=0")[0] == 403
    assert answer(inside + "overview", **own, Host="evil.example")[0] == 403
    assert answer(inside + "../run_content.py", **own)[0] in (400, 403, 404)
    assert answer(inside + "run_content.py", **own)[0] == 404
    status, body = answer(inside + "demonstration?index=-1", **own)
    assert status == 422
    assert "index: got '-1', expected a whole number from 0" in json.loads(body)["error"]
    status, body = answer(inside + "demonstration?index=7", **own)
    assert status == 422
    assert "no demonstration 7: there are 3" in json.loads(body)["error"]
    with pytest.raises(WebError, match="is in use"):
        open_view(content, port=server.port)
    server.stop()
