"""Processes on this machine or workers of a cluster, and what is done when one of them dies."""

from __future__ import annotations

import pickle
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any, Protocol

from besman.exceptions import BesmanError, RunError
from besman.work.outcome import Outcome
from besman.work.versions import environment

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
