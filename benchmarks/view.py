"""The replay of a run: size, frames a second in headless Chromium, time to the first picture.

    python benchmarks/view.py [RUN] [--picture FILE.png]

Without RUN, `ur5_stick_throw` is run first. `--picture` writes the picture of docs/view.md.
"""

import argparse
import shutil
import statistics
import tempfile
import time
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from besman.config.resources import find_resource
from besman.pipeline.config import load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.view.export import write_replay
from besman.view.run_content import RunContent

PLAYED_S = 4.0
REPEATS = 5


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", nargs="?", type=Path)
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args()
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        print("there is no Chromium: apt-get install chromium")
        return
    with tempfile.TemporaryDirectory() as folder:
        run = given.run
        if run is None:
            config = load_pipeline(find_resource("pipelines", "ur5_stick_throw"))
            run = run_pipeline(config, Path(folder) / "run", jobs=2)
        content = RunContent(run)
        whole, single = Path(folder) / "whole.html", Path(folder) / "single.html"
        began = time.perf_counter()
        shown, total = write_replay(content, whole)
        print(
            f"{run.name}: {shown} of {total} motions, {whole.stat().st_size / 1e6:.2f} MB, ", end=""
        )
        print(f"written in {time.perf_counter() - began:.1f} s")
        name = content.names[content.first]
        write_replay(content, single, name)
        print(f"one motion alone, {name}: {single.stat().st_size / 1e6:.2f} MB")
        fine = Path(folder) / "fine.html"
        write_replay(content, fine, rate_hz=200.0)
        print(f"all motions, 200 frames a second: {fine.stat().st_size / 1e6:.2f} MB")
        with sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
            measure(browser, fine)
            if given.picture is not None:
                draw(browser, whole, given.picture)
            browser.close()


def measure(browser, path):
    """Print what a page of 1280 x 800 pixels costs."""
    firsts = []
    for _ in range(REPEATS):
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(path.as_uri())
        page.wait_for_selector("html[data-ready]")
        firsts.append(
            page.evaluate("performance.getEntriesByName('first picture')[0].startTime") / 1e3
        )
        page.close()
    print(f"first picture after {statistics.median(firsts):.2f} s (median of {REPEATS})")
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-ready]")
    seconds = float(page.get_attribute("#scrubber", "max"))
    drawn = "Number(canvas.dataset.pictures)"
    page.click("#play")
    before, began = page.evaluate(drawn), time.perf_counter()
    page.wait_for_timeout(1000 * PLAYED_S)
    rate = (page.evaluate(drawn) - before) / (time.perf_counter() - began)
    print(f"{rate:.0f} pictures a second while it plays (a take of {200 * seconds:.0f} frames)")
    page.close()


def draw(browser, path, picture):
    """Write a picture of the page with few colours."""
    page = browser.new_page(viewport={"width": 1280, "height": 760})
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-ready]")
    page.evaluate("scrubber.value = 0.62 * scrubber.max")
    page.evaluate("scrubber.dispatchEvent(new Event('input'))")
    page.wait_for_timeout(600)
    page.screenshot(path=picture)
    page.close()
    Image.open(picture).convert("RGB").quantize(256, dither=Image.Dither.NONE).save(picture)
    print(f"{picture}: {picture.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
