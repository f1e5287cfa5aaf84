"""A real Chromium for the tests of pages: imported by the conftest of a folder that has such tests.

The tests skip where there is no Chromium or no playwright; with BESMAN_REQUIRE_BROWSER=1 they fail.
What costs CPU time is saved: a folder has one Chromium, and its tests the same few pages in turn.
"""

import os
import shutil

import pytest

_PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
# Of whatever is waited for: how long it takes says how busy the machine is.
PATIENCE_S = 60.0
_SIZE = {"width": 720, "height": 520}


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


class Windows:
    """Pages of one Chromium, which are used again: another one costs more than what it shows."""

    def __init__(self):
        self._driver, found = start()
        self.problem = found if self._driver is None else None
        if self.problem is None:
            self._browser = found
            # What moves on a page to please is drawn sixty times a second.
            self._context = found.new_context(viewport=_SIZE, reduced_motion="reduce")
            self._free = []

    def take(self, size, color_scheme):
        """Return a page that shows nothing, or what the last test has left."""
        page, last = self._free.pop() if self._free else (self._context.new_page(), None)
        page.set_default_timeout(1e3 * PATIENCE_S)
        # Either has what is left drawn anew: done only where it changes something.
        if page.viewport_size != size:
            page.set_viewport_size(size)
        if color_scheme != last:
            page.emulate_media(color_scheme=color_scheme or "null")
        return page

    def give_back(self, page, color_scheme):
        """Have a page be as a new one, but for what `take` sets."""
        page.unroute_all()
        if page.url.startswith("http"):
            page.evaluate("localStorage.clear(), sessionStorage.clear()")
        self._free.append((page, color_scheme))

    def close(self):
        """End Chromium."""
        if self.problem is None:
            self._browser.close()
            self._driver.stop()


_windows = None


def _open_windows():
    global _windows
    _windows = _windows or Windows()
    if _windows.problem is not None:
        if os.environ.get("BESMAN_REQUIRE_BROWSER") == "1":
            pytest.fail(_windows.problem)
        pytest.skip(_windows.problem)
    return _windows


# A folder's: the driver's event loop runs as long as it does, and tests elsewhere have their own.
@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item, nextitem):
    """End Chromium after the last test of a folder."""
    global _windows
    try:
        return (yield)
    finally:
        stops = nextitem is None or item.session.shouldfail or item.session.shouldstop
        if _windows is not None and (stops or nextitem.path.parent != item.path.parent):
            _windows.close()
            _windows = None


def open_pages():
    """Open addresses; what a page logs as an error, or is refused by its policy, fails the test."""
    windows, used, errors = _open_windows(), [], []

    def open_address(url, expect_errors=False, size=_SIZE, color_scheme=None):
        page, arrived = windows.take(size, color_scheme), []
        used.append((page, color_scheme, listeners := []))

        def note(text):
            # Until the new address is there the page is still another test's.
            if arrived:
                errors.append(text)

        if not expect_errors:
            listeners += [
                ("pageerror", lambda error: note(str(error))),
                ("console", lambda said: said.type == "error" and note(said.text)),
            ]
        for event, listener in listeners:
            page.on(event, listener)
        page.once("framenavigated", lambda frame: arrived.append(frame))
        page.goto(url)
        return page

    yield open_address
    for page, color_scheme, listeners in used:
        for event, listener in listeners:
            page.remove_listener(event, listener)
        windows.give_back(page, color_scheme)
    assert errors == []


@pytest.fixture
def open_page():
    """Open pages for one test."""
    yield from open_pages()


@pytest.fixture(scope="module")
def open_shared():
    """Open pages that the tests of one file look at in turn."""
    yield from open_pages()


def until(page, expression):
    """Wait for a condition; Playwright's own way needs what some pages' policy forbids."""
    found = page.evaluate(
        f"""(async () => {{
          const end = performance.now() + {1e3 * PATIENCE_S};
          while (!({expression}) && performance.now() < end) {{
            await new Promise((done) => setTimeout(done, 15));
          }}
          return Boolean({expression});
        }})()"""
    )
    assert found, expression


def settle(page):
    """Wait until what was changed is drawn."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")


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
