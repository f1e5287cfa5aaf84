"""Blocks and actions as they become known, and what changed about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Status = Literal["new", "changed", "final", "gone"]

# A piece has only changed if it shares more than this with what it was.
_SHARED = 0.5


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
    status : "new", "changed", "final" or "gone"
        ``changed``: another label, or other borders with more than half of the rows in common.
    piece : Piece
        As it is now, or as it was if it is gone.
    before : Piece, optional
        As it was, if it is not new.
    """

    status: Status
    piece: Piece
    before: Piece | None = None


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
        before = self._open
        self._open = {(one.start, one.end): one for one in pieces if not one.final}
        self._final += [one for one in pieces if one.final]
        changed: list[tuple[Piece, Piece | None]] = []
        for piece in pieces:
            was = before.pop((piece.start, piece.end), None)
            if was != piece:
                changed.append((piece, was))
        changes = []
        for piece, was in changed:
            old = was if was is not None else _pop_shared(before, piece)
            status: Status = "final" if piece.final else "new" if old is None else "changed"
            changes.append(Change(status, piece, old))
        return [Change("gone", piece, piece) for piece in before.values()] + changes


def _pop_shared(pieces: dict[tuple[int, int], Piece], piece: Piece) -> Piece | None:
    """Take out the piece that shares more than half of its rows with another, if there is one."""
    for rows in pieces:
        shared = min(rows[1], piece.end) - max(rows[0], piece.start)
        if shared > _SHARED * max(rows[1] - rows[0], piece.end - piece.start):
            return pieces.pop(rows)
    return None
