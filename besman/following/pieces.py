"""Blocks and actions as they become known, and what changed about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Status = Literal["new", "renamed", "final", "gone"]


@dataclass(frozen=True)
class Piece:
    """A building block of an arm, or an action of a level.

    Attributes
    ----------
    kind : "block" or "action"
    of : str
        Name of the arm, or number of the level from 1.
    start, end : int
        Half-open rows from the first sample of the stream.
    label : str
        Its class, or ``unknown``.
    uncertainty : float
        Distance to the nearest example; infinite where a marker that is needed was lost.
    final : bool
        Whether nothing that comes can change it.
    """

    kind: Literal["block", "action"]
    of: str
    start: int
    end: int
    label: str
    uncertainty: float
    final: bool


@dataclass(frozen=True)
class Change:
    """What happened to a piece.

    Attributes
    ----------
    status : "new", "renamed", "final" or "gone"
        ``gone``: its borders are no longer the most probable ones.
    piece : Piece
        As it is now, or as it was if it is gone.
    """

    status: Status
    piece: Piece


class Ledger:
    """The pieces of one arm or level, in the order of time."""

    def __init__(self) -> None:
        self._final: list[Piece] = []
        self._open: dict[tuple[int, int], Piece] = {}

    @property
    def n_final(self) -> int:
        """Pieces that are final."""
        return len(self._final)

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """All pieces, the final ones first."""
        return (*self._final, *self._open.values())

    def update(self, pieces: Sequence[Piece]) -> list[Change]:
        """Take the present pieces after the final ones; return what changed, in order of time."""
        before, self._open = self._open, {}
        changes: list[Change] = []
        for piece in pieces:
            rows = piece.start, piece.end
            was = before.pop(rows, None)
            if piece.final:
                self._final.append(piece)
                changes.append(Change("final", piece))
            else:
                self._open[rows] = piece
                if was is None:
                    changes.append(Change("new", piece))
                elif was.label != piece.label:
                    changes.append(Change("renamed", piece))
        gone = [Change("gone", piece) for piece in before.values()]
        return gone + changes
