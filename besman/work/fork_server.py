"""The process that workers are forked from: it loads what all of them need.

This module loads nothing but Python's own: that process is begun before all else.
"""

from __future__ import annotations

import atexit
import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import forkserver, get_context
from typing import Any

from besman.work.stopping import SIGNALS

# What `besman.work.in_worker` loads before the first item.
_LOADED = ("besman.work.loaded_code", "numpy", "scipy.linalg", "threadpoolctl")
_LOADED_LAST = "besman.work.loaded_last"
_ONE_THREAD = "OPENBLAS_NUM_THREADS"


def start_server(preload: Sequence[str] = ()) -> None:
    """Start the process that workers are forked from; it loads modules while this one goes on.

    Forked from it, they have loaded them at once, and none of this process's memory or threads. It
    ends with this process. Nothing is done if it runs.

    Parameters
    ----------
    preload : sequence of str
        Names of modules.
    """
    before = os.environ.get(_ONE_THREAD)
    os.environ[_ONE_THREAD] = "1"
    atexit.unregister(_end_server)
    atexit.register(_end_server)
    try:
        with deaf():
            get_context("forkserver").set_forkserver_preload([*_LOADED, *preload, _LOADED_LAST])
            forkserver.ensure_running()
    finally:
        if before is None:
            del os.environ[_ONE_THREAD]
        else:
            os.environ[_ONE_THREAD] = before


def _end_server() -> None:
    """End that process as this one ends: while it loads it would not see that it is alone."""
    pid = server_pid()
    with suppress(OSError):
        if pid is not None and os.waitpid(pid, os.WNOHANG) == (0, 0):
            os.kill(pid, signal.SIGKILL)


def server_pid() -> int | None:
    """Return the number of the process that workers are forked from; None if it does not run."""
    server: Any = forkserver._forkserver
    pid: int | None = server._forkserver_pid
    return pid


@contextmanager
def deaf() -> Iterator[None]:
    """Let processes that are started here hear nothing of Ctrl-C, SIGTERM and SIGHUP.

    A terminal sends these to them as well; this process hears them, and ends the others.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
