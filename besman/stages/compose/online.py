"""Actions kept current while building blocks arrive."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from besman.exceptions import RecognitionError
from besman.records import LabelledRecording
from besman.stages.compose.actions import Level, LevelModel, name_spans
from besman.stages.compose.vhms import GroupingSearch


@dataclass(frozen=True, eq=False)
class CurrentLevel(Level):
    """Actions so far; the first `n_final` do not change any more.

    Attributes
    ----------
    n_final : int
        Actions that are settled.
    """

    n_final: int = 0


class _Grower:
    """One level: a search, the rows of its borders, and the names of the groups looked at."""

    def __init__(self, model: LevelModel, longest: int | None, horizon: int | None) -> None:
        self.model = model
        self.search = GroupingSearch(longest, horizon)
        self.rows: list[int] = [0]
        self.names: dict[tuple[int, int], tuple[str, float]] = {}

    def copy(self) -> _Grower:
        twin = _Grower(self.model, None, None)
        twin.search, twin.rows, twin.names = self.search.copy(), self.rows[:], self.names.copy()
        return twin

    def add(self, recording: LabelledRecording, dropped: int, end: int) -> None:
        """Add the block that ends before row `end`; `recording` begins at row `dropped`."""
        self.rows.append(end)
        last = len(self.rows) - 1
        starts = [last - length for length in range(1, self.search.reach + 1)]
        spans = np.array([[self.rows[start], end] for start in starts]) - dropped
        labels, uncertainties = name_spans(recording, spans, self.model)
        for start, label, value in zip(starts, labels, uncertainties, strict=True):
            self.names[start, last] = (label, float(value))
        self.search.add(uncertainties)
        first = self.search.first_open
        settled = self.search.best().borders[: self.search.n_settled + 1]
        kept = set(pairwise(settled))
        self.names = {k: v for k, v in self.names.items() if k[0] >= first or k in kept}

    def level(self) -> CurrentLevel:
        """Return the best actions of the blocks so far."""
        best = self.search.best()
        found = [self.names[group] for group in pairwise(best.borders)]
        return CurrentLevel(
            np.array([self.rows[border] for border in best.borders]),
            tuple(label for label, _ in found),
            np.array([value for _, value in found]),
            best.fitness,
            self.search.n_settled,
        )


class OnlineHierarchy:
    """Actions of every level, after every building block of either arm.

    Without a horizon the actions after any block are those that `compose_levels` finds for the
    recording so far. With one, actions are final once `horizon` blocks of the level below lie
    behind them, and only samples since then are kept; `GroupingSearch` says why nothing is certain
    earlier.

    Parameters
    ----------
    models : sequence of LevelModel
        One for each level.
    longest : int, optional
        Most blocks in one action.
    horizon : int, optional
        Blocks after which an action is final.
    """

    def __init__(
        self, models: Sequence[LevelModel], longest: int | None = None, horizon: int | None = None
    ) -> None:
        if not models:
            raise RecognitionError("compose: got no levels; expected at least 1")
        self._levels = [_Grower(model, longest, horizon) for model in models]
        self._fed = [0] * len(models)
        self._seen: LabelledRecording | None = None
        self._dropped = 0

    def update(self, block: LabelledRecording) -> tuple[CurrentLevel, ...]:
        """Add a block.

        Parameters
        ----------
        block : LabelledRecording
            The samples since the last border of either arm, at least two.

        Returns
        -------
        tuple of CurrentLevel
            For each level; borders are rows counted from the first sample of the first block.

        Raises
        ------
        RecognitionError
            If a marker is missing or was not seen, or the markers changed.
        """
        self._seen = block if self._seen is None else _join(self._seen, block)
        end = self._dropped + len(self._seen.time)
        first = self._levels[0]
        first.add(self._seen, self._dropped, end)
        current = [first.level()]
        for index, grower in enumerate(self._levels[1:], start=1):
            below = current[-1]
            for row in below.borders[self._fed[index] + 1 : below.n_final + 1]:
                grower.add(self._seen, self._dropped, int(row))
            self._fed[index] = below.n_final
            ahead = grower.copy()
            for row in below.borders[below.n_final + 1 :]:
                ahead.add(self._seen, self._dropped, int(row))
            level = ahead.level()
            current.append(dataclasses.replace(level, n_final=grower.search.n_settled))
        self._forget()
        return tuple(current)

    def copy(self) -> OnlineHierarchy:
        """Return a hierarchy that goes on from here on its own."""
        twin = copy.copy(self)
        twin._levels = [level.copy() for level in self._levels]
        twin._fed = self._fed[:]
        return twin

    def _forget(self) -> None:
        """Drop samples that no action to come can hold."""
        assert self._seen is not None
        needed = min(level.rows[level.search.first_open] for level in self._levels)
        if needed > self._dropped:
            rows = slice(needed - self._dropped, None)
            self._seen = _cut(self._seen, rows)
            self._dropped = needed


def _join(one: LabelledRecording, two: LabelledRecording) -> LabelledRecording:
    """Put a piece behind another."""
    if one.markers != two.markers:
        raise RecognitionError(
            f"{two.source}: a block has markers {', '.join(two.markers)}; expected those of the "
            f"blocks before: {', '.join(one.markers)}"
        )
    if len(one.time) and len(two.time) and two.time[0] <= one.time[-1]:
        raise RecognitionError(
            f"{two.source}: a block begins at {two.time[0]:g} s; expected it after "
            f"{one.time[-1]:g} s"
        )
    return dataclasses.replace(
        one,
        time=np.concatenate([one.time, two.time]),
        positions=np.concatenate([one.positions, two.positions]),
        filled=np.concatenate([one.filled, two.filled]),
    )


def _cut(recording: LabelledRecording, rows: slice) -> LabelledRecording:
    """Take rows of a recording."""
    start = rows.start or 0
    return dataclasses.replace(
        recording,
        time=recording.time[rows],
        positions=recording.positions[rows],
        filled=recording.filled[rows],
        first_frame=recording.first_frame + start,
    )
