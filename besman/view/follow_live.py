"""The page of a stream that is followed, served to this machine while it comes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from besman.following.live import LiveFollower
from besman.view.live_feed import describe_place, open_live_page
from besman.web.loopback import LoopbackServer
from besman.web.push import Broadcast

PAGE = Path(__file__).parent / "follow_page"


def open_follow_page(
    follower: LiveFollower, news: Broadcast, port: int | None = None
) -> LoopbackServer:
    """Open the server of the page: markers with their names, speed, borders, and what comes next.

    See `besman.view.live_feed.open_live_page`.

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
    return open_live_page(PAGE, news, follower.look, lambda: describe_present(follower), port)


def describe_present(follower: LiveFollower) -> dict[str, Any]:
    """Return what the page shows of the moment; metres in the laboratory, null where not seen."""
    now = follower.look()
    return {
        "time_s": now.time_s,
        "names": list(now.names),
        "markers": [describe_place(one) for one in now.markers],
        "confidence": now.confidence,
        "speed_m_s": _finite(now.speed_m_s),
        "delay_ms": _finite(now.delay_ms),
    }


def _finite(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
