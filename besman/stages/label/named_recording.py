"""What naming the trajectories of a recording gives."""

from __future__ import annotations

from dataclasses import dataclass

from besman.records import LabelledRecording, Record


@dataclass(frozen=True)
class NameDecision(
    Record,
    stored_as="besman.labelling.record:NameDecision",
    finite=("confidence",),
):
    """What was decided of one unbroken stretch of a trajectory.

    Attributes
    ----------
    trajectory : int
        Column of the recording.
    start, stop : int
        Half-open range of its rows.
    marker : str
        Best name; "" if it is none of the markers.
    confidence : float
        Probability that `marker` is right.
    named : bool
        Whether the name was given.
    """

    trajectory: int
    start: int
    stop: int
    marker: str
    confidence: float
    named: bool


@dataclass(frozen=True, eq=False)
class NamedRecording(LabelledRecording, stored_as="besman.labelling.record:NamedRecording"):
    """A labelled recording whose names the program found, with every decision.

    Attributes
    ----------
    decisions : tuple of NameDecision
        One for each unbroken stretch, in the order of their first frames.
    threshold : float
        Decisions less sure than this are for a person to review.
    """

    decisions: tuple[NameDecision, ...] = ()
    threshold: float = 0.0

    @property
    def review(self) -> tuple[NameDecision, ...]:
        """Decisions that a person should look at."""
        return tuple(found for found in self.decisions if found.confidence < self.threshold)
