"""Processes on this machine or workers of a cluster, and what is done when one of them dies."""

from __future__ import annotations

import os
import pickle
import socket
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

from besman.exceptions import BesmanError, RunError
from besman.versions import environment
from besman.work import Outcome, attempt

# How often to look whether results can still come.
_LOOK_S = 1.0


class Pool(Protocol):
    """Processes that work on items.

    Attributes
    ----------
    lost : tuple of exception types
        What a future raises if the process that worked on it has died.
    tries : int
        How often an item is given to a process of its own before it counts as what kills them.
    """

    lost: tuple[type[BaseException], ...]
    tries: int

    @property
    def window(self) -> int:
        """How many items to hand over at a time: no more are in memory twice."""

    def submit(self, call: bytes, item: bytes) -> Future[bytes]:
        """Have `run_item` called in some process."""

    def renew(self) -> None:
        """Replace processes that are lost, if that is not done already."""

    def check(self) -> None:
        """Raise RunError if no result can come any more."""

    def close(self) -> None:
        """End the processes, or leave the cluster."""


class Workers:
    """The processes of a run, started when they are first needed.

    Parameters
    ----------
    jobs : int
        Processes on this machine.
    cluster : str, optional
        Address of the scheduler of a Dask cluster, ``tcp://HOST:PORT``.

    Raises
    ------
    RunError
        If the cluster does not answer, has no workers, or Dask is not installed.
    """

    def __init__(self, jobs: int = 1, cluster: str | None = None) -> None:
        self.jobs, self.cluster = jobs, cluster
        self._processes: Pool | None = None
        self._remote: Pool | None = None
        if cluster is not None:
            from besman.cluster import ClusterPool

            self._remote = ClusterPool(cluster)

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for pool in (self._processes, self._remote):
            if pool is not None:
                pool.close()

    def in_processes(
        self, function: Callable[[Any], Any], items: Sequence[Any]
    ) -> Iterator[tuple[int, Outcome]]:
        """Work on items in processes on this machine; yield index and outcome as they come."""
        if self._processes is None:
            from besman.processes import ProcessPool

            self._processes = ProcessPool(self.jobs)
        return spread(self._processes, function, items)

    def on_cluster(
        self, function: Callable[[Any], Any], items: Sequence[Any]
    ) -> Iterator[tuple[int, Outcome]]:
        """Work on items on the cluster; yield index and outcome as they come."""
        assert self._remote is not None
        return spread(self._remote, function, items)


def spread(
    pool: Pool, function: Callable[[Any], Any], items: Sequence[Any]
) -> Iterator[tuple[int, Outcome]]:
    """Apply a function to items in other processes, whatever becomes of these.

    Items that were lost with a process are computed again, one at a time, so that only an item
    that kills every process it is given to fails, and none of its neighbours.

    Parameters
    ----------
    pool : Pool
    function : callable
        Found by its name in the other process.
    items : sequence
        Sent one by one.

    Yields
    ------
    index, outcome
        As they come.

    Raises
    ------
    RunError
        If no result can come any more, or a worker runs other code than this process.
    """
    call = pickle.dumps((environment(), function))
    waiting, suspects = deque(range(len(items))), deque[int]()
    deaths: Counter[int] = Counter()
    running: dict[Future[bytes], int] = {}
    alone = False
    try:
        while waiting or suspects or running:
            if not running:
                alone = bool(suspects)
            queue, room = (suspects, 1) if suspects else (waiting, pool.window)
            while queue and len(running) < room:
                at = queue.popleft()
                running[pool.submit(call, pickle.dumps(items[at]))] = at
                if alone:
                    break
            done, _ = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
            if not done:
                pool.check()
            lost = []
            for future in done:
                at = running.pop(future)
                outcome = _outcome(future, pool)
                if outcome is None:
                    lost.append(at)
                else:
                    yield at, outcome
            if lost:
                pool.renew()
            for at in sorted(lost):
                deaths[at] += alone
                if deaths[at] >= pool.tries:
                    yield at, Outcome(error=_deadly(deaths[at]))
                else:
                    suspects.append(at)
    finally:
        for future in running:
            future.cancel()


def _deadly(n: int) -> RunError:
    """Say that an item costs the process its life."""
    times = "once" if n == 1 else f"{n} times"
    return RunError(
        f"the worker process died of it, alone with it {times} (out of memory, or a crash)"
    )


def _outcome(future: Future[bytes], pool: Pool) -> Outcome | None:
    """Return what came of an item; None if it was lost with its process."""
    try:
        outcome: Outcome = pickle.loads(future.result())  # noqa: S301
    except pool.lost:
        return None
    except BesmanError:
        raise
    except Exception as error:
        raise RunError(f"a worker cannot take work: {type(error).__name__}: {error}") from None
    return outcome


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
    _limit_threads()
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
def _limit_threads() -> None:
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
