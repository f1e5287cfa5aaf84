"""MuJoCo measures how long each part of a step takes, which nobody here asks: a tenth of a step."""

from __future__ import annotations

import threading
from functools import lru_cache

import numba

_SETTING = threading.Lock()


@numba.cfunc("float64()", cache=True)
def _no_time() -> float:
    """Return a time at once."""
    return 0.0


def stop_clock() -> None:
    """Have MuJoCo take the time from a clock that stands still, in this process."""
    with _SETTING:
        _stop_once()


@lru_cache(maxsize=1)
def _stop_once() -> None:
    import mujoco

    mujoco.set_mjcb_time(_no_time.ctypes)
