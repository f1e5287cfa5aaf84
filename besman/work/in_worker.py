"""What a worker process does with an item."""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from multiprocessing import forkserver, parent_process
from pathlib import Path
from typing import Any

from besman.exceptions import BesmanError, RunError
from besman.work.garbage import collect_seldom
from besman.work.outcome import Outcome, attempt
from besman.work.versions import environment

_PR_SET_PDEATHSIG = 1


def begin_worker() -> None:
    """Make this process a worker, which ends with its parent; see `end_with_parent`."""
    collect_seldom()
    end_with_parent()


def end_with_parent() -> None:
    """Have the system end this process when the one ends that it was forked from.

    That one ends as soon as the process does that has started it, however that comes: it reads from
    a pipe whose other end is that process's. Python hands that end to workers too, so that they
    could start more; while one of them had it open, all of them would live on.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    server: Any = forkserver._forkserver
    os.close(server._forkserver_alive_fd)
    server._forkserver_alive_fd = None
    owner = parent_process()
    if owner is None or not owner.is_alive():
        os._exit(1)


def run_item(call: bytes, item: bytes) -> bytes:
    """Work on an item: what a worker process does.

    Parameters
    ----------
    call : bytes
        Pickled environment and function, as `spread` makes it.
    item : bytes
        Pickled item.

    Returns
    -------
    bytes
        Pickled `Outcome`.

    Raises
    ------
    RunError
        If this process runs other code than the one that sent the item.
    """
    function = _function(call)
    before = time.thread_time()
    outcome = attempt(function, pickle.loads(item))  # noqa: S301
    if outcome.error is not None:
        outcome = Outcome(error=_sendable(outcome.error))
    return pickle.dumps(
        replace(
            outcome,
            worker=f"{socket.gethostname()}:{os.getpid()}",
            peak_rss_mb=peak_rss_mb(),
            cpu_s=time.thread_time() - before,
        )
    )


@lru_cache(maxsize=4)
def _function(call: bytes) -> Callable[[Any], Any]:
    """Unpickle the function, once for all items; see that this process is as the sender is."""
    limit_threads()
    sent, function = pickle.loads(call)  # noqa: S301
    own = environment()
    differs = [f"{key} {own.get(key)}" for key in sent if own.get(key) != sent[key]]
    if differs:
        expected = ", ".join(f"{key} {sent[key]}" for key in sent if own.get(key) != sent[key])
        raise RunError(
            f"worker {socket.gethostname()}:{os.getpid()} has {', '.join(differs)}; expected what "
            f"this process has, or results would differ: {expected} (files changed meanwhile? "
            "the same command goes on from the last stage that was done)"
        )
    checked: Callable[[Any], Any] = function
    return checked


@lru_cache(maxsize=1)
def limit_threads() -> None:
    """Have BLAS use one thread, as in the process that runs the pipeline."""
    # Each loads a BLAS of its own.
    import numpy  # noqa: F401
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_limits

    threadpool_limits(limits=1, user_api="blas")


def _sendable(error: Exception) -> Exception:
    """Return an error that survives being sent."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301
    except Exception:
        return BesmanError(f"{type(error).__name__}: {error}")
    return error


def peak_rss_mb() -> float:
    """Return the greatest memory that this process has had in RAM, MB.

    Of the system's account of the process, because the usual one counts its parent's too.
    """
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return float("nan")
