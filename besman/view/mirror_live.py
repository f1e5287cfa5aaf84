"""The page of a stream that is mirrored, served to this machine while it comes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from besman.following.mirror import Mirror
from besman.robot.collision import place_all
from besman.robot.kinematics import forward_kinematics
from besman.view.live_feed import describe_place, open_live_page
from besman.web.loopback import LoopbackServer
from besman.web.push import Broadcast

PAGE = Path(__file__).parent / "mirror_page"


def open_mirror_page(mirror: Mirror, news: Broadcast, port: int | None = None) -> LoopbackServer:
    """Open the server of the page: markers and the simulated arm in the arm's world, as of now.

    See `besman.view.live_feed.open_live_page`.

    Parameters
    ----------
    mirror : Mirror
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
    return open_live_page(PAGE, news, mirror.look, lambda: describe_frame(mirror), port)


def describe_frame(mirror: Mirror) -> dict[str, Any]:
    """Return what the page shows of the moment; until the arm begins, markers alone.

    Places are in the arm's world once it is known where the person is in it, before that in the
    laboratory; metres, null where not seen.
    """
    now, robot = mirror.look(), mirror.robot
    shown: dict[str, Any] = {
        "robot": f"{robot.name}, {robot.tool.name}",
        "state": now.state or "the arm has not begun",
        "time_s": now.time_s,
        "names": list(mirror.markers),
        "markers": [describe_place(one) for one in now.markers],
        "capsules": [],
        "asked": None,
        "tool": None,
        "away_m": now.away_m,
        "delay_ms": now.delay_ms,
    }
    if now.joints is None:
        return shown
    chain, joints = robot.chain, now.joints[None]
    parts = (chain.placements, chain.axes, chain.capsule_joints, chain.capsule_ends)
    ends = place_all(*parts, np.ascontiguousarray(joints))[0]
    radii = chain.capsule_radii.tolist()
    shown["capsules"] = [[a.tolist(), b.tolist(), r] for (a, b), r in zip(ends, radii, strict=True)]
    shown["tool"] = forward_kinematics(chain, joints)[0, :3, 3].tolist()
    shown["asked"] = None if now.asked is None else describe_place(now.asked)
    return shown
