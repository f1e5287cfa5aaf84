"""Worker processes on this machine."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager

from joblib.externals.loky import ProcessPoolExecutor
from joblib.externals.loky.process_executor import BrokenProcessPool

from besman.work.in_worker import begin_worker, run_item
from besman.work.stopping import SIGNALS

# A process without work ends.
_IDLE_S = 60.0


class ProcessPool:
    """Processes started afresh, so that they have none of this one's memory or threads.

    Parameters
    ----------
    jobs : int
        How many.
    """

    lost: tuple[type[BaseException], ...] = (BrokenProcessPool,)
    tries = 2

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._executor = self._start()

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            max_workers=self._jobs,
            timeout=_IDLE_S,
            env={"OPENBLAS_NUM_THREADS": "1"},
            initializer=begin_worker,
            initargs=(os.getpid(),),
        )

    @property
    def window(self) -> int:
        """Keep every process busy while results are taken."""
        return 2 * self._jobs

    def submit(self, call: bytes, item: bytes) -> Future[bytes]:
        """Have an item worked on."""
        with _deaf():
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
def _deaf() -> Iterator[None]:
    """Let processes that are started here hear nothing of Ctrl-C, SIGTERM and SIGHUP.

    A terminal sends these to them as well; this process hears them, and ends the others.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
