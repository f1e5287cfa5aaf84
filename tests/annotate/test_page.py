"""The real page in Chromium, by mouse and by keyboard."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest
from browser import PATIENCE_S, settle, until

from besman.io.recordings.formats import read_recording
from besman.io.segments_json import read_segments
from besman.standalone.train_files import train_files

NASTY = """<img src=x onerror="document.title='pwned'">'"&<b>"""
# Where rows of the recording are on the screen.
PLACE = """([layer, row]) => {
  const { timeline, view, lanes } = besman, box = timeline.element.getBoundingClientRect();
  const x = 92 + (row - view.from) / view.span * timeline.width;
  return [box.left + x, box.top + timeline.lanesTop + 34 * lanes.indexOf(layer) + 17];
}"""


WINDOW = {"width": 1000, "height": 640}

# What is written does not come to the disk once a file is there.
SLOW_TO_SAVE = """
import os, sys, time

real, slow, sys.argv = os.fsync, sys.argv[1], sys.argv[2:]
os.fsync = lambda file: (os.path.exists(slow) and time.sleep(600), real(file))
from besman.cli.main import main
main()
"""


@pytest.fixture
def annotate(serve, open_page):
    """Open a server's page, and wait until it can be used; it is left before its server ends."""

    def start(url, expect_errors=False):
        page = open_page(url, expect_errors, WINDOW)
        page.wait_for_selector("html[data-ready]")
        until(page, "besman.proposals.loaded.get(besman.layer) !== 'coming'")
        return page

    return start


def rows(page):
    return page.evaluate("besman.saving.rows()")


def wait_saved(page):
    until(page, "!besman.saving.dirty && !besman.saving.going")


def drag(page, layer, start, end):
    """Drag from one row to another in a lane."""
    page.mouse.move(*page.evaluate(PLACE, [layer, start]))
    page.mouse.down()
    page.mouse.move(*page.evaluate(PLACE, [layer, end]), steps=4)
    page.mouse.up()


def press(page, *keys):
    for key in keys:
        page.keyboard.press(key)
    settle(page)


def wait_for(page, condition):
    """Wait for a condition that is not the page's, while the page goes on."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end
        page.wait_for_timeout(15)


def wait_decided(page):
    """Wait until proposals have the names that come of what is labelled by now."""
    until(page, "!besman.proposals.busy")


def on_disk(path, recording_path):
    read = read_segments(path, read_recording(recording_path))
    layers = read.layers or ("",) * len(read.labels)
    return [
        [*bounds, label, layer]
        for bounds, label, layer in zip(read.bounds.tolist(), read.labels, layers, strict=True)
    ]


def write_rows(path, *rows):
    keys = ("start index", "end index", "label")
    path.write_text(json.dumps([dict(zip(keys, row, strict=True)) for row in rows]))


def test_drag_label_undo_redo_save_reload(serve, annotate, recording_path, segments_path):
    write_rows(segments_path, (101, 161, "swing"), (161, 221, "throw"))
    page = annotate(serve(recording_path).url)
    assert rows(page) == [[100, 160, "swing", ""], [160, 220, "throw", ""]]
    page.evaluate("besman.view.show(50, 350), besman.draw('view')")
    drag(page, "", 160, 180)
    moved = rows(page)
    assert moved[0][1] == moved[1][0]
    assert abs(moved[0][1] - 180) <= 2
    drag(page, "", moved[1][1], 250)
    assert abs(rows(page)[1][1] - 250) <= 2
    page.click("#labels button:has-text('swing')")
    assert rows(page)[1][2] == "swing"
    press(page, "2")
    assert rows(page)[1][2] == "throw"
    press(page, *["Control+z"] * 4)
    assert rows(page) == [[100, 160, "swing", ""], [160, 220, "throw", ""]]
    press(page, "Control+Shift+Z", "Control+y")
    assert rows(page)[0] == moved[0]
    press(page, "Control+s")
    wait_saved(page)
    assert on_disk(segments_path, recording_path) == rows(page)
    now = rows(page)
    page.reload()
    page.wait_for_selector("html[data-ready]")
    assert rows(page) == now


def test_borders_are_added_and_removed_by_mouse(serve, annotate, recording_path, segments_path):
    write_rows(segments_path, (101, 161, "swing"))
    page = annotate(serve(recording_path).url)
    page.evaluate("besman.view.show(50, 350), besman.draw('view')")
    page.mouse.dblclick(*page.evaluate(PLACE, ["", 130]))
    first, second = rows(page)
    assert first[1] == second[0]
    assert abs(first[1] - 130) <= 2
    settle(page)
    page.click("#selected button:has-text('Remove')")
    until(page, "besman.saving.rows().length === 1")
    assert rows(page) == [first]
    # A drag from where nothing is makes a segment; it stops where the next begins.
    page.evaluate("besman.document.propose = () => {}")
    page.evaluate("""besman.document.step(besman.document.segments())""")
    drag(page, "", 200, 240)
    assert len(rows(page)) == 2
    drag(page, "", 290, 220)
    made = rows(page)[2]
    assert made[0] == rows(page)[1][1]


def test_layers_do_not_disturb_each_other(serve, annotate, recording_path, segments_path):
    page = annotate(serve(recording_path, labels=("hold",)).url)
    page.evaluate("besman.view.show(50, 350), besman.draw('view')")
    page.evaluate("besman.useLabel('hold')")
    for name, layer in (("left hand", "left_hand"), ("actions", "actions")):
        page.click(f"#layers button:has-text('{name}')")
        drag(page, layer, 100, 200)
    page.click("#layers button:has-text('actions')")
    wait_saved(page)
    found = on_disk(segments_path, recording_path)
    assert [row[3] for row in found] == ["actions", "left_hand"] or [row[3] for row in found] == [
        "left_hand",
        "actions",
    ]
    assert all(abs(row[0] - 100) <= 2 and abs(row[1] - 200) <= 2 for row in found)
    until(page, "besman.proposals.loaded.get('actions') === 'here'")
    settle(page)
    assert "proposals are for the layers of hands" in page.inner_text("#note")


def test_labels_are_text_whatever_they_hold(serve, annotate, recording_path, segments_path):
    write_rows(segments_path, (101, 161, NASTY))
    page = annotate(serve(recording_path, labels=("</script><i>",)).url)
    press(page, "n")
    assert NASTY in page.inner_text("#labels")
    assert NASTY in page.inner_text("#selected")
    page.click("#tab-segments")
    settle(page)
    assert NASTY in page.inner_text("#list")
    press(page, "l")
    page.keyboard.type('"quoted" <i>é</i>')
    press(page, "Enter")
    wait_saved(page)
    assert on_disk(segments_path, recording_path)[0][2] == '"quoted" <i>é</i>'
    assert page.evaluate("document.querySelectorAll('img, i:not(.dot, .bar i)').length") == 0
    assert page.title() == "besman annotate"


def test_everything_goes_by_keyboard(serve, annotate, recording_path, segments_path):
    page = annotate(serve(recording_path).url)
    press(page, "Home", *["Shift+ArrowRight"] * 5, "i", *["Shift+ArrowRight"] * 4, "o")
    page.keyboard.type("swing")
    press(page, "Enter")
    assert rows(page) == [[50, 90, "swing", ""]]
    # Its end is taken and moved, then its start.
    press(page, "e", "e", "ArrowRight", "ArrowRight", "Shift+ArrowRight", "Escape")
    assert rows(page) == [[50, 102, "swing", ""]]
    press(page, "e", "ArrowLeft", "e", "e")
    assert rows(page) == [[49, 102, "swing", ""]]
    press(page, "Home", *["Shift+ArrowRight"] * 7, "x")
    assert rows(page) == [[49, 70, "swing", ""], [70, 102, "swing", ""]]
    press(page, "l")
    page.keyboard.type("throw")
    press(page, "Enter")
    assert [row[2] for row in rows(page)] == ["swing", "throw"]
    press(page, "b", "2", "m")
    assert rows(page) == [[49, 102, "throw", ""]]
    press(page, "Delete")
    assert rows(page) == []
    press(page, *["Control+z"] * 20)
    assert rows(page) == []
    press(page, "Control+y", "Control+y", "Control+y", "Control+s")
    wait_saved(page)
    assert on_disk(segments_path, recording_path) == rows(page) == [[49, 102, "swing", ""]]
    press(page, "?")
    assert page.is_visible("#help-dialog")
    assert "these keys" in page.inner_text("#help-dialog")
    press(page, "Escape")
    page.wait_for_selector("#help-dialog", state="hidden")


def test_proposals_are_accepted_mended_and_rejected_least_certain_first(
    serve, annotate, recording_path, segments_path, truth_path
):
    page = annotate(serve(recording_path).url)
    truth = on_disk(truth_path, recording_path)
    n = page.evaluate("besman.proposals.queue().length")
    assert n >= len(truth) - 2
    # Nothing has a name yet: the first four get one.
    press(page, "Enter")
    for k, (_, _, label, _) in enumerate(truth[:4]):
        press(page, "l")
        page.keyboard.type(label)
        press(page, "Enter")
        assert len(rows(page)) == k + 1
    until(page, "besman.proposals.examples >= 4")
    wait_decided(page)
    confidence = page.evaluate("besman.proposals.queue().map((one) => besman.confidenceOf(one))")
    assert confidence == sorted(confidence)
    assert confidence[0] > 0
    press(page, "Escape", "p")
    first = page.evaluate("besman.document.find(besman.selection.id)")
    assert page.evaluate("besman.proposals.queue()[0].id") == first["id"]
    label = page.evaluate("besman.labelOf(besman.document.find(besman.selection.id))")
    press(page, "Enter")
    assert [first["start"], first["end"], label, ""] in rows(page)
    wait_decided(page)
    # The next one is rejected, and comes back with undo.
    left = page.evaluate("besman.proposals.queue().length")
    press(page, "r")
    assert page.evaluate("besman.proposals.queue().length") == left - 1
    press(page, "Control+z")
    assert page.evaluate("besman.proposals.queue().length") == left
    # Another label, and another end.
    press(page, "p")
    wrong = page.evaluate("besman.document.find(besman.selection.id)")
    press(page, "e", "e", "ArrowLeft", "ArrowLeft", "1")
    label = page.evaluate("besman.labels[0]")
    assert [wrong["start"], wrong["end"] - 2, label, ""] in rows(page)
    wait_saved(page)
    assert on_disk(segments_path, recording_path) == rows(page)


def test_what_is_labelled_here_trains_a_model(
    serve, annotate, recording_path, segments_path, tmp_path
):
    page = annotate(serve(recording_path, labels=("swing", "throw")).url)
    press(page, "Enter", "1", "2", "1", "2", "1")
    wait_saved(page)
    assert len(on_disk(segments_path, recording_path)) == 5
    model, about = train_files([recording_path], tmp_path / "model", "right_arm", ())
    assert model.is_file()
    assert {"swing", "throw"} <= set(json.loads(about.read_text())["classes"])


def test_two_tabs_on_one_file(serve, annotate, recording_path, segments_path):
    server = serve(recording_path, labels=("a", "b"))
    page = annotate(server.url, expect_errors=True)
    other = annotate(server.url, expect_errors=True)
    # It is to learn of the other's save by its own, not by looking from time to time.
    other.evaluate("besman.saving.look = async () => {}, null")
    press(page, "Enter", "1")
    wait_saved(page)
    press(other, "Enter", "2")
    other.wait_for_selector("#changed-dialog[open]")
    assert "Another window or program wrote" in other.inner_text("#changed-text")
    assert [row[2] for row in on_disk(segments_path, recording_path)] == ["a"]
    other.click("#changed-load")
    until(other, "!besman.saving.dialog.open")
    assert [row[2] for row in rows(other)] == ["a"]
    # What was there before is one undo away, and the first tab is told in its turn.
    press(other, "Control+z")
    assert [row[2] for row in rows(other)] == ["b"]
    wait_saved(other)
    page.evaluate("besman.saving.look()")
    page.wait_for_selector("#changed-dialog[open]")
    page.click("#changed-keep")
    wait_saved(page)
    assert [row[2] for row in on_disk(segments_path, recording_path)] == ["a"]
    backup = segments_path.with_name(segments_path.name + ".bak")
    assert [row[2] for row in on_disk(backup, recording_path)] == ["b"]


def test_file_changed_underneath(serve, annotate, recording_path, segments_path):
    page = annotate(serve(recording_path, labels=("a",)).url, expect_errors=True)
    press(page, "Enter", "1")
    wait_saved(page)
    write_rows(segments_path, (1, 50, "theirs"))
    page.evaluate("besman.saving.look()")
    page.wait_for_selector("#changed-dialog[open]")
    assert "changed nothing since" in page.inner_text("#changed-text")
    page.click("#changed-later")
    assert "changed elsewhere" in page.inner_text("#saved")
    press(page, "p", "1")
    assert len(rows(page)) == 2
    assert [row[2] for row in on_disk(segments_path, recording_path)] == ["theirs"]
    page.click("#saved")
    # A file that is no segments file cannot be loaded; mine can still be kept.
    segments_path.write_text("[{]")
    page.click("#changed-load")
    until(page, "document.getElementById('changed-text').textContent.includes('not valid JSON')")
    page.click("#changed-keep")
    wait_saved(page)
    assert on_disk(segments_path, recording_path) == rows(page)


def test_server_killed_in_the_middle_of_a_save(open_page, recording_path, segments_path):
    """The file stays whole, the page says so and keeps what it has."""
    slow = recording_path.with_name("slow")
    command = [sys.executable, "-c", SLOW_TO_SAVE, str(slow), "besman", "annotate"]
    command += [str(recording_path), "--no-browser", "--labels", "a,b"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ)
    try:
        url = next(filter(None, (re.search(r"http://\S+", line) for line in server.stdout)))[0]
        page = open_page(url, True, WINDOW)
        page.wait_for_selector("html[data-ready]")
        until(page, "besman.proposals.loaded.get('') === 'here'")
        press(page, "Enter", "1")
        wait_saved(page)
        before = segments_path.read_bytes()
        slow.touch()
        # The next proposal is selected.
        press(page, "2")
        until(page, "besman.saving.going !== null")
        wait_for(page, segments_path.with_name(f".{segments_path.name}.tmp").exists)
    finally:
        server.send_signal(signal.SIGKILL)
        server.wait()
    assert segments_path.read_bytes() == before
    page.wait_for_selector("#failure:not([hidden])")
    assert "Not saved: besman does not answer" in page.inner_text("#failure")
    with page.expect_download() as download:
        page.click("#failure button")
    rescued = json.loads(download.value.path().read_text())
    assert [row["label"] for row in rescued] == ["a", "b"]
    assert segments_path.read_bytes() == before


def test_markers_are_chosen_in_space_and_time_runs(serve, annotate, recording_path):
    page = annotate(serve(recording_path).url)
    box = page.locator("#scene").bounding_box()
    at = page.evaluate(
        "[...besman.scene.screen.subarray(3 * besman.about.markers.indexOf('Elbow')).slice(0, 2)]"
    )
    page.mouse.click(box["x"] + at[0], box["y"] + at[1])
    assert page.evaluate("besman.about.markers[besman.marker]") == "Elbow"
    assert "Elbow" in page.inner_text("#chosen-legend")
    press(page, "Home", ".", ".")
    assert page.inner_text("#speed").startswith("4")
    # So slowly that its end is far when it is stopped.
    press(page, ",", ",", ",", "Space")
    assert page.inner_text("#speed").startswith("0.5")
    until(page, "besman.row > 10")
    press(page, "Space")
    row = page.evaluate("besman.row")
    page.wait_for_timeout(100)
    assert page.evaluate("besman.row") == row
    assert row < page.evaluate("besman.about.n_samples") - 1
    page.click("#show-velocities")
    assert page.evaluate("besman.quantity") == "velocities"
    # The wheel zooms around the pointer.
    place = page.evaluate(PLACE, ["", row])
    page.mouse.move(*place)
    page.mouse.wheel(0, -600)
    until(page, "besman.view.span < 0.5 * besman.about.n_samples")
    again = page.evaluate(PLACE, ["", row])
    assert again[0] == pytest.approx(place[0], abs=2)


def test_one_recording_after_the_other(serve, annotate, recording_path):
    other = recording_path.with_name("other.tsv")
    other.write_bytes(recording_path.read_bytes())
    page = annotate(serve(recording_path, other, labels=("a",)).url)
    press(page, "Enter", "1", "]")
    until(page, "besman.index === 1 && besman.opened")
    assert rows(page) == []
    until(page, "besman.proposals.loaded.get('') === 'here'")
    press(page, "Enter", "1")
    wait_saved(page)
    assert len(on_disk(other.with_name("other_manually_segmented.json"), other)) == 1
    press(page, "[")
    until(page, "besman.index === 0 && besman.opened")
    assert len(rows(page)) == 1


def two_recordings(recording_path):
    other = recording_path.with_name("other.tsv")
    other.write_bytes(recording_path.read_bytes())
    return recording_path, other


def hold_route(page, pattern):
    """Keep what is asked for until it is let go; return the list of it."""
    held = []
    page.route(pattern, lambda route: held.append(route))
    return held


def wait_held(page, held):
    wait_for(page, lambda: held)


def test_nothing_is_saved_under_a_recording_that_is_still_coming(serve, annotate, recording_path):
    paths = two_recordings(recording_path)
    page = annotate(serve(*paths, labels=("a",)).url)
    press(page, "Enter", "1")
    mine = rows(page)
    held = hold_route(page, "**/sketch?recording=1*")
    press(page, "]")
    wait_held(page, held)
    assert page.evaluate("[besman.index, besman.saving.index]") == [0, 0]
    assert on_disk(paths[0].with_name("throws_manually_segmented.json"), paths[0]) == mine
    # Neither keys nor buttons change what is about to be replaced.
    press(page, "p", "1", "Delete", "Control+z")
    assert page.evaluate("document.getElementById('undo').inert")
    assert rows(page) == mine
    held[0].continue_()
    until(page, "besman.index === 1 && !besman.locked")
    assert rows(page) == []
    assert page.evaluate("besman.saving.path").endswith("other_manually_segmented.json")
    assert not paths[1].with_name("other_manually_segmented.json").exists()


def test_recording_that_cannot_be_opened_leaves_the_one_shown(serve, annotate, recording_path):
    paths = two_recordings(recording_path)
    page = annotate(serve(*paths, labels=("a",)).url, expect_errors=True)
    press(page, "Enter", "1")
    mine = rows(page)
    page.route("**/sketch?recording=1*", lambda route: route.abort())
    page.select_option("#recording", "1")
    page.wait_for_selector("#failure:not([hidden])")
    assert "other.tsv cannot be opened: besman does not answer" in page.inner_text("#failure")
    assert page.input_value("#recording") == "0"
    assert page.evaluate("[besman.index, besman.signals.recording, besman.locked]") == [0, 0, False]
    assert rows(page) == mine
    page.unroute("**/sketch?recording=1*")
    page.select_option("#recording", "1")
    until(page, "besman.index === 1")
    assert not page.is_visible("#failure")


def test_of_two_quick_switches_the_last_counts(serve, annotate, recording_path):
    paths = two_recordings(recording_path)
    page = annotate(serve(*paths, labels=("a",)).url)
    held = hold_route(page, "**/sketch?recording=1*")
    page.select_option("#recording", "1")
    wait_held(page, held)
    page.select_option("#recording", "0")
    until(page, "!besman.locked")
    with page.expect_event("requestfinished", lambda one: "recording=1" in one.url):
        held[0].continue_()
    settle(page)
    assert page.evaluate("[besman.index, besman.signals.recording]") == [0, 0]
    assert page.input_value("#recording") == "0"


def test_parts_are_joined_with_parts_and_do_not_become_wholes_over_others(
    serve, annotate, recording_path, segments_path
):
    write_rows(segments_path, (101, 141, "a"), (111, 121, "b_part"), (121, 131, "c_part"))
    page = annotate(serve(recording_path).url)
    page.evaluate("besman.document.step(besman.document.segments())")
    choose = "besman.select(besman.document.items.find((one) => one.label === '%s').id)"
    page.evaluate(choose % "b_part")
    page.evaluate("besman.actions.applyLabel('whole')")
    assert "no room" in page.inner_text("#say")
    assert [row[2] for row in rows(page)] == ["a", "b_part", "c_part"]
    press(page, "m")
    assert [100, 140, "a", ""] in rows(page)
    assert [110, 130, "b_part", ""] in rows(page)
    press(page, "Delete")
    # A part that only touches a whole is not joined with it; free, it becomes a whole.
    page.evaluate("""besman.document.step([...besman.document.items,
      {...besman.document.items[0], id: -1, start: 60, end: 100, label: 'd_part'}])""")
    page.evaluate(choose % "d_part")
    press(page, "m")
    assert [row[:2] for row in rows(page)] == [[60, 100], [100, 140]]
    page.evaluate("besman.actions.applyLabel('whole')")
    assert [row[2] for row in rows(page)] == ["whole", "a"]


def test_border_that_is_dragged_is_saved_when_it_is_let_go(
    serve, annotate, recording_path, segments_path
):
    write_rows(segments_path, (101, 161, "swing"))
    page = annotate(serve(recording_path).url)
    page.evaluate("besman.view.show(50, 350), besman.draw('view')")
    page.mouse.move(*page.evaluate(PLACE, ["", 160]))
    page.mouse.down()
    page.mouse.move(*page.evaluate(PLACE, ["", 200]), steps=4)
    assert page.evaluate("besman.document.items.some((one) => one.label && one.end > 190)")
    assert rows(page) == [[100, 160, "swing", ""]]
    press(page, "Escape")
    page.mouse.up()
    assert page.evaluate("besman.document.items.some((one) => one.label && one.end === 160)")
    assert page.inner_text("#saved") == "saved"
    drag(page, "", 160, 200)
    wait_saved(page)
    assert abs(on_disk(segments_path, recording_path)[0][1] - 200) <= 2


def test_loaded_segments_take_the_room_of_proposals(serve, annotate, recording_path, segments_path):
    page = annotate(serve(recording_path, labels=("a",)).url, expect_errors=True)
    first, second = page.evaluate(
        "besman.document.of('', 'proposal').slice(0, 2).map((one) => [one.start, one.end])"
    )
    write_rows(segments_path, (first[0] + 1, second[1], "theirs"))
    page.evaluate("besman.saving.look()")
    page.wait_for_selector("#changed-dialog[open]")
    page.click("#changed-load")
    until(page, "!besman.saving.dialog.open")
    starts = page.evaluate("besman.document.of('', 'proposal').map((one) => one.start)")
    assert starts
    assert min(starts) >= second[1] - 1


def test_two_saves_at_once_are_one_after_the_other(serve, annotate, recording_path, segments_path):
    page = annotate(serve(recording_path, labels=("a", "b")).url)
    press(page, "Enter", "1")
    wait_saved(page)
    done, bases = page.evaluate("""async () => {
      besman.actions.nextProposal();
      besman.actions.applyLabel('b');
      const { saving } = besman, send = saving.send.bind(saving), bases = [];
      saving.send = (options) => { bases.push(saving.revision); return send(options); };
      const save = () => saving.flush({ milestone: true });
      return [await Promise.all([save(), save()]), bases];
    }""")
    assert done == [True] * 2
    assert len(set(bases)) == 2
    assert on_disk(segments_path, recording_path) == rows(page)
    assert len(rows(page)) == 2


def test_saving_waits_for_names_that_are_being_shown(serve, annotate, recording_path):
    page = annotate(serve(recording_path).url)
    about = {"naming": {"fragments": [], "names": {}, "revision": ""}}
    page.route("**/naming", lambda route: route.fulfill(json=about))
    # What is shown takes longer than the answer: the page must not wait in a circle.
    page.evaluate("""() => {
      const { naming } = besman;
      naming.about = { fragments: [], names: {}, revision: '' };
      besman.showNamed = () => new Promise((done) => { besman.shown = () => done(true); });
      naming.send(false);
      naming.flush().then((done) => { besman.flushed = done; });
    }""")
    until(page, "Boolean(besman.shown)")
    assert page.evaluate("besman.flushed === undefined")
    page.evaluate("besman.shown()")
    until(page, "besman.flushed === true")


def test_digits_stay_with_their_labels_when_the_page_is_loaded_again(
    serve, annotate, recording_path, segments_path
):
    write_rows(segments_path, (101, 161, "swing"), (161, 221, "throw"), (221, 281, "throw"))
    page = annotate(serve(recording_path).url)
    for label in ("zoom", "aim"):
        press(page, "n", "l")
        page.keyboard.type(label)
        press(page, "Enter")
    wait_saved(page)
    before = page.evaluate("besman.labels")
    assert before[:2] == ["swing", "throw"]
    assert before.index("zoom") < before.index("aim")
    page.reload()
    page.wait_for_selector("html[data-ready]")
    after = page.evaluate("besman.labels")
    assert after == [label for label in before if label in after]
    assert {"zoom", "aim"} <= set(after)


def test_a_label_that_may_be_a_slip_is_said_and_can_be_taken_back(serve, annotate, recording_path):
    page = annotate(serve(recording_path, labels=("throw", "idle")).url)
    until(page, "besman.proposals.queue().length > 0")
    page.evaluate("besman.select(besman.proposals.queue()[0].id)")
    for label, said in (
        ("thorw", "new label: thorw. Was throw meant? Ctrl+Z takes it back"),
        ("strike_out", "new label: strike_out"),
    ):
        press(page, "l")
        page.keyboard.type(label)
        press(page, "Enter")
        assert said in page.inner_text("body")
        press(page, "Control+z")
    assert rows(page) == []
    near = """async () => {
        const {editDistance, nearestLabel} = await import("./labels.js");
        return [editDistance("throw", "thorw"), editDistance("", "abc"), editDistance("a", "a"),
                nearestLabel("Throw", ["idle", "throw"]), nearestLabel("x", ["idle"])];
    }"""
    assert page.evaluate(near) == [2, 3, 0, "throw", None]
