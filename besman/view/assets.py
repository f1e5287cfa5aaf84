"""The files of the page."""

from __future__ import annotations

from pathlib import Path

import besman.web

PAGE = Path(__file__).parent / "page"
WEB = Path(besman.web.__file__).parent


def read_asset(name: str) -> str:
    """Return the text of a file by its address in the page, e.g. ``web/theme.css``."""
    folder, _, inside = name.rpartition("/")
    return ((WEB if folder == "web" else PAGE) / inside).read_text(encoding="utf-8")
