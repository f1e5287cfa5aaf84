"""The page of a stream that is mirrored shows what the arm and the person do at the moment."""

import json
import time

import numpy as np
import pytest
from browser import wait_for_colors
from command_line import besman
from web_session import session
from websockets.sync.client import connect

from besman.config.resources import resource_folder
from besman.following.hand_placement import MirrorPlan
from besman.following.mirror import Mirror
from besman.live.file_source import FileSource
from besman.robot.kinematics import forward_kinematics
from besman.view.mirror_live import describe_frame, open_mirror_page
from besman.web.push import Broadcast

pytest.importorskip("ruckig")

SAMPLE = resource_folder("data") / "stick_throw" / "subject1.tsv"


@pytest.fixture(scope="module")
def mirrored(robot):
    """A stream in its middle: eight seconds of it were read."""
    mirror = Mirror(
        FileSource(SAMPLE, 0.0), MirrorPlan(robot, "right_arm"), learn_s=4.0, by_frames=True
    )
    before = describe_frame(mirror)
    mirror.open()
    lines = []
    for one in mirror.run():
        lines.append(one)
        if one["kind"] == "joints" and one["time_s"] >= 6.0:
            break
    return mirror, lines, before


def test_person_and_arm_are_in_one_world(mirrored, robot):
    mirror, lines, _ = mirrored
    shown = describe_frame(mirror)
    assert shown["time_s"] == lines[-1]["time_s"]
    assert shown["away_m"] == pytest.approx(lines[-1]["away_m"], abs=1e-3)
    simulated = np.array(lines[-1]["simulated_rad"])
    tool = forward_kinematics(robot.chain, simulated[None])[0, :3, 3]
    np.testing.assert_allclose(shown["tool"], tool, atol=1e-4)
    assert len(shown["capsules"]) == len(robot.chain.capsule_radii)
    # The hand is where the tool is wanted, as far as the tool is long.
    hand = np.array(shown["markers"][shown["names"].index("hand_top")])
    assert np.linalg.norm(hand - shown["asked"]) < 0.4


def test_before_the_first_frame_there_is_nobody(mirrored):
    _, _, before = mirrored
    assert before["state"] == "the arm has not begun"
    assert before["markers"] == before["capsules"] == []
    json.dumps(before, allow_nan=False)


def test_what_is_pushed_is_what_is_told_and_what_is_shown(mirrored):
    news = Broadcast()
    news.send('{"kind": "begin"}')
    server = open_mirror_page(mirrored[0], news)
    server.start()
    try:
        place, cookie = session(server)
        address = f"ws://127.0.0.1:{server.port}{place}news"
        with connect(address, additional_headers={"Cookie": cookie}) as listening:
            told = [json.loads(listening.recv(60)) for _ in range(2)]
        assert sorted(one["kind"] for one in told) == ["begin", "frame"]
        shown = next(one for one in told if one["kind"] == "frame")
        assert shown == {"kind": "frame"} | json.loads(json.dumps(describe_frame(mirrored[0])))
    finally:
        news.end()
        server.stop()


def test_an_arm_that_comes_to_rest_is_shown_though_nothing_comes(robot):
    """The source says nothing any more: the moment goes on, with the arm and its state."""
    mirror = Mirror(FileSource(SAMPLE, 0.0), MirrorPlan(robot, "right_arm"), 4.0, by_frames=True)
    mirror.open()
    lines = mirror.run()
    for one in lines:
        if one["kind"] == "joints" and one["time_s"] >= 6.0:
            break
    before = mirror.look()
    # Its clock is this machine's from now on.
    mirror._by_frames = False
    mirror._begun_s = time.perf_counter() - mirror._n_given / 1000 - 1.5
    mirror._go_on()
    after = mirror.look()
    assert (before.state, after.state) == ("follows", "rests")
    assert not np.allclose(before.joints, after.joints)
    assert after.time_s == before.time_s
    lines.close()


def test_a_browser_draws_it(mirrored, open_page, tmp_path):
    news = Broadcast()
    server = open_mirror_page(mirrored[0], news)
    server.start()
    try:
        page = open_page(server.url)
        page.locator("#time", has_text="6.00 s").wait_for()
        assert page.text_content("#title") == "besman mirror: ur5, stick_holder"
        # Person, robot and floor as the theme has them.
        wait_for_colors(page, "canvas", ["224,120,42", "11,97,164", "195,201,210"])
        page.screenshot(path=tmp_path / "mirror.png")
        news.send('{"kind": "notice", "text": "the source began anew"}')
        page.locator("#notice", has_text="the source began anew").wait_for()
        news.end()
        page.locator("#state", has_text="besman mirror has ended").wait_for()
    finally:
        server.stop()


def test_the_command_says_where_it_is(monkeypatch, capsys):
    live = ("mirror", "--live", f"file://{SAMPLE}?pace=0", "--robot", "ur5", "--learn", "600")
    assert besman(monkeypatch, *live, "--page") == 2
    told = capsys.readouterr()
    first = json.loads(told.out.splitlines()[0])
    assert first["kind"] == "page"
    assert first["url"].startswith("http://127.0.0.1:")
    assert "the hand was seen for" in told.err
