"""What pages of live streams are pushed: what is told, and the present, thirty times a second."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from besman.records import FloatArray
from besman.view.assets import WEB
from besman.web.loopback import LoopbackServer, find_assets
from besman.web.push import Broadcast

_FRAME_S = 1 / 30


def open_live_page(
    page: Path,
    news: Broadcast,
    look: Callable[[], object],
    describe: Callable[[], dict[str, Any]],
    port: int | None = None,
) -> LoopbackServer:
    """Open the server of a page that draws what it is pushed over the WebSocket ``news``.

    That is what is told, line by line of JSON, and, thirty times a second where it has changed,
    the present (``kind`` "frame").

    Parameters
    ----------
    page : Path
        Folder of the page.
    news : Broadcast
        What is told.
    look : callable
        Returns the present; another object whenever it has changed.
    describe : callable
        Returns what the page shows of the present.
    port : int, optional
        Any free one if not given.

    Returns
    -------
    LoopbackServer
        Not started yet.

    Raises
    ------
    WebError
        If the port is in use or not allowed.
    """
    assets = find_assets(page) | find_assets(WEB, "web/")
    feeds = {"news": lambda: join_news(news, look, describe)}
    return LoopbackServer(assets, {}, port, feeds=feeds)


def join_news(
    news: Broadcast, look: Callable[[], object], describe: Callable[[], dict[str, Any]]
) -> Iterator[str | None]:
    """Yield what is told and the present, as `open_live_page` pushes them."""
    due, shown = 0.0, None
    for line in news.listen():
        yield line
        now, present = time.monotonic(), look()
        if now >= due and present is not shown:
            # One that is late does not make the next late.
            due, shown = max(due, now - _FRAME_S) + _FRAME_S, present
            yield json.dumps({"kind": "frame"} | describe(), allow_nan=False)


def describe_place(point: FloatArray) -> list[float] | None:
    """Return a place, to the millimetre; None where it is not seen."""
    return np.round(point, 3).tolist() if np.isfinite(point).all() else None
