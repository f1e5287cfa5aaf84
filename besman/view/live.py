"""The page of a run, served to this machine."""

from __future__ import annotations

import threading
from functools import lru_cache

from besman.view.assets import PAGE, WEB
from besman.view.run_content import RunContent
from besman.web.loopback import Answer, LoopbackServer, Request, find_assets

# Demonstrations of which the page's content is kept, some 100 kB each.
_KEPT = 32


def open_view(
    content: RunContent, motion: str | None = None, port: int | None = None
) -> LoopbackServer:
    """Open the server of a run's page.

    Parameters
    ----------
    content : RunContent
        What the run has to show.
    motion : str, optional
        The demonstration to begin with.
    port : int, optional
        Any free one if not given.

    Returns
    -------
    LoopbackServer
        Not started yet. Demonstrations are simulated when they are asked for.

    Raises
    ------
    RunError
        If there is no such demonstration.
    WebError
        If the port is in use or not allowed.
    """
    first = content.first if motion is None else content.find(motion)
    packed, simulating = lru_cache(maxsize=_KEPT)(content.demonstration), threading.Lock()

    def overview(_: Request) -> Answer:
        return Answer(content.overview(first=first))

    def demonstration(request: Request) -> Answer:
        index = request.whole("index")
        # One at a time: each is simulated when it is first asked for.
        with simulating:
            return Answer(packed(index))

    assets = find_assets(PAGE) | find_assets(WEB, "web/")
    routes = {"GET overview": overview, "GET demonstration": demonstration}
    return LoopbackServer(assets, routes, port)
