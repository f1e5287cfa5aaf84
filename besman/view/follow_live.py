"""The page of a stream that is followed, served to this machine while it comes."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from besman.following.live import LiveFollower
from besman.view.assets import WEB
from besman.view.mirror_live import describe_place
from besman.web.loopback import LoopbackServer, find_assets
from besman.web.push import Broadcast

PAGE = Path(__file__).parent / "follow_page"

_FRAME_S = 1 / 30


def open_follow_page(
    follower: LiveFollower, news: Broadcast, port: int | None = None
) -> LoopbackServer:
    """Open the server of the page: markers with their names, speed, borders, and what comes next.

    Over the WebSocket ``news`` it pushes what is told, line by line of JSON, and thirty times a
    second the markers as of then (``kind`` "frame").

    Parameters
    ----------
    follower : LiveFollower
        It is looked at whenever a frame is due.
    news : Broadcast
        What is told.
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

    def feed() -> Iterator[str | None]:
        due, shown_s = 0.0, -1.0
        for line in news.listen():
            yield line
            now, time_s = time.monotonic(), follower.look().time_s
            if now >= due and time_s != shown_s:
                due, shown_s = now + _FRAME_S, time_s
                yield json.dumps(describe_present(follower), allow_nan=False)

    assets = find_assets(PAGE) | find_assets(WEB, "web/")
    return LoopbackServer(assets, {}, port, feeds={"news": feed})


def describe_present(follower: LiveFollower) -> dict[str, Any]:
    """Return what the page shows of the moment; metres in the laboratory, null where not seen."""
    now = follower.look()
    return {
        "kind": "frame",
        "time_s": now.time_s,
        "names": list(now.names),
        "markers": [describe_place(one) for one in now.markers],
        "confidence": now.confidence,
        "speed_m_s": _finite(now.speed_m_s),
        "delay_ms": _finite(now.delay_ms),
    }


def _finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
