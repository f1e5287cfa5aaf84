"""The real page in Chromium."""

import html
import re

import numpy as np
import pinocchio
import pytest
from browser import settle

from besman.robot.model import load_robot
from besman.view.live import open_view

READY = "html[data-ready]"
# What somebody does on a page is answered by the same modules, wherever it comes from.
ON_ONE = pytest.mark.parametrize("loaded", ["opened_file"], indirect=True, ids=["replay"])


@pytest.fixture(scope="module")
def served(content):
    server = open_view(content)
    server.start()
    yield server
    server.stop()


@pytest.fixture(scope="module")
def asked(served, open_shared):
    """The page from the server; that it is asked what its modules compute does not change it."""
    opened = open_shared(served.url)
    opened.wait_for_selector(READY)
    return opened


@pytest.fixture(scope="module")
def opened_file(replay, open_shared):
    opened = open_shared(replay.as_uri())
    opened.wait_for_selector(READY)
    return opened


@pytest.fixture(scope="module", params=["asked", "opened_file"], ids=["served", "replay"])
def loaded(request):
    """The page of the small run, from the server and from the file: loaded once."""
    return request.getfixturevalue(request.param)


@pytest.fixture
def page(loaded, content):
    """The page as it is when it has just been loaded."""
    as_loaded(loaded, content)
    return loaded


def as_loaded(page, content):
    """Stop, switch everything off, and choose the first demonstration, which begins anew."""
    page.evaluate(
        """() => {
            document.querySelector("#play[aria-label=Pause]")?.click();
            document.querySelectorAll("[aria-pressed=true]").forEach((one) => one.click());
            speed.selectedIndex = [...speed.options].findIndex((one) => one.defaultSelected);
        }"""
    )
    page.select_option("#demonstration", str(content.first))
    page.wait_for_selector("#demonstration:not([aria-busy])")
    page.evaluate("document.activeElement.blur()")
    settle(page)


def wait_at_rest(page):
    """Wait for the picture without jagged edges, which comes when nothing moves any more."""
    page.wait_for_selector("#canvas[data-rests=true]")


def pixels(page):
    """Return the solids' layer as drawn now."""
    return page.evaluate("solids.toDataURL()")


def shown_time(page):
    return float(re.match(r"([\d.]+) s of", page.inner_text("#time"))[1])


def test_both_are_drawn_side_by_side(page):
    half = """left => {
        const {width, height} = solids, data = solids.getContext("2d").getImageData(
            left ? 0 : width / 2, 0, width / 2, height).data;
        let n = 0;
        for (let k = 3; k < data.length; k += 4) n += data[k] > 0;
        return n / (data.length / 4);
    }"""
    assert page.evaluate(half, True) > 0.003
    assert page.evaluate(half, False) > 0.02


def test_scrubbing_moves_the_robot(page):
    before = pixels(page)
    page.fill("#scrubber", "0.4")
    page.wait_for_function("before => solids.toDataURL() !== before", arg=before)
    assert shown_time(page) == pytest.approx(0.4, abs=0.006)


@ON_ONE
def test_play_and_pause(page):
    page.click("#play")
    assert page.get_attribute("#play", "aria-label") == "Pause"
    page.wait_for_function("() => Number(scrubber.value) > 0.05")
    page.click("#play")
    stopped = page.input_value("#scrubber")
    page.wait_for_timeout(100)
    assert page.input_value("#scrubber") == stopped
    assert page.get_attribute("#play", "aria-label") == "Play"


@ON_ONE
def test_the_keyboard_alone(page):
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowRight")
    assert shown_time(page) == pytest.approx(0.11)
    page.keyboard.press("End")
    end = float(page.get_attribute("#scrubber", "max"))
    assert float(page.input_value("#scrubber")) == pytest.approx(end, abs=1e-6)
    page.keyboard.press("Home")
    assert float(page.input_value("#scrubber")) == 0
    page.keyboard.press("+")
    assert page.input_value("#speed") == "1"
    page.keyboard.press("b")
    assert page.get_attribute("#together", "aria-pressed") == "true"
    page.keyboard.press("n")
    assert page.get_attribute("#names", "aria-pressed") == "true"
    n = page.locator("#takes button").count()
    page.keyboard.press("[")
    chosen = page.locator("#takes button[aria-checked=true]")
    assert chosen.inner_text() == page.locator("#takes button").nth(n - 2).inner_text()
    page.keyboard.press(" ")
    page.wait_for_selector("#play[aria-label=Pause]")
    page.keyboard.press(" ")
    page.wait_for_selector("#play[aria-label=Play]")


def test_another_demonstration(page, content):
    first = int(page.input_value("#demonstration"))
    other = (first + 1) % len(content.names)
    page.select_option("#demonstration", str(other))
    page.wait_for_selector("#demonstration:not([aria-busy])")
    assert content.names[other] in page.locator("#demonstration option").nth(other).inner_text()
    motion = load_record_of(content, other)
    assert f"{100 * motion.miss:.1f} cm" in page.inner_text("#outcome")
    assert f"{100 * motion.miss_before:.1f} cm" in page.inner_text("#outcome")


def distance(point, path):
    """Return how far a point is from a path of straight pieces."""
    a, way = path[:-1], np.diff(path, axis=0)
    along = np.einsum("fi,fi->f", point - a, way) / np.maximum((way**2).sum(axis=1), 1e-18)
    nearest = a + np.clip(along, 0, 1)[:, None] * way
    return np.linalg.norm(point - nearest, axis=1).min()


def load_record_of(content, index):
    return content._arms[0].motions[content.names[index]]


def test_the_generations_are_the_search_s_own(page, content):
    motion = load_record_of(content, int(page.input_value("#demonstration")))
    words = page.locator("#takes button").all_inner_texts()
    assert len(words) == 1 + len(motion.milestones)
    assert words[0].startswith("mapped")
    for text, (episode, _) in zip(words[1:], motion.milestones, strict=True):
        assert f"generation {motion.generations[episode]} " in text
    assert words[1].startswith("imitated")
    page.locator("#takes button").nth(1).click()
    assert "imitated" in page.inner_text("#robot-caption")


@ON_ONE
def test_dragging_turns_and_reset_turns_back(page):
    wait_at_rest(page)
    before = pixels(page)
    box = page.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 60, y + 20, steps=3)
    page.mouse.up()
    settle(page)
    wait_at_rest(page)
    assert pixels(page) != before
    page.click("#reset")
    settle(page)
    wait_at_rest(page)
    assert pixels(page) == before


def test_the_theme_is_the_system_s_until_it_is_switched(open_page, served):
    page = open_page(served.url, color_scheme="light")
    page.wait_for_selector(READY)
    colour = "() => getComputedStyle(document.body).backgroundColor"
    light = page.evaluate(colour)
    assert light == "rgb(255, 255, 255)"
    page.emulate_media(color_scheme="dark")
    dark = page.evaluate(colour)
    assert dark != light
    page.click("#theme")
    assert page.evaluate(colour) == light
    page.click("#theme")
    assert page.evaluate(colour) == dark
    page.emulate_media(color_scheme="light")
    assert page.evaluate(colour) == dark
    page.click("#theme")
    assert page.evaluate(colour) == light


def test_forward_kinematics_is_pinocchio_s(asked):
    for name in ("ur5", "iiwa7", "rh5_left"):
        robot = load_robot(name)
        rng = np.random.default_rng(0)
        angles = rng.uniform(robot.limits.position_min, robot.limits.position_max, (20, robot.n))
        chain = robot.chain
        found = asked.evaluate(
            """async ([robot, angles]) => {
                const {forwardKinematics} = await import("./kinematics.js");
                return angles.map(row => [...forwardKinematics(robot, row).tip]);
            }""",
            [
                {
                    "placements": [one.ravel().tolist() for one in chain.placements],
                    "axes": chain.axes.tolist(),
                    "tip": chain.tip.ravel().tolist(),
                },
                angles.tolist(),
            ],
        )
        data = robot.model.createData()
        for row, tip in zip(angles, found, strict=True):
            pinocchio.framesForwardKinematics(robot.model, data, row)
            expected = data.oMf[robot.tip_frame].homogeneous[:3]
            np.testing.assert_allclose(np.reshape(tip, (3, 4)), expected, atol=1e-9)


def test_the_page_unpacks_what_was_packed(asked, content):
    index = content.first
    found = asked.evaluate(
        """async index => {
            const {openSource} = await import("./source.js");
            const one = await openSource().demonstration(index);
            const take = one.arms[0].takes.at(-1);
            const list = ({values}) => [...values];
            return {object: list(take.object), joints: list(take.joints),
                    markers: [...one.person.markers.values].slice(0, 27),
                    hand: list(one.arms[0].hand)};
        }""",
        index,
    )
    motion = load_record_of(content, index)
    path = np.reshape(found["object"], (-1, 3))
    # Every frame of the page is on the record's path, and the last is where it landed.
    assert max(distance(point, motion.object_path) for point in path) < 5e-4
    np.testing.assert_allclose(path[-1], motion.object_path[-1], atol=2e-3)
    hand = np.reshape(found["hand"], (-1, 3))
    recorded = content._arms[0].demonstrations[content.names[index]].poses[:, :3]
    np.testing.assert_allclose(np.diff(hand, axis=0), np.diff(recorded, axis=0), atol=2e-4)


def test_a_demonstration_that_cannot_be_had_is_said_on_the_page(open_page, served, content):
    page = open_page(served.url, expect_errors=True)
    page.wait_for_selector(READY)
    page.route("**/demonstration?*", lambda route: route.abort())
    page.select_option("#demonstration", str((content.first + 1) % len(content.names)))
    page.wait_for_selector("#message:not([hidden])")
    assert "does not answer any more" in page.inner_text("#message")


def test_triangles_are_filled_where_the_camera_sees_them(asked):
    found = asked.evaluate(
        """async () => {
            const {Raster, shadesOf} = await import("./raster.js");
            const {sphere} = await import("./geometry.js");
            const {pose} = await import("./kinematics.js");
            const {OrbitCamera} = await import("./web/camera.js");
            const camera = new OrbitCamera({target: [0, 0, 1], azimuth: 0.4, distance: 3});
            const part = {x: 100, y: 20, width: 300, height: 200};
            const raster = new Raster();
            raster.resize(420, 240);
            raster.look(part, camera);
            const near = [0.6, 0.3, 1.1], far = [-0.5, -0.2, 0.9];
            const draw = (place, colour) => raster.draw(
                sphere(0.1, 40), pose(...place, 1, 0, 0, 0), shadesOf(colour), [0, 0, 1]);
            draw(near, [1, 0, 0]);
            draw(far, [0, 0, 1]);
            return [near, far].map((place, channel) => {
                let n = 0, x = 0, y = 0;
                raster.pixels.forEach((pixel, k) => {
                    const red = pixel & 255, blue = (pixel >> 16) & 255;
                    if (!(pixel >>> 24) || (channel ? blue <= red : red <= blue)) return;
                    n += 1;
                    x += k % 420 + 0.5;
                    y += Math.floor(k / 420) + 0.5;
                });
                const seen = camera.project(place, part.width, part.height);
                const at = [part.x + seen[0], part.y + seen[1]];
                const radius = 0.1 * camera.pixelsPerMetre(seen[2], part.height);
                return {n, centre: [x / n, y / n], at, radius,
                        front: raster.hides(...at, seen[2] - 0.15),
                        behind: raster.hides(...at, seen[2] + 0.15)};
            });
        }"""
    )
    for one in found:
        assert one["n"] == pytest.approx(np.pi * one["radius"] ** 2, rel=0.06)
        np.testing.assert_allclose(one["centre"], one["at"], atol=1.0)
        assert one["behind"]
        assert not one["front"]


def test_the_blocks_of_a_whole_task_are_a_time_line(asked):
    """Blocks that follow each other with one label are one; a click goes to its beginning."""
    told = asked.evaluate(
        """async () => {
            const { showBlocks, tellBlock } = await import("./timeline.js");
            const list = document.createElement("ol"), sought = [];
            const labels = ["reach", "idle", "idle", "put"];
            const blocks = labels.map((label, k) => ({ label, start: k, end: k + 1 }));
            const stage = { blocks, start: 0, end: 4 };
            showBlocks(list, stage, (time) => sought.push(time));
            list.children[1].click();
            const spans = [...list.children].map(({ style }) => [style.left, style.width]);
            const label = tellBlock(list, stage, 2.5);
            const now = [...list.children].map(({ className }) => className);
            const backs = [...list.children].map(({ style }) => style.background);
            showBlocks(list, { blocks: [], start: 0, end: 4 }, () => {});
            return { spans, sought, label, now, colours: new Set(backs).size, hidden: list.hidden };
        }"""
    )
    assert told == {
        "spans": [["0%", "25%"], ["25%", "50%"], ["75%", "25%"]],
        "sought": [1],
        "label": "idle",
        "now": ["", "now", ""],
        "colours": 3,
        "hidden": True,
    }


def test_the_person_does_what_the_arm_does_block_by_block(asked):
    """Evenly between moments that belong together; before and after at their own pace."""
    times = asked.evaluate(
        """async () => {
            const { Stage } = await import("./stage.js");
            const take = { clock: [[0, 2, 3, 3, 5], [0, 1, 1, 1, 4]], span: [0, 5] };
            const stage = { takes: [take], demonstration: { duration: 4 } };
            const own = (time) => Stage.prototype.personTime.call(stage, time);
            return [-1, 1, 2.5, 3, 4, 6].map(own);
        }"""
    )
    assert times == [-1, 0.5, 1, 1, 2.5, 5]


def test_a_page_that_holds_the_replay_stays_where_it_is(replay, tmp_path, open_page):
    inside = html.escape(replay.read_text())
    host = tmp_path / "host.html"
    host.write_text(f'<div style="height: 3000px"></div><iframe srcdoc="{inside}"></iframe>')
    opened = open_page(host.as_uri())
    opened.frame_locator("iframe").locator(READY).wait_for(state="attached")
    assert opened.evaluate("scrollY") == 0
