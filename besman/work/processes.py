"""Worker processes on this machine, forked from one that has loaded what all of them need."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from multiprocessing import get_context
from types import ModuleType

from joblib.externals.loky import ProcessPoolExecutor
from joblib.externals.loky.process_executor import BrokenProcessPool

from besman.work.fork_server import deaf, start_server
from besman.work.in_worker import begin_worker, run_item

# A process without work ends.
_IDLE_S = 60.0


class ProcessPool:
    """Processes that have none of this one's memory or threads; see `besman.work.fork_server`.

    Parameters
    ----------
    jobs : int
        How many.
    """

    lost: tuple[type[BaseException], ...] = (BrokenProcessPool,)
    tries = 2

    def __init__(self, jobs: int) -> None:
        start_server()
        self._jobs = jobs
        self._executor = self._start()

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            max_workers=self._jobs,
            timeout=_IDLE_S,
            context=get_context("forkserver"),
            initializer=begin_worker,
        )

    @property
    def window(self) -> int:
        """Keep every process busy while results are taken."""
        return 2 * self._jobs

    def submit(self, call: bytes, item: bytes) -> Future[bytes]:
        """Have an item worked on."""
        with deaf(), _without_script():
            try:
                future: Future[bytes] = self._executor.submit(run_item, call, item)
            except BrokenProcessPool:
                self.renew()
                future = self._executor.submit(run_item, call, item)
        return future

    def renew(self) -> None:
        """Start processes again after one has died."""
        self._executor.shutdown(wait=True, kill_workers=True)
        self._executor = self._start()

    def check(self) -> None:
        """Trust that the executor notices when a process dies."""

    def close(self) -> None:
        """End the processes."""
        self._executor.shutdown(wait=True, kill_workers=True)


@contextmanager
def _without_script() -> Iterator[None]:
    """Keep processes that are started here from running this process's script once more.

    One that says nothing of ``__main__`` would start processes of its own there.
    """
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script
