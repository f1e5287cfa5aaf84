"""What every stage is: a frozen, checked config that turns records into records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Generic, NamedTuple, ParamSpec, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from besman.config.ranges import check_values
from besman.records import LabelledRecording, LabelledSegments
from besman.work.work import Work

__all__ = [
    "Config",
    "Items",
    "NotNegative",
    "Positive",
    "Stage",
    "Step",
    "Training",
    "Truth",
    "Work",
]

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]

Records = ParamSpec("Records")
Result = TypeVar("Result", covariant=True)


class Config(BaseModel):
    """A frozen config section; unknown keys are errors, and so are values out of all sense.

    See `besman.config.ranges`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="after")
    @classmethod
    def _is_in_range(cls, value: Any, info: ValidationInfo) -> Any:
        """Hold a value against the range of its key."""
        check_values(str(info.field_name), value)
        return value


class Items(NamedTuple):
    """How many of what a stage works on, for the timing table."""

    n: int
    unit: str = "item"


@dataclass(frozen=True, eq=False)
class Truth:
    """What is known of the recordings beforehand: a stage's figures are held against it.

    Attributes
    ----------
    blocks : tuple of LabelledSegments or None
        Manual segments of each recording that are building blocks; None where there are none.
    names : tuple of (tuple of str or None)
        True marker of each trajectory of each recording; None where that is not known.
    margin_s : float
        Greatest distance of a found border to a manual one that counts as found, seconds.
    """

    blocks: tuple[LabelledSegments | None, ...] = ()
    names: tuple[tuple[str, ...] | None, ...] = ()
    margin_s: float = 0.3


class Stage(Config):
    """A stage: its config is its fields, its work is ``run(records...) -> record(s)``.

    Subclasses have a ``method`` field and a method
    ``run(self, *records, work: Work = Work()) -> record or tuple of records``.
    Stages read no files and write none; one that goes on where it was after it was killed keeps
    what it needs for that in ``work.checkpoints``, and says so by `keeps_checkpoints`. One whose
    items can fail one by one says so by `leaves_out`: its figures list them. `libraries` compute
    its result besides those that every stage stands on.
    """

    keeps_checkpoints: ClassVar[bool] = False
    leaves_out: ClassVar[bool] = False
    libraries: ClassVar[tuple[str, ...]] = ()

    @property
    def config(self) -> Stage:
        """The config of its work: itself."""
        return self

    def items(self, *records: Any, **named: Any) -> Items:
        """Return how many of what it works on; gets what ``run`` gets."""
        return Items(0)

    def figures(self, result: Any, truth: Truth, *records: Any) -> Any:
        """Return its section of ``results.json``; gets the result, and what ``run`` got.

        A tuple of dicts makes a section for each of two arms.
        """
        return {}


class Step(Protocol[Records, Result]):
    """What a run does once: the work of a stage, or another work with a stage's config."""

    @property
    def config(self) -> Stage:
        """Settings of the work."""

    def run(self, *records: Records.args, **named: Records.kwargs) -> Result:
        """Do it; takes ``work`` as well."""

    def items(self, *records: Any, **named: Any) -> Items:
        """Return how many of what it works on."""

    def figures(self, result: Any, truth: Truth, *records: Any) -> Any:
        """Return its section of ``results.json``."""


@dataclass(frozen=True, eq=False)
class Training(Generic[Result]):
    """Learning from labelled examples with a stage's config.

    Attributes
    ----------
    config : Stage
    learn : callable
        Takes recordings, the manual segments of those that have some, and work.
    n_examples : int
        How many of each class.
    """

    config: Stage
    learn: Callable[[tuple[LabelledRecording, ...], tuple[LabelledSegments, ...], Work], Result]
    n_examples: int

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        truth: tuple[LabelledSegments, ...],
        work: Work = Work(),
    ) -> Result:
        """Learn."""
        return self.learn(recordings, truth, work)

    def items(self, *records: Any) -> Items:
        """Count the examples."""
        return Items(self.n_examples, "a class")

    def figures(self, result: Any, truth: Truth, *records: Any) -> dict[str, Any]:
        """Return none: what was learnt shows its worth when it is used."""
        return {}
