"""Gaps in a stream of markers: what comes later is not known, so the last sighting is held."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError, nearest

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


class HeldSample(NamedTuple):
    """One sample without short gaps.

    Attributes
    ----------
    values : array, shape (M, D)
        As given; NaN where an optional marker was not seen for long.
    filled : bool array, shape (M,)
        True where a sighting is held.
    lost : bool array, shape (M,)
        True where a marker was not seen for longer than is filled.
    """

    values: FloatArray
    filled: BoolArray
    lost: BoolArray


class GapHolder:
    """Holds the last sighting of every marker.

    A required marker is held for as long as it is not seen, and called lost once that is longer
    than `longest`; an optional one is NaN from then on. Samples at the start wait until every
    required marker was seen, and get its first sighting.

    Parameters
    ----------
    markers : sequence of str, length M
    required : collection of str
        Markers that must be seen within `longest` samples from the start.
    longest : int
        Greatest number of samples of a gap that is filled.
    source : str
        Named in errors.
    width : int
        Values D of a marker in a sample: 3 of a position, 7 of a position and a quaternion.

    Raises
    ------
    LabellingError
        If a required marker is not among the markers.
    """

    def __init__(
        self,
        markers: Sequence[str],
        required: Collection[str],
        longest: int,
        source: str,
        width: int = 3,
    ) -> None:
        for name in sorted(required):
            if name not in markers:
                raise LabellingError(f"{source}: no marker {name!r}; {nearest(name, markers)}")
        self._markers, self._longest, self._source = tuple(markers), longest, source
        self._required = np.array([name in required for name in markers], dtype=bool)
        self._last = np.full((len(self._markers), width), np.nan)
        self._unseen = np.zeros(len(self._markers), dtype=np.int64)
        self._waiting: list[FloatArray] | None = []

    def take(self, values: FloatArray) -> list[HeldSample]:
        """Take one sample, shape (M, D), NaN where a marker is not seen.

        Returns
        -------
        list of HeldSample
            What can be used now: nothing while a required marker was never seen, then all samples
            that waited, then one at a time.

        Raises
        ------
        LabellingError
            If a required marker is not seen at the start for longer than is filled.
        """
        if self._waiting is None:
            return [self._hold(values)]
        self._waiting.append(values)
        never = self._never_seen()
        if never is not None:
            if len(self._waiting) > self._longest:
                raise LabellingError(
                    f"{self._source}: marker {never!r} is not seen in the first "
                    f"{len(self._waiting)} samples; expected it within {self._longest + 1}"
                )
            return []
        early, self._waiting = self._waiting, None
        first = np.stack(early)
        seen: BoolArray = ~np.asarray(np.isnan(first).any(axis=2))
        row = seen.argmax(axis=0)
        self._last = first[row, np.arange(len(row))]
        self._last[~self._required & ~seen[0]] = np.nan
        return [self._hold(sample) for sample in early]

    def check_finished(self) -> None:
        """Refuse an end before every required marker was seen.

        Raises
        ------
        LabellingError
            With the marker.
        """
        if self._waiting is not None:
            what = "no sample" if not self._waiting else f"marker {self._never_seen()!r} unseen"
            raise LabellingError(
                f"{self._source}: ended after {len(self._waiting)} samples: {what}; expected every "
                "required marker to be seen at least once"
            )

    def _never_seen(self) -> str | None:
        """Return a required marker that no waiting sample has."""
        assert self._waiting is not None
        seen = np.zeros(len(self._markers), dtype=bool)
        for sample in self._waiting:
            seen |= ~np.isnan(sample).any(axis=1)
        missing = np.flatnonzero(self._required & ~seen)
        return self._markers[missing[0]] if len(missing) else None

    def _hold(self, values: FloatArray) -> HeldSample:
        gone: BoolArray = np.asarray(np.isnan(values).any(axis=1))
        self._unseen = np.where(gone, self._unseen + 1, 0)
        lost = self._unseen > self._longest
        self._last = np.where(gone[:, np.newaxis], self._last, values)
        self._last[lost & ~self._required] = np.nan
        filled = gone & ~np.isnan(self._last).any(axis=1)
        return HeldSample(self._last.copy(), filled, lost)
