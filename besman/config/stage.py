"""What every stage is: a frozen, checked config that turns records into records."""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import BaseModel, ConfigDict, Field

from besman.work.work import Work

__all__ = ["Config", "NotNegative", "Positive", "Stage", "Work"]

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Config(BaseModel):
    """A frozen config section; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Stage(Config):
    """A stage: its config is its fields, its work is ``run(records...) -> record(s)``.

    Subclasses have a ``method`` field and a method
    ``run(self, *records, work: Work = Work()) -> record or tuple of records``.
    Stages read no files and write none; one that goes on where it was after it was killed keeps
    what it needs for that in ``work.checkpoints``, and says so by `keeps_checkpoints`.
    """

    keeps_checkpoints: ClassVar[bool] = False
