"""Names for markers without any, while a stream runs.

Naming a whole recording looks at all of it. Here the same method (`label_fragments`) looks at the
last two seconds, whenever a fragment appears and as it grows, and begins with the names that were
found before. So a marker has a name from the first frame in which it is sure, and a name that turns
out wrong is corrected.

Which point of a frame goes on which fragment is told by where markers were expected, not by the
order in which they come: capture systems exchange unnamed markers as they like.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import Fragments, split_fragments
from besman.stages.label.model import MarkerModel
from besman.stages.label.naming import Assignment, label_fragments
from besman.stages.label.scores import GHOST

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_WINDOW_S = 2.0
# A fragment is looked at when it is so old, and all of them at least so often.
_AGES_S = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)
_EVERY_S = 0.5
# A start is sought this often until there is one; so is what got lost.
_SEEK_S, _LOST_S, _SELDOM_S = 0.1, 0.2, 10.0
# A point nearer than this to where its marker is expected is that marker.
_AT_HAND_M = 0.01
# Nobody moves a marker as fast, metres per second; slow ones may shake by so much.
_FASTEST_M_S, _SHAKE_M = 15.0, 0.03
# A name once given stays until another is more probable than not.
_KEPT = 0.5


class NameChange(NamedTuple):
    """One name that is new, or not what it was.

    Attributes
    ----------
    column : int
        Point of the frame that is meant.
    marker, was : int
        Of the model; `GHOST` for none.
    confidence : float
        Probability that it is right.
    age : int
        Frames since the marker appeared.
    """

    column: int
    marker: int
    was: int
    confidence: float
    age: int


class OnlineNaming:
    """Names the points of frames.

    Parameters
    ----------
    model : MarkerModel
    required : sequence of int
        Markers of the model that have to be found before it has begun.
    n_columns : int
        Points in a frame, seen or not.
    rate_hz : float
    threshold : float
        Least confidence of a name that is given.

    Attributes
    ----------
    has_begun : bool
        Whether all required markers have had a name in one frame.
    names : int array, shape (C,)
        Marker of each point of the last frame; `GHOST` where none is known.
    """

    def __init__(
        self,
        model: MarkerModel,
        required: IntArray,
        n_columns: int,
        rate_hz: float,
        threshold: float = 0.8,
    ) -> None:
        self._model, self._required, self._rate_hz = model, required, rate_hz
        self._threshold = threshold
        n_slots = 2 * n_columns
        self._n_window = max(4, round(_WINDOW_S * rate_hz))
        # Each fragment in a slot of its own; twice the window, so that it moves seldom.
        self._places = np.full((2 * self._n_window, n_slots, 3), np.nan)
        self._best = np.full((2 * self._n_window, n_slots), GHOST, dtype=np.int64)
        self._row = -1
        self._age = np.full(n_slots, -1, dtype=np.int64)
        self._given = np.full(n_slots, GHOST, dtype=np.int64)
        self._sure = np.zeros(n_slots)
        self._ages = np.unique([round(age * rate_hz) for age in _AGES_S])
        self._since_look = self._since_seek = 1 << 30
        self._wait_s = _SEEK_S
        self._unseen = np.zeros(model.n_markers, dtype=np.int64)
        self._slots = np.full(n_columns, -1, dtype=np.int64)
        self.has_begun = False
        self.names = np.full(n_columns, GHOST, dtype=np.int64)

    def take(self, positions: FloatArray) -> list[NameChange]:
        """Take a frame, shape (C, 3), metres, NaN where nothing is seen; return changed names."""
        before = self._given.copy()
        self._advance(positions)
        self._since_look += 1
        self._since_seek += 1
        if self._is_due():
            self._look()
        seen = self._slots >= 0
        self.names = np.where(seen, self._given[self._slots], GHOST)
        self._unseen += 1
        self._unseen[self.names[self.names != GHOST]] = 0
        self.has_begun = self.has_begun or not self._unseen[self._required].any()
        columns = np.flatnonzero(seen)
        changed = columns[self._given[self._slots[columns]] != before[self._slots[columns]]]
        return [self._describe(column, before) for column in changed.tolist()]

    def present(self) -> list[NameChange]:
        """Return all names of the last frame, as if they were new."""
        nothing = np.full(len(self._given), GHOST, dtype=np.int64)
        named = np.flatnonzero(self.names != GHOST)
        return [self._describe(column, nothing) for column in named.tolist()]

    @property
    def confidence(self) -> FloatArray:
        """Probability that each of `names` is right, shape (C,)."""
        return np.asarray(np.where(self._slots >= 0, self._sure[self._slots], 0.0))

    def window(self) -> tuple[FloatArray, IntArray]:
        """Return the places of the last two seconds and the markers that these are now.

        Returns
        -------
        places : array, shape (T, S, 3)
            Metres; NaN where nothing was seen.
        markers : int array, shape (T, S)
            The most probable ones, `GHOST` for none.
        """
        rows = self._rows
        return self._places[rows], self._best[rows]

    def _describe(self, column: int, before: IntArray) -> NameChange:
        slot = self._slots[column]
        marker, was = int(self._given[slot]), int(before[slot])
        return NameChange(column, marker, was, float(self._sure[slot]), int(self._age[slot]))

    @property
    def _rows(self) -> slice:
        return slice(max(0, self._row + 1 - self._n_window), self._row + 1)

    def _advance(self, positions: FloatArray) -> None:
        """Put the points of a frame into the slots whose fragments they go on."""
        if self._row + 1 == len(self._places):
            n = self._n_window
            for kept in (self._places, self._best):
                kept[:n] = kept[n:]
            self._places[n:], self._best[n:] = np.nan, GHOST
            self._row -= n
        seen: BoolArray = np.asarray(np.isfinite(positions).all(axis=1))
        slots = self._find_slots(positions, seen)
        self._row += 1
        columns = np.flatnonzero(slots >= 0)
        self._places[self._row, slots[columns]] = positions[columns]
        alive = np.zeros(len(self._age), dtype=np.bool_)
        alive[slots[columns]] = True
        self._age = np.where(alive, self._age + 1, -1)
        self._given[~alive] = GHOST
        if self._row:
            self._best[self._row] = np.where(self._age > 0, self._best[self._row - 1], GHOST)
        self._slots = slots

    def _find_slots(self, positions: FloatArray, seen: BoolArray) -> IntArray:
        """Return the slot of each point, new ones for points that go on nothing; -1 unseen."""
        slots = np.where(seen, self._slots, -1)
        alive = np.flatnonzero(self._age >= 0)
        expected = self._expect(alive)
        places = np.full(len(self._age), 0, dtype=np.int64)
        places[alive] = np.arange(len(alive))
        going = np.flatnonzero(slots >= 0)
        off = np.linalg.norm(positions[going] - expected[places[slots[going]]], axis=1)
        if len(going) < seen.sum() or (off > _AT_HAND_M).any():
            slots = self._match(positions, seen, alive, expected)
        new = np.flatnonzero(seen & (slots < 0))
        free = np.flatnonzero(self._age < 0)
        slots[new] = free[: len(new)]
        return slots

    def _expect(self, alive: IntArray) -> FloatArray:
        """Return where the live fragments go on, at the speed they had, shape (A, 3)."""
        last: FloatArray = self._places[self._row, alive]
        if self._row < 1:
            return last
        before = self._places[self._row - 1, alive]
        expected: FloatArray = np.where(np.isfinite(before), 2 * last - before, last)
        return expected

    def _match(
        self,
        positions: FloatArray,
        seen: BoolArray,
        alive: IntArray,
        expected: FloatArray,
    ) -> IntArray:
        """Return which live fragment each point goes on, so that all are least far off."""
        from scipy.optimize import linear_sum_assignment

        slots = np.full(len(seen), -1, dtype=np.int64)
        columns = np.flatnonzero(seen)
        reach = _FASTEST_M_S / self._rate_hz + _SHAKE_M
        # In its place is who goes on in its column, unless it jumped there.
        off = np.linalg.norm(positions[columns, None] - expected, axis=2)
        row, place = linear_sum_assignment(np.minimum(off, reach))
        near = off[row, place] < reach
        slots[columns[row[near]]] = alive[place[near]]
        return slots

    def _is_due(self) -> bool:
        """Tell whether names are looked for now."""
        if not (self._age >= 0).any():
            return False
        if not self.has_begun:
            return self._since_seek >= _SEEK_S * self._rate_hz
        grown = np.isin(self._age, self._ages).any()
        return bool(grown) or self._since_look >= _EVERY_S * self._rate_hz

    def _look(self) -> None:
        """Look for names, and give those that are sure."""
        fragments = split_fragments(self._places[self._rows], self._rate_hz)
        best = self._best[self._rows]
        start = best[fragments.stop - 1, fragments.column]
        self._since_look = 0
        seeks = self._seeks(fragments, start)
        # What reaches back beyond the window was seen for longer than it shows.
        goes_on = fragments.stop == fragments.n_frames
        age = np.where(goes_on, self._age[fragments.column] + 1, fragments.n_samples)
        answer = label_fragments(
            fragments,
            self._model,
            start=None if seeks else start,
            length_s=np.maximum(age, fragments.n_samples) / self._rate_hz,
            threshold=self._threshold,
            n_turns=1 if self.has_begun else 3,
        )
        self._give(fragments, answer, best)

    def _seeks(self, fragments: Fragments, start: IntArray) -> bool:
        """Tell whether to look for a start: there is none, or something lasts that has no name."""
        if not self.has_begun:
            self._since_seek = 0
            return True
        lost = (self._unseen > _LOST_S * self._rate_hz).any()
        spare = (start == GHOST) & (fragments.n_samples > _LOST_S * self._rate_hz)
        spare &= fragments.stop == fragments.n_frames
        if not (lost and spare.any()):
            self._wait_s = _SEEK_S
            return False
        if self._since_seek < self._wait_s * self._rate_hz:
            return False
        # What is no marker may last: it is looked at more and more seldom.
        self._since_seek, self._wait_s = 0, min(2 * self._wait_s, _SELDOM_S)
        return True

    def _give(self, fragments: Fragments, answer: Assignment, best: IntArray) -> None:
        for k in range(fragments.n_fragments):
            column = fragments.column[k]
            best[fragments.start[k] : fragments.stop[k], column] = answer.best[k]
            if fragments.stop[k] < fragments.n_frames:
                continue
            marker, confidence = answer.best[k], answer.confidence[k]
            stays = marker == self._given[column] and confidence >= _KEPT
            is_sure = marker != GHOST and (confidence >= self._threshold or stays)
            self._given[column] = marker if is_sure else GHOST
            self._sure[column] = confidence
