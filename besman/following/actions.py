"""Actions of a stream: of the final borders, and ahead of them of the most probable ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from besman.classifiers.novelty import UNKNOWN
from besman.following.candidates import CandidateStream
from besman.following.frames import FrameBuffer
from besman.following.pieces import Change, Ledger, Piece
from besman.person.body import find_back
from besman.stages.compose.actions import LevelModel
from besman.stages.compose.online import CurrentLevel, OnlineHierarchy


class _Moment(NamedTuple):
    """What the actions were when the block before `row` had ended."""

    row: int
    hierarchy: OnlineHierarchy
    levels: tuple[CurrentLevel, ...]


class ActionStream:
    """Groups the blocks of all arms to actions of every level.

    The hierarchy is kept for the last final border and for each border after it. Where the most
    probable borders change, it goes on from the last one that stays.

    Parameters
    ----------
    models : sequence of LevelModel
        One for each level, the lowest first.
    longest, horizon : int, optional
        See `besman.stages.compose.online.OnlineHierarchy`.
    brisk_m_s : mapping of str to float
        See `besman.following.candidates.CandidateStream`.
    frames : FrameBuffer
        Gets the frames of the stream.
    """

    def __init__(
        self,
        models: Sequence[LevelModel],
        longest: int | None,
        horizon: int | None,
        brisk_m_s: Mapping[str, float],
        frames: FrameBuffer,
    ) -> None:
        self._frames = frames
        self.candidates = CandidateStream(brisk_m_s, frames)
        named = [name for model in models for name in model.markers]
        self.needed = tuple(dict.fromkeys((*named, *self.candidates.hands)))
        back = find_back(frames.markers)
        self._columns = frames.columns(tuple(dict.fromkeys((*back, *named))))
        self._of_level = [frames.columns((*back, *model.markers)) for model in models]
        self._moments = [_Moment(0, OnlineHierarchy(models, longest, horizon), ())]
        self.ledgers = [Ledger() for _ in models]

    @property
    def final_row(self) -> int:
        """The last border of both arms that is final."""
        return self._moments[0].row

    @property
    def fitness(self) -> tuple[float, ...]:
        """Fitness of each level; none before the first block."""
        return tuple(level.fitness for level in self._moments[-1].levels)

    def update(self, per_arm: Sequence[Sequence[int]], final_row: int, done: bool) -> list[Change]:
        """Take the present borders of every arm.

        Parameters
        ----------
        per_arm : sequence of sequences of int
            Rows after `candidates.final_border`, rising.
        final_row : int
            Up to it the borders of all arms are final.
        done : bool
            Whether the stream has ended; its end is a border then.

        Returns
        -------
        list of Change
            Of all levels, the lowest first.
        """
        rows, n_final = self.candidates.update(per_arm, final_row, done)
        same = 0
        while same < min(len(rows), len(self._moments) - 1) and (
            self._moments[same + 1].row == rows[same]
        ):
            same += 1
        changed = same < max(len(rows), len(self._moments) - 1)
        del self._moments[same + 1 :]
        for row in rows[same:]:
            self._go_on(row)
        del self._moments[:n_final]
        return self._compare(done) if changed or n_final or done else []

    def _go_on(self, row: int) -> None:
        """Add the block that ends before a row."""
        last = self._moments[-1]
        hierarchy = last.hierarchy.copy()
        levels = hierarchy.update(self._frames.cut(last.row, row, self._columns))
        self._moments.append(_Moment(row, hierarchy, levels))

    def _compare(self, done: bool) -> list[Change]:
        """Tell what changed, level by level."""
        changes: list[Change] = []
        settled, latest = self._moments[0].levels, self._moments[-1].levels
        for index, (ledger, level) in enumerate(zip(self.ledgers, latest, strict=False)):
            n_final = settled[index].n_final if settled else 0
            n_final = len(level.labels) if done else n_final
            pieces = []
            for k in range(ledger.n_final, len(level.labels)):
                start, end = int(level.borders[k]), int(level.borders[k + 1])
                gone = self._frames.was_lost(start, end, self._of_level[index])
                label = UNKNOWN if gone else level.labels[k]
                value = np.inf if gone else float(level.uncertainties[k])
                name = str(index + 1)
                pieces.append(Piece("action", name, start, end, label, value, k < n_final))
            changes += ledger.update(pieces)
        return changes
