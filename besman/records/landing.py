"""Where a thrown thing came down, measured beside the recording."""

from __future__ import annotations

from dataclasses import dataclass

from besman.records.frozen import FloatArray, Record, freeze


@dataclass(frozen=True, eq=False)
class Landing(Record, stored_as="besman.records:Landing", finite=("place",)):
    """Where one throw came down.

    Attributes
    ----------
    recording : str
        Name of the recording's file, with or without its ending.
    throw : int
        Which throw of the recording, from 1 on.
    place : array, shape (3,)
        Metres in the recording's laboratory frame.
    """

    recording: str
    throw: int
    place: FloatArray

    def __post_init__(self) -> None:
        freeze(self, {"place": (3,)})

    def is_of(self, source: str, throw: int) -> bool:
        """Tell whether it is that of a throw of a recording."""
        return throw == self.throw and self.recording in (source, source.rsplit(".", 1)[0])
