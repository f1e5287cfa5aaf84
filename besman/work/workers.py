"""The processes of a run, on this machine or on a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any

from besman.work.outcome import Outcome
from besman.work.spread import Pool, spread


class Workers:
    """The processes of a run, started when they are first needed.

    Parameters
    ----------
    jobs : int
        Processes on this machine.
    cluster : str, optional
        Address of the scheduler of a Dask cluster, ``tcp://HOST:PORT``.
    preload : sequence of str
        Modules that processes on this machine need.

    Raises
    ------
    RunError
        If the cluster does not answer, has no workers, or Dask is not installed.
    """

    def __init__(
        self, jobs: int = 1, cluster: str | None = None, preload: Sequence[str] = ()
    ) -> None:
        self.jobs, self.cluster, self._preload = jobs, cluster, tuple(preload)
        self._processes: Pool | None = None
        self._remote: Pool | None = None
        if cluster is not None:
            from besman.work.cluster import ClusterPool

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

    def start(self) -> None:
        """Have modules loaded for processes on this machine, while this process does other work."""
        if self.jobs > 1 and self.cluster is None:
            from besman.work.fork_server import start_server

            start_server(self._preload)

    def in_processes(
        self, function: Callable[[Any], Any], items: Sequence[Any]
    ) -> Iterator[tuple[int, Outcome]]:
        """Work on items in processes on this machine; yield index and outcome as they come."""
        if self._processes is None:
            from besman.work.processes import ProcessPool

            self.start()
            self._processes = ProcessPool(self.jobs)
        return spread(self._processes, function, items)

    def on_cluster(
        self, function: Callable[[Any], Any], items: Sequence[Any]
    ) -> Iterator[tuple[int, Outcome]]:
        """Work on items on the cluster; yield index and outcome as they come."""
        assert self._remote is not None
        return spread(self._remote, function, items)
