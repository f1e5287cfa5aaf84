"""The samples of a recording, put together by what was decided of its fragments."""

from __future__ import annotations

from collections.abc import Sequence

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


def gather_all(
    recording: Recording, decisions: Sequence[NameDecision], markers: Sequence[str]
) -> tuple[FloatArray, tuple[str | None, ...]]:
    """Return the markers, then what is left of the trajectories, as it is called.

    Of an hour one array has hundreds of megabytes, so that no other is made on the way.

    Parameters
    ----------
    recording, decisions, markers
        As of `gather_markers`.

    Returns
    -------
    positions : array, shape (T, M + K, 3)
        Metres; NaN where not seen.
    names : tuple of (str or None), length M + K
    """
    kept = [
        column for column in range(len(recording.names)) if _has_rest(recording, column, decisions)
    ]
    positions = np.empty((len(recording.time), len(markers) + len(kept), 3))
    positions[:, : len(markers)] = np.nan
    _put_markers(positions, recording, decisions, markers)
    places = {column: len(markers) + k for k, column in enumerate(kept)}
    for column, place in places.items():
        positions[:, place] = recording.positions[:, column]
    for one in decisions:
        if one.named and one.trajectory in places:
            positions[one.start : one.stop, places[one.trajectory]] = np.nan
    return positions, (*markers, *(recording.names[column] for column in kept))


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
    seen: BoolArray = np.asarray(np.isfinite(recording.positions[:, column]).any(axis=1))
    for one in decisions:
        if one.named and one.trajectory == column:
            seen[one.start : one.stop] = False
    return bool(seen.any())
