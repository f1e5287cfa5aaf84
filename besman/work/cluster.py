"""Workers of a Dask cluster (extra ``cluster``)."""

from __future__ import annotations

import asyncio
import logging
import re
import time
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from typing import Any

from besman.exceptions import RunError
from besman.work.in_worker import run_item

_ADDRESS = re.compile(r"tcp://\S+:\d+")
_CONNECT_S = 5.0
_FIRST_WORKER_S = 10.0
# Workers that are restarted are back sooner.
_NO_WORKERS_S = 30.0
_ANSWER_S = 30.0


async def _greet(address: str) -> None:
    """Exchange greetings with a scheduler."""
    from distributed.comm import connect

    comm = await connect(address, timeout=_CONNECT_S)
    await comm.close()


class ClusterPool:
    """The workers of a Dask cluster.

    Parameters
    ----------
    address : str
        Of its scheduler, ``tcp://HOST:PORT``.

    Raises
    ------
    RunError
        If it does not answer, has no workers, or Dask is not installed.
    """

    # The scheduler itself gives an item to several workers before it calls it killed.
    tries = 1

    def __init__(self, address: str) -> None:
        if not _ADDRESS.fullmatch(address):
            raise RunError(f"--cluster: got {address!r}, expected tcp://HOST:PORT")
        try:
            from distributed import KilledWorker
        except ImportError:
            raise RunError(
                "--cluster: Dask is not installed; pip install 'besman[cluster]'"
            ) from None
        self.lost: tuple[type[BaseException], ...] = (KilledWorker, CancelledError)
        self._address = address
        self._threads, self._empty_since = 0, time.monotonic()
        # What goes wrong is raised; the library would print it as well.
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        self._client: Any = None
        self._connect()

    def _connect(self) -> None:
        """Find the scheduler and at least one worker."""
        from distributed import Client

        try:
            # The client itself waits longer for a port that is open and says nothing.
            asyncio.run(asyncio.wait_for(_greet(self._address), _CONNECT_S))
            self._client = Client(self._address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise RunError(
                f"--cluster {self._address}: no Dask scheduler answers within {_CONNECT_S:g} s "
                f"({type(error).__name__})"
            ) from None
        self._executor = self._client.get_executor(pure=False)
        until = time.monotonic() + _FIRST_WORKER_S
        while not self._count():
            if time.monotonic() > until:
                self.close()
                raise RunError(
                    f"--cluster {self._address}: the scheduler has no workers; start some with: "
                    f"dask worker {self._address}"
                )
            time.sleep(0.2)

    def _count(self) -> int:
        """Ask the scheduler how many threads its workers have."""
        try:
            threads = self._client.sync(self._client.scheduler.ncores, callback_timeout=_ANSWER_S)
        except Exception as error:
            raise RunError(
                f"--cluster {self._address}: the scheduler is lost ({type(error).__name__}); the "
                "same command goes on from the last stage that was done"
            ) from None
        self._threads = sum(threads.values())
        if self._threads:
            self._empty_since = time.monotonic()
        return self._threads

    @property
    def window(self) -> int:
        """Keep every thread busy while results are taken, also of workers that join."""
        return max(16, 3 * self._threads)

    def submit(self, call: bytes, item: bytes) -> Future[bytes]:
        """Have an item worked on."""
        future: Future[bytes] = self._executor.submit(run_item, call, item)
        return future

    def renew(self) -> None:
        """Connect again, if the scheduler has been away."""
        if self._client.status != "running":
            self.close()
            self._connect()

    def check(self) -> None:
        """Look whether there are workers still."""
        self._count()
        if time.monotonic() - self._empty_since > _NO_WORKERS_S:
            raise RunError(
                f"--cluster {self._address}: no workers for {_NO_WORKERS_S:g} s; the same command "
                "goes on from the last stage that was done"
            )

    def close(self) -> None:
        """Leave the cluster; it keeps running."""
        if self._client is not None:
            # One that still looks for its scheduler does not end in time; why it does is said then.
            with suppress(TimeoutError):
                self._client.close(timeout=_CONNECT_S)
