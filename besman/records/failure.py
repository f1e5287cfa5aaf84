"""What a stage had to leave out."""

from __future__ import annotations

from dataclasses import dataclass

from besman.records.frozen import Record


@dataclass(frozen=True)
class Failure(Record, stored_as="besman.records:Failure"):
    """A demonstration or motion that a stage had to leave out.

    Attributes
    ----------
    name : str
        Of the demonstration or motion.
    reason : str
        Why it was left out.
    """

    name: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}"
