"""The samples of a recording, put together by what was decided of its fragments."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import BoolArray
from besman.person.marker_set import MarkerSet
from besman.records import Recording
from besman.stages.label.named_recording import NameDecision

FloatArray = npt.NDArray[np.float64]


def found_markers(decisions: Sequence[NameDecision], marker_set: MarkerSet) -> tuple[str, ...]:
    """Return the markers that a name was given for, in the order of the set."""
    named = {decision.marker for decision in decisions if decision.named}
    return tuple(marker for marker in marker_set.markers if marker in named)


def gather_markers(
    recording: Recording, decisions: Sequence[NameDecision], markers: Sequence[str]
) -> FloatArray:
    """Return where the markers were seen.

    Parameters
    ----------
    recording : Recording
    decisions : sequence of NameDecision
        Of its fragments.
    markers : sequence of str, length M

    Returns
    -------
    array, shape (T, M, 3)
        Metres; NaN where not seen.
    """
    positions = np.full((len(recording.time), len(markers), 3), np.nan)
    _put_markers(positions, recording, decisions, markers)
    return positions


class NamedPaths(Mapping[str, FloatArray]):
    """The paths of markers, each put together when it is asked for, and kept.

    Parameters
    ----------
    recording : Recording
    decisions : sequence of NameDecision
        Of its fragments.
    markers : sequence of str
        Those that there are.
    """

    def __init__(
        self, recording: Recording, decisions: Sequence[NameDecision], markers: Sequence[str]
    ) -> None:
        self._recording, self._markers = recording, tuple(markers)
        self._decisions = decisions
        self._kept: dict[str, FloatArray] = {}

    def __getitem__(self, marker: str) -> FloatArray:
        if marker not in self._markers:
            raise KeyError(marker)
        if marker not in self._kept:
            own = [one for one in self._decisions if one.marker == marker]
            self._kept[marker] = gather_markers(self._recording, own, (marker,))[:, 0]
        return self._kept[marker]

    def __iter__(self) -> Iterator[str]:
        return iter(self._markers)

    def __len__(self) -> int:
        return len(self._markers)


class LeftOver:
    """What is left of trajectories besides what got a name, as they are called.

    Parameters
    ----------
    recording : Recording
    decisions : sequence of NameDecision
        Of its fragments.

    Attributes
    ----------
    columns : tuple of int, length K
        Those trajectories of the recording that have samples left, whole or not.
    names : tuple of (str or None), length K
        How these are called.
    """

    def __init__(self, recording: Recording, decisions: Sequence[NameDecision]) -> None:
        self._positions = recording.positions
        self.columns = tuple(
            column
            for column in range(len(recording.names))
            if _has_rest(recording, column, decisions)
        )
        self.names = tuple(recording.names[column] for column in self.columns)
        self._kept = np.array(self.columns, dtype=np.int64)
        places = {column: k for k, column in enumerate(self.columns)}
        taken = [
            (one.start, one.stop, places[one.trajectory])
            for one in decisions
            if one.named and one.trajectory in places
        ]
        self._taken = np.array(taken, dtype=np.int64).reshape(-1, 3)

    def rows(self, start: int, stop: int) -> FloatArray:
        """Return some of the frames, shape (stop - start, K, 3), metres; NaN where not seen."""
        some = np.take(self._positions[start:stop], self._kept, axis=1)
        first, last, _ = self._taken.T
        for begin, end, column in self._taken[(first < stop) & (last > start)].tolist():
            some[max(0, begin - start) : end - start, column] = np.nan
        return some


def _put_markers(
    positions: FloatArray,
    recording: Recording,
    decisions: Sequence[NameDecision],
    markers: Sequence[str],
) -> None:
    """Copy what has a name into the first columns."""
    place = {marker: k for k, marker in enumerate(markers)}
    for one in decisions:
        if one.named:
            rows = slice(one.start, one.stop)
            positions[rows, place[one.marker]] = recording.positions[rows, one.trajectory]


def _has_rest(recording: Recording, column: int, decisions: Sequence[NameDecision]) -> bool:
    """Tell whether a trajectory has a sample, whole or not, that got no name."""
    x, y, z = np.isfinite(recording.positions[:, column]).T
    seen: BoolArray = np.asarray(x | y | z)
    for one in decisions:
        if one.named and one.trajectory == column:
            seen[one.start : one.stop] = False
    return bool(seen.any())
