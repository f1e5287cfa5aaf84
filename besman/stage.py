"""What every stage is: a frozen, checked config that turns records into records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict


def _ignore(done: float) -> None:
    """Take no notice of progress."""


@dataclass(frozen=True)
class Work:
    """How to run a stage, as opposed to what it computes: never changes a result.

    Attributes
    ----------
    jobs : int
        Threads or processes that may be used.
    progress : callable
        Called with the share done, 0 to 1.
    """

    jobs: int = 1
    progress: Callable[[float], None] = _ignore


class Config(BaseModel):
    """A frozen config section; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Stage(Config):
    """A stage: its config is its fields, its work is ``run(records...) -> record(s)``.

    Subclasses have a ``method`` field and a method
    ``run(self, *records, work: Work = Work()) -> record or tuple of records``.
    Stages read no files and write none.
    """
