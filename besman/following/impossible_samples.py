"""Samples of a stream that no body makes: gaps, once it is said that there are some."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from besman.geometry.gaps import BoolArray
from besman.geometry.spikes import IMPOSSIBLE_M_S, LONGEST, SMALLEST_M
from besman.records import FloatArray
from besman.records.recordings import FARTHEST_M


class SampleGate:
    """Takes frames; hides what is too far, and what is farther than anything gets in the time.

    A marker that stays where it has jumped to for as long as no spike lasts is there
    (`besman.geometry.spikes`, which sees what comes after; here nothing is waited for).

    Parameters
    ----------
    names : sequence of str or None, length M
    rate_hz : float
    keep_place : bool
        Whether a trajectory is one marker all the time. Of points without names it is not: where
        one has gone another may come, so that only what is too far is hidden.

    Attributes
    ----------
    hidden : int
        Samples that became gaps.
    """

    def __init__(
        self, names: Sequence[str | None], rate_hz: float, keep_place: bool = True
    ) -> None:
        self._names, self._step_m = tuple(names), IMPOSSIBLE_M_S / rate_hz
        self._keep_place = keep_place
        n = len(self._names)
        # Of each marker the place and frame that are believed, those seen last, and for how many
        # frames these have gone on without a jump.
        self._kept, self._seen = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
        self._kept_at, self._seen_at = np.zeros(n), np.zeros(n)
        self._n_alike = np.zeros(n, dtype=np.int64)
        self._row = 0
        self.hidden = 0
        self.first = ""

    def take(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Take a frame, shape (M, 3), metres.

        Returns
        -------
        array, shape (M, 3)
            What can be a recording: NaN where a coordinate is missing or beyond `FARTHEST_M`.
        array, shape (M, 3)
            What a body can do: NaN in jumps as well.
        """
        self._row += 1
        near: BoolArray = np.all(np.abs(positions) <= FARTHEST_M, axis=1)
        known = positions
        if not near.all():
            known = np.where(near[:, None], positions, np.nan)
            self._hide(~near & ~np.isnan(positions).all(axis=1), "no place")
        if not self._keep_place:
            return known, known
        fast: BoolArray = near & self._jumped(self._kept, self._kept_at, known)
        if fast.any():
            again = fast & ~self._jumped(self._seen, self._seen_at, known)
            self._n_alike = np.where(again, self._n_alike + 1, 1)
            fast &= self._n_alike <= LONGEST
            self._hide(fast, "faster than anything that a camera sees")
            self._seen[near], self._seen_at[near] = known[near], self._row
        sure = near & ~fast
        self._kept[sure], self._kept_at[sure], self._n_alike[sure] = known[sure], self._row, 0
        return known, np.where(fast[:, None], np.nan, known) if fast.any() else known

    def _jumped(self, places: FloatArray, rows: FloatArray, now: FloatArray) -> BoolArray:
        """Tell which markers are farther from a place than anything gets."""
        steps = np.linalg.norm(now - places, axis=1)
        return np.asarray(steps > np.maximum(SMALLEST_M, self._step_m * (self._row - rows)))

    def _hide(self, which: BoolArray, why: str) -> None:
        """Count samples that become gaps, and say of the first what it is."""
        count = int(which.sum())
        if count and not self.hidden:
            index = int(np.flatnonzero(which)[0])
            name = self._names[index]
            call = f"trajectory {index + 1}" if name is None else repr(name)
            self.first = f"{call} in frame {self._row} is {why}: such samples are gaps"
        self.hidden += count
