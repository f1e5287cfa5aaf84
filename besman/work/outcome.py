"""What comes of an item, and what a stage's work leaves beside its result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from besman.exceptions import BesmanError, StoppedError
from besman.records import Failure

Item = TypeVar("Item")


@dataclass
class Notes:
    """What a stage's work leaves beside its result.

    Attributes
    ----------
    failures : list of Failure
        Items that could not be worked on.
    workers : dict of float
        Greatest memory of every worker process so far by its name, MB.
    cpu_s : float
        CPU time spent in worker processes, seconds.
    """

    failures: list[Failure] = field(default_factory=list)
    workers: dict[str, float] = field(default_factory=dict)
    cpu_s: float = 0.0

    def add_worker(self, worker: str, peak_rss_mb: float, cpu_s: float) -> None:
        """Keep account of a worker process."""
        self.workers[worker] = max(self.workers.get(worker, 0.0), peak_rss_mb)
        self.cpu_s += cpu_s

    def add_workers(self, other: Notes) -> None:
        """Take over another's account of workers, not its failures."""
        for worker, peak_rss_mb in other.workers.items():
            self.add_worker(worker, peak_rss_mb, 0.0)
        self.cpu_s += other.cpu_s


@dataclass(frozen=True)
class Outcome:
    """What came of one item.

    Attributes
    ----------
    value : any
        The result, if there is no error.
    error : Exception, optional
    worker : str
        ``host:pid`` of the process, empty for this one.
    peak_rss_mb, cpu_s : float
        Greatest memory of that process so far, MB; CPU time of the item, seconds.
    """

    value: Any = None
    error: Exception | None = None
    worker: str = ""
    peak_rss_mb: float = 0.0
    cpu_s: float = 0.0


def attempt(function: Callable[[Item], Any], item: Item) -> Outcome:
    """Apply a function to an item; an error is an outcome like any other."""
    try:
        return Outcome(value=function(item))
    except Exception as error:
        return Outcome(error=error)


def failure_of(name: str, error: Exception) -> Failure:
    """Say why an item failed; an error that besman does not know is named by its kind."""
    return Failure(name=name, reason=describe_error(error).removeprefix(f"{name}: "))


def describe_error(error: BaseException) -> str:
    """Say in one line what an error is; one that besman does not know by its kind as well."""
    text = " ".join(str(error).split())
    if isinstance(error, KeyboardInterrupt):
        return "stopped by Ctrl-C"
    known = isinstance(error, BesmanError | StoppedError)
    return text if known else f"{type(error).__name__}: {text}"
