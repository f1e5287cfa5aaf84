"""How a stage's items are worked on: one by one, in threads, in processes or on a cluster.

An item is what can be computed by itself: a demonstration, a motion. It is computed by the same
function wherever that happens, so results do not depend on where, in which order or how often.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from besman.exceptions import BesmanError
from besman.records import Failure
from besman.work.outcome import Item, Notes, Outcome, attempt, failure_of

if TYPE_CHECKING:
    from besman.work.workers import Workers

Result = TypeVar("Result")


def _ignore(done: float) -> None:
    """Take no notice of progress."""


def _name_of(item: Any) -> str:
    """Return the item's own name."""
    return str(item.name)


@dataclass(frozen=True)
class Work:
    """How to run a stage, as opposed to what it computes: never changes a result.

    Attributes
    ----------
    jobs : int
        Threads or processes that may be used.
    progress : callable
        Called with the share done, 0 to 1.
    notes : Notes, optional
        Takes what fails, so that the rest goes on, and what workers cost. Without it the first
        failure is raised.
    strict : bool
        The first failure is raised although there are notes.
    workers : Workers, optional
        Processes or a cluster; without them there are threads alone.
    checkpoints : Path, optional
        An existing folder for what a stage wants to find again if it is ended before its end.
    """

    jobs: int = 1
    progress: Callable[[float], None] = _ignore
    notes: Notes | None = None
    workers: Workers | None = None
    checkpoints: Path | None = None
    strict: bool = False

    @property
    def has_processes(self) -> bool:
        """Whether there are processes on this machine, or can be."""
        return self.jobs > 1 and self.workers is not None and self.workers.cluster is None

    def part(self, start: float, stop: float) -> Work:
        """Return the same work, whose progress is a part of this one's.

        Parameters
        ----------
        start, stop : float
            Shares of this work's progress, 0 to 1.
        """
        span = stop - start
        return replace(self, progress=lambda done: self.progress(start + span * done))

    def map(
        self,
        function: Callable[[Item], Result],
        items: Sequence[Item],
        *,
        name: Callable[[Item], str] = _name_of,
        processes: int = 0,
        local: bool = False,
        some: bool = True,
    ) -> list[Result]:
        """Apply a function to every item.

        Parameters
        ----------
        function : callable
            Of a module, or a `functools.partial` of one: other processes find it by its name.
        items : sequence
            Each can be computed by itself.
        name : callable
            Gives an item's name; by default its attribute ``name``.
        processes : int
            From how many items on processes of this machine are sooner done than threads, which
            share Python's lock but need not be started; 0 for never.
        local : bool
            Not for a cluster, because it touches files or is done before it is sent.
        some : bool
            At least one item must succeed.

        Returns
        -------
        list
            Results of the items that did not fail, in the order of the items.

        Raises
        ------
        Exception
            What the first item failed with, if there are no `notes` or it is `strict`.
        BesmanError
            If every item failed, and some must not.
        """
        found: list[Outcome] = [Outcome()] * len(items)
        for done, (at, outcome) in enumerate(self._outcomes(function, items, processes, local), 1):
            found[at] = outcome
            self.progress(done / len(items))
            if self.notes is not None and outcome.worker:
                self.notes.add_worker(outcome.worker, outcome.peak_rss_mb, outcome.cpu_s)
        errors = [(item, one.error) for item, one in zip(items, found, strict=True) if one.error]
        if errors and (self.notes is None or self.strict):
            raise errors[0][1]
        failures = [failure_of(name(item), error) for item, error in errors]
        if self.notes is not None:
            self.notes.failures += failures
        if some and errors and len(errors) == len(items):
            raise _all_failed(errors[0][1], failures)
        return [one.value for one in found if one.error is None]

    def _outcomes(
        self, function: Callable[[Any], Any], items: Sequence[Any], processes: int, local: bool
    ) -> Iterable[tuple[int, Outcome]]:
        """Work on the items where it is best; yield index and outcome as they come."""
        if self.workers is not None and self.workers.cluster is not None and not local:
            return self.workers.on_cluster(function, items)
        many = self.jobs > 1 and 0 < processes <= len(items)
        if self.workers is not None and many:
            return self.workers.in_processes(function, items)
        return _in_threads(function, items, self.jobs)


def _in_threads(
    function: Callable[[Any], Any], items: Sequence[Any], jobs: int
) -> Iterator[tuple[int, Outcome]]:
    """Work in this process, in threads if there are several jobs."""
    if jobs == 1 or len(items) == 1:
        for at, item in enumerate(items):
            yield at, attempt(function, item)
        return
    threads, waits = ThreadPoolExecutor(jobs), True
    try:
        futures = {threads.submit(attempt, function, item): at for at, item in enumerate(items)}
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
    except BaseException:
        # What a thread is at may take long: whoever asks for the end is not kept waiting.
        waits = False
        raise
    finally:
        threads.shutdown(wait=waits, cancel_futures=True)


def _all_failed(error: Exception, failures: list[Failure]) -> BesmanError:
    """Return the error of a stage in which nothing succeeded, of the kind of its first failure."""
    if len(failures) == 1:
        text = str(failures[0])
    else:
        text = f"all {len(failures)} failed; the first: {failures[0]}"
    return type(error)(text) if isinstance(error, BesmanError) else BesmanError(text)
