"""What MuJoCo says by itself: printed, and logged in the working directory, unless told not to."""

from __future__ import annotations

import threading
from functools import lru_cache

_SILENCING = threading.Lock()


def silence_mujoco() -> None:
    """Have MuJoCo say nothing: what cannot be compiled or diverges is an error or an outcome.

    Otherwise it would write a log into the working directory. Said once, by one thread, before any
    of them simulates: MuJoCo's setters of callbacks wait for each other.
    """
    with _SILENCING:
        _silence_once()


@lru_cache(maxsize=1)
def _silence_once() -> None:
    import mujoco

    mujoco.set_mju_user_warning(lambda _: None)
