import json

import numpy as np
import pytest
from browser import wait_for_colors
from command_line import besman

from besman.config.resources import resource_folder
from besman.following.live import LiveFollower
from besman.following.plans import make_plan
from besman.live.file_source import FileSource
from besman.standalone.train_files import train_files
from besman.view.follow_live import describe_present, open_follow_page
from besman.web.push import Broadcast

BLOCK = {"label": "x", "start_s": 7.0, "end_s": 8.0, "status": "new", "final": False}
SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return train_files([SAMPLE], tmp_path_factory.mktemp("model") / "m", "right_arm", ())[0]


@pytest.fixture(scope="module")
def followed(model):
    """A stream in its middle: nine seconds of it were read."""
    follower = LiveFollower(FileSource(SAMPLE, 0.0), make_plan(None, [model], calibration_s=4.0))
    before = describe_present(follower)
    news, lines = Broadcast(), []
    found = follower.open()
    lines.append({"kind": "stream", "source": found.source, "rate_hz": found.rate_hz})
    for one in follower.run():
        lines.append(one)
        if one.get("time_s", 0.0) >= 9.0:
            break
    for one in lines:
        news.send(json.dumps(one))
    return follower, news, lines, before


def test_what_is_shown_is_where_the_markers_are_and_how_fast_the_hand(followed):
    follower, _, lines, before = followed
    assert (before["markers"], before["delay_ms"]) == ([], None)
    shown = describe_present(follower)
    assert shown["time_s"] == lines[-1]["time_s"]
    source = follower.look()
    assert shown["names"] == list(source.names)
    seen = np.isfinite(source.markers).all(axis=1)
    assert [one is not None for one in shown["markers"]] == seen.tolist()
    places = [one for one in shown["markers"] if one is not None]
    np.testing.assert_allclose(places, source.markers[seen], atol=6e-4)
    assert 0.0 <= shown["speed_m_s"] < 5.0
    assert shown["confidence"] == {}
    json.dumps(shown, allow_nan=False)


def test_a_browser_draws_borders_and_speed(followed, open_page, tmp_path):
    follower, news, lines, _ = followed
    server = open_follow_page(follower, news)
    server.start()
    try:
        page = open_page(server.url)
        page.locator("#time", has_text=f"{lines[-1]['time_s']:.2f} s").wait_for()
        assert page.text_content("#title") == "besman follow: subject1.tsv"
        # Markers and floor; borders that are final, though they came after the frame.
        wait_for_colors(page, "canvas", ["224,120,42", "195,201,210"])
        wait_for_colors(page, "strip", ["224,120,42"])
        news.send(json.dumps({"kind": "block", "of": "left", **BLOCK}))
        wait_for_colors(page, "strip", ["224,120,42", "11,97,164"])
        page.screenshot(path=tmp_path / "follow.png")
        news.end()
        page.locator("#state", has_text="besman follow has ended").wait_for()
    finally:
        server.stop()


def test_the_command_says_where_it_is(model, monkeypatch, capsys):
    live = ("follow", "--live", f"file://{SAMPLE}?pace=0", "--model", str(model))
    assert besman(monkeypatch, *live, "--port", "8000") == 2
    assert "--port: is of --page" in capsys.readouterr().err
    assert besman(monkeypatch, "follow", str(SAMPLE), "--model", str(model), "--page") == 2
    assert "--page: is of a live stream" in capsys.readouterr().err
    assert besman(monkeypatch, *live, "--page") == 0
    first = json.loads(capsys.readouterr().out.splitlines()[0])
    assert first["kind"] == "page"
    assert first["url"].startswith("http://127.0.0.1:")
