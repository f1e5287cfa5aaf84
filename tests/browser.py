"""A real Chromium for the tests of pages: imported by the conftest of a folder that has such tests.

The tests skip where there is no Chromium or no playwright; with BESMAN_REQUIRE_BROWSER=1 they fail.
"""

import os
import shutil

import pytest

_PROGRAMS = ("chromium", "chromium-browser", "google-chrome")


def start():
    """Start Chromium; return its driver and it, or None and why there is none."""
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        return None, "playwright is not installed: pip install 'besman[test]'"
    program = next(filter(None, map(shutil.which, _PROGRAMS)), None)
    if program is None:
        return None, "there is no Chromium: apt-get install chromium"
    driver = sync_playwright().start()
    try:
        return driver, driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
    except Error as error:
        driver.stop()
        return None, f"{program} does not start: {error.message.splitlines()[0]}"


# Of one file of tests: the driver's event loop runs as long as it does, and others have their own.
@pytest.fixture(scope="module")
def chromium():
    """Return the browser."""
    driver, found = start()
    if driver is None:
        if os.environ.get("BESMAN_REQUIRE_BROWSER") == "1":
            pytest.fail(found)
        pytest.skip(found)
    yield found
    found.close()
    driver.stop()


def open_pages(browser):
    """Open addresses; what a page logs as an error, or is refused by its policy, fails the test."""
    contexts, errors = [], []

    def open_address(url, expect_errors=False, **options):
        context = browser.new_context(**{"viewport": {"width": 1000, "height": 700}, **options})
        contexts.append(context)
        page = context.new_page()
        page.set_default_timeout(15_000)
        if not expect_errors:
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.on("console", lambda said: said.type == "error" and errors.append(said.text))
        page.goto(url)
        return page

    yield open_address
    for context in contexts:
        context.close()
    assert errors == []


@pytest.fixture
def open_page(chromium):
    """Open pages for one test."""
    yield from open_pages(chromium)


@pytest.fixture(scope="module")
def open_shared(chromium):
    """Open pages that the tests of one file look at in turn."""
    yield from open_pages(chromium)


def wait_for_colors(page, canvas, colors, timeout=None):
    """Wait until a canvas has pixels of all these colors ("red,green,blue"), each fully opaque."""
    page.wait_for_function(
        """([name, colors]) => {
          const canvas = document.getElementById(name);
          const { width, height } = canvas;
          const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
          const missed = new Set(colors);
          for (let at = 0; at < pixels.length && missed.size; at += 4) {
            if (pixels[at + 3] === 255) missed.delete(pixels.slice(at, at + 3).join());
          }
          return !missed.size;
        }""",
        arg=[canvas, colors],
        timeout=timeout,
    )
