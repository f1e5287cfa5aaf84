"""The annotation page in Chromium: how soon, how smooth, and how many inputs a segment takes.

Run as ``python benchmarks/annotate.py [FOLDER OF REAL RECORDINGS]``, or with ``--picture FILE`` for
the picture of docs/annotate.md; needs Chromium and Playwright
(extra ``test``). Recordings are synthetic stick throws, end to end, with the 13 markers that the
public recordings have. Times are taken in the page: until it is drawn and takes input, from the
start of the navigation; of a drag, from the moment of the input event to the beginning of the frame
after the one in which it was drawn, so an upper bound. Inputs are key strokes and clicks or drags.
"""

from __future__ import annotations

import json
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from besman.io.recordings.folders import find_recordings
from besman.io.recordings.formats import read_recording, write_recording
from besman.io.segments_json import find_segments, read_segments
from besman.records import LabelledSegments, Recording
from besman.records.layers import complete_truth
from besman.synthetic.datasets import captures, write_synthetic

FINGERS = {"thumb": (0.06, 0.05, -0.02), "index": (0.1, 0.02, 0.0), "middle": (0.1, -0.01, 0.0)}
MARGIN_S = 0.2
LABELS = ("idle", "strike_out", "throw", "swing_out")

WATCH = """() => {
  window.delays = [];
  addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    requestAnimationFrame(() => requestAnimationFrame((now) => delays.push(now - event.timeStamp)));
  }, true);
}"""
PLAY = """(seconds) => new Promise((done) => {
  const paint = besman.scene.draw, times = [];
  besman.scene.draw = function () { times.push(performance.now()); return paint.call(this); };
  besman.moveTo(0);
  besman.player.toggle();
  setTimeout(() => {
    besman.player.toggle();
    delete besman.scene.draw;
    const drawn = times.slice(5);
    done((drawn.length - 1) / (drawn.at(-1) - drawn[0]) * 1000);
  }, seconds * 1000);
})"""
PLACE = """([layer, row]) => {
  const { timeline, view, lanes } = besman, box = timeline.element.getBoundingClientRect();
  const x = 92 + (row - view.from) / view.span * timeline.width;
  return [box.left + x, box.top + timeline.lanesTop + 34 * lanes.indexOf(layer) + 17];
}"""
SELECTED = """() => {
  const item = besman.document.find(besman.selection.id);
  return item && { ...item, name: besman.labelOf(item) };
}"""


def make_recording(seconds: float, path: Path) -> None:
    """Write stick throws end to end, with 13 markers at 100 Hz."""
    capture = next(iter(captures("stick_throw_marked", 1, 13, seed=1)))
    recording = capture.recording
    hand = recording.positions[:, recording.names.index("Hand top")]
    more = {name: hand + offset for name, offset in FINGERS.items()}
    more["box_back"] = np.broadcast_to([1.5, 0.5, 0.8], hand.shape)
    positions = np.concatenate([recording.positions, np.stack(list(more.values()), 1)], axis=1)
    n = round(seconds * recording.rate_hz)
    positions = np.tile(positions, (-(-n // len(positions)), 1, 1))[:n]
    names = (*recording.names, *more)
    assert len(names) == 13
    time_s = np.arange(n) / recording.rate_hz
    write_recording(Recording(time_s, positions, names, recording.rate_hz, path.name), path)


@contextmanager
def annotate(*arguments: str) -> Iterator[tuple[str, float]]:
    """Run the command; yield the page's address and the seconds until it was printed."""
    start = time.perf_counter()
    command = [sys.executable, "-m", "besman", "annotate", *arguments, "--no-browser"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        for line in server.stdout or ():
            found = re.search(r"http://\S+", line)
            if found:
                yield found[0], time.perf_counter() - start
                return
        raise SystemExit(f"{' '.join(command)}: failed")
    finally:
        server.kill()
        server.wait()


def open_page(browser: Browser, url: str, state: Any = None) -> Page:
    """Open an address; of one that was used up, the page with the state of who used it."""
    viewport = {"width": 1440, "height": 900}
    page = browser.new_context(viewport=viewport, storage_state=state).new_page()
    page.goto(url)
    page.wait_for_selector("html[data-ready]", timeout=120_000)
    return page


def until(page: Page, expression: str) -> None:
    while not page.evaluate(expression):
        page.wait_for_timeout(20)


def measure_speed(browser: Browser, path: Path, repeats: int) -> dict[str, float]:
    """Measure one recording: usable, drag, playback."""
    with annotate(str(path)) as (url, command_s):
        usable, state = [], None
        for _ in range(repeats):
            page = open_page(browser, url, state)
            url, state = page.url, page.context.storage_state()
            usable.append(page.evaluate("performance.getEntriesByName('usable')[0].startTime"))
            page.context.close()
        page = open_page(browser, url, state)
        until(page, "besman.proposals.loaded.get('') !== 'coming'")
        page.wait_for_timeout(1000)
        page.evaluate("besman.zoomAll()")
        n = page.evaluate("besman.about.n_samples")
        page.evaluate(
            "([a, b]) => { besman.document.reset([]); besman.label = 'a';"
            "besman.actions.addNamed('', a, b, 'a', besman.about.n_samples) }",
            [0.3 * n, 0.5 * n],
        )
        page.wait_for_timeout(500)
        page.evaluate(WATCH)
        drags = []
        for zoom in (1.0, 0.05):
            page.evaluate(
                "([at, span]) => { besman.view.show(at - span / 2, at + span / 2);"
                "besman.draw('view') }",
                [0.5 * n, zoom * n],
            )
            page.wait_for_timeout(500)
            end = page.evaluate("besman.document.segments()[0].end")
            x, y = page.evaluate(PLACE, ["", end])
            page.mouse.move(x, y)
            page.mouse.down()
            for k in range(60):
                page.mouse.move(x + 2 * k - 60, y)
                page.wait_for_timeout(7 + k % 11)
            page.mouse.up()
            drags.append(page.evaluate("delays.splice(0)"))
        page.evaluate("besman.zoomAll()")
        page.wait_for_timeout(500)
        fps = page.evaluate(PLAY, 5)
        page.context.close()
    return {
        "command_s": command_s,
        "usable_s": statistics.median(usable) / 1000,
        "drag_ms": statistics.median(drags[0]),
        "drag_zoomed_ms": statistics.median(drags[1]),
        "fps": fps,
    }


class Person:
    """Labels a recording on the page, knowing the truth; counts every input."""

    def __init__(self, page: Page, truth: LabelledSegments, labels: tuple[str, ...]) -> None:
        self.page, self.labels = page, labels
        self.margin = MARGIN_S * truth.rate_hz
        self.truth = [
            (int(start), int(end), label)
            for (start, end), label in zip(truth.bounds, truth.labels, strict=True)
        ]
        self.right: list[int] = []
        self.wrong: list[int] = []
        self.other = 0

    def key(self, key: str) -> int:
        self.page.keyboard.press(key)
        return 1

    def drag(self, start: float, end: float) -> int:
        x, y = self.page.evaluate(PLACE, ["", start])
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(*self.page.evaluate(PLACE, ["", end]), steps=3)
        self.page.mouse.up()
        return 1

    def close(self, a: float, b: float) -> bool:
        return abs(a - b) <= self.margin

    def label_all(self) -> None:
        """Decide every proposal, in the order in which the page shows them."""
        self.other += self.key("Enter")
        spent = 0
        while True:
            until(self.page, "!besman.proposals.busy")
            item = self.page.evaluate(SELECTED)
            if item is None or item["kind"] != "proposal":
                return
            spent += self.decide(item, spent)
            if spent > 0 and self.done:
                spent = 0

    def decide(self, item: dict, spent: int) -> int:
        """Do the next thing about a proposal; note what its segment took when it is decided."""
        self.done = False
        start, end = item["start"], item["end"]
        middle = (start + end) / 2
        # What belongs here: movements of which at least half lies inside, or the one in the middle.
        inside = [
            one
            for one in self.truth
            if min(end, one[1]) - max(start, one[0]) >= (one[1] - one[0]) / 2
            or one[0] <= middle < one[1]
        ]
        if not inside:
            self.finish(spent + self.key("r"), right=False)
            return 0
        first = inside[0]
        if len(inside) > 1:
            # Two movements in one: a border is put where the first ends.
            border = first[1]
            x, _ = self.page.evaluate(PLACE, ["", border])
            box = self.page.locator("#timeline").bounding_box()
            self.page.mouse.click(x, box["y"] + 60)
            return 1 + self.key("x")
        low, high, label = next((one for one in inside if one[0] <= middle < one[1]), first)
        if high - end > self.margin and not self.near_border(item, high):
            return self.key("m")
        for edge, true in (("start", low), ("end", high)):
            if not self.close(item[edge], true):
                return self.drag(item[edge], true)
        right = spent == 0 and item["name"] == label
        key = "Enter" if item["name"] == label else str((self.labels.index(label) + 1) % 10)
        self.finish(spent + self.key(key), right)
        return 0

    def near_border(self, item: dict, row: int) -> bool:
        """Tell whether the next proposal reaches beyond the true end: then its border is moved."""
        following = self.page.evaluate(
            "(end) => besman.document.of('', 'proposal').find((one) => one.start === end)",
            item["end"],
        )
        return following is None or following["end"] > row + self.margin

    def finish(self, inputs: int, right: bool) -> None:
        (self.right if right else self.wrong).append(inputs)
        self.done = True


def spoil(page: Page, truth: LabelledSegments) -> None:
    """Make every other proposal wrong: a border moved, left out or too many."""
    page.evaluate(
        """(rate) => {
          const { document: doc } = besman, all = doc.of("", "proposal"), out = [];
          for (let k = 0; k < all.length; k++) {
            const item = all[k], kind = Math.floor(k / 2) % 4, shift = Math.round(0.35 * rate);
            if (k % 2 === 0 || k + 1 >= all.length) out.push(item);
            else if (kind === 0 && item.end - item.start > 3 * shift) {
              out.at(-1).end = item.start + shift;
              out.push({ ...item, start: item.start + shift });
            } else if (kind === 1) {
              out.at(-1).end = item.end;
            } else if (kind === 2 && item.end - item.start > 2 * shift) {
              const middle = Math.round((item.start + item.end) / 2);
              out.push({ ...item, end: middle }, { ...item, id: 1e6 + k, start: middle });
            } else out.push(item);
          }
          doc.reset([...doc.segments(), ...out]);
          besman.proposals.refresh(0);
          besman.draw("all");
        }""",
        truth.rate_hz,
    )


def count_inputs(
    browser: Browser, paths: list[Path], truth: list[LabelledSegments], wrong: bool = False
) -> dict[str, float]:
    """Label recordings from proposals; return inputs, and how much of the truth was met."""
    labels = tuple(sorted({label for one in truth for label in one.labels}))
    totals: dict[str, list[int]] = {"right": [], "wrong": []}
    other = found = expected = 0
    with annotate(*map(str, paths), "--labels", ",".join(labels)) as (url, _):
        page = open_page(browser, url)
        for k, (path, true) in enumerate(zip(paths, truth, strict=True)):
            if k:
                page.keyboard.press("]")
                other += 1
                until(page, f"besman.index === {k} && besman.opened")
            until(page, "besman.proposals.loaded.get('') === 'here'")
            page.wait_for_timeout(300)
            if wrong:
                spoil(page, true)
                page.wait_for_timeout(300)
            person = Person(page, true, labels)
            person.label_all()
            until(page, "!besman.saving.dirty && !besman.saving.going")
            totals["right"] += person.right
            totals["wrong"] += person.wrong
            other += person.other
            segments = find_segments(path)
            assert segments is not None
            given = read_segments(segments, read_recording(path))
            rows = [
                (*bounds, label)
                for bounds, label in zip(given.bounds.tolist(), given.labels, strict=True)
            ]
            expected += len(person.truth)
            found += sum(
                any(
                    person.close(a, low) and person.close(b, high) and name == label
                    for a, b, name in rows
                )
                for low, high, label in person.truth
            )
        page.context.close()
    spent = sum(totals["right"]) + sum(totals["wrong"]) + other
    return {
        "segments": expected,
        "met": found,
        "inputs": spent,
        "right": len(totals["right"]),
        "per_right": max(totals["right"], default=0),
        "wrong": len(totals["wrong"]),
        "per_wrong": max(totals["wrong"], default=0),
        "mean_wrong": statistics.fmean(totals["wrong"]) if totals["wrong"] else 0.0,
    }


def print_inputs(what: str, figures: dict[str, float]) -> None:
    print(
        f"{what}: {figures['segments']} segments, {figures['met']} as they should be, "
        f"{figures['inputs']} inputs; {figures['right']} right, at most {figures['per_right']} "
        f"inputs each; {figures['wrong']} wrong, {figures['mean_wrong']:.1f} on average, at most "
        f"{figures['per_wrong']}"
    )


def measure_inputs(browser: Browser, folder: Path, real: Path | None) -> None:
    """Print the inputs of 40 synthetic throws, of wrong proposals, and of real recordings."""
    for name, wrong in (("throws", False), ("spoilt", True)):
        write_synthetic("stick_throw_marked", folder / name, n_subjects=4, n_repetitions=10, seed=3)
        paths = find_recordings([folder / name])
        truth = []
        for path in paths:
            segments = find_segments(path)
            assert segments is not None
            truth.append(read_segments(segments, read_recording(path)))
            segments.unlink()
        what = "40 throws, every other proposal spoilt" if wrong else "40 throws"
        print_inputs(what, count_inputs(browser, paths, truth, wrong))
    if real is not None:
        paths, truth = [], []
        for path in find_recordings([real]):
            segments = find_segments(path)
            if segments is None:
                continue
            recording = read_recording(path)
            truth.append(
                complete_truth(read_segments(segments, recording), len(recording.time), 0.25)
            )
            paths.append(Path(shutil.copy(path, folder)))
        print_inputs(f"{len(paths)} real recordings", count_inputs(browser, paths, truth))


def take_picture(browser: Browser, folder: Path, path: Path) -> None:
    """Write the page's picture: two throws labelled, proposals for the others."""
    write_synthetic("stick_throw_marked", folder, n_subjects=1, n_repetitions=13, seed=1)
    (recording,) = find_recordings([folder])
    segments = find_segments(recording)
    assert segments is not None
    content = json.loads(segments.read_text())
    content["segments"] = content["segments"][:8]
    segments.write_text(json.dumps(content))
    with annotate(str(recording)) as (url, _):
        page = open_page(browser, url)
        until(page, "besman.proposals.loaded.get('') === 'here' && !besman.proposals.busy")
        page.evaluate(
            "besman.view.show(0.12 * besman.about.n_samples, 0.42 * besman.about.n_samples)"
        )
        item = "besman.proposals.queue().find((one) => one.start > 1500 && one.end < 2000)"
        page.evaluate(f"besman.select({item}.id, null, false)")
        page.evaluate("besman.moveTo(besman.document.find(besman.selection.id).start + 30)")
        page.evaluate("besman.draw('all')")
        page.set_viewport_size({"width": 1280, "height": 800})
        page.wait_for_timeout(500)
        page.screenshot(path=path)
    # Few colours: a third of the size.
    Image.open(path).quantize(colors=128).save(path, optimize=True)


def main() -> None:
    picture = sys.argv[2] if sys.argv[1:2] == ["--picture"] else None
    real = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    chromium = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    if chromium is None:
        raise SystemExit("no Chromium on this machine")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        if picture is not None:
            take_picture(browser, folder, Path(picture))
            browser.close()
            return
        for what, seconds, repeats in (("60 s", 60, 7), ("one hour", 3600, 3)):
            path = folder / f"{what.replace(' ', '_')}.tsv"
            make_recording(seconds, path)
            figures = measure_speed(browser, path, repeats)
            print(f"{what}, 13 markers, 100 Hz: {json.dumps(figures)}", flush=True)
        measure_inputs(browser, folder, real)
        browser.close()


if __name__ == "__main__":
    main()
