"""Objects beside a demonstration: where they are and how they are turned, and the fingers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError
from besman.geometry.gaps import fill_gaps, find_runs
from besman.records import LabelledRecording

FloatArray = npt.NDArray[np.float64]

_FINGERS = ("index", "middle")


class ObjectTrack(NamedTuple):
    """An object over some rows of a recording.

    Attributes
    ----------
    positions : array, shape (T, 3)
        Centroid of its markers, metres, laboratory frame.
    headings : array, shape (T,)
        Of the horizontal direction from its first to its last marker, radians from x, without
        jumps; NaN with one marker.
    """

    positions: FloatArray
    headings: FloatArray


def track_object(
    recording: LabelledRecording,
    bounds: tuple[int, int],
    thing: str,
    markers: Sequence[str],
    longest_gap_s: float,
    name: str,
) -> ObjectTrack:
    """Follow an object.

    Parameters
    ----------
    recording : LabelledRecording
    bounds : pair of int
        Half-open rows.
    thing : str
        Name of the object, for messages.
    markers : sequence of str
        Its markers, all in the recording.
    longest_gap_s : float
        Gaps up to this length are filled, seconds.
    name : str
        Of the demonstration, for messages.

    Raises
    ------
    MappingError
        If a marker is not seen for longer: the object may have left the volume.
    """
    start, stop = bounds
    longest = round(longest_gap_s * recording.rate_hz)
    paths = []
    for marker in markers:
        path = fill_gaps(recording.marker(marker), longest)[0][start:stop]
        lost = find_runs(np.asarray(np.isnan(path).any(axis=1)))
        if len(lost):
            frames = recording.first_frame + start + lost[0]
            raise MappingError(
                f"{name}: {thing}: marker {marker!r} is not seen in frames {frames[0]} to "
                f"{frames[1] - 1}; expected gaps of {longest_gap_s:g} s at most "
                "(select.longest_gap_s): did it leave the volume?"
            )
        paths.append(path)
    centre = np.mean(paths, axis=0)
    headings = np.full(len(centre), np.nan)
    if len(paths) > 1:
        along = paths[-1] - paths[0]
        headings = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    return ObjectTrack(centre, headings)


def measure_opening(
    recording: LabelledRecording, bounds: tuple[int, int], prefix: str
) -> FloatArray:
    """Measure how far the fingers are open.

    Parameters
    ----------
    recording : LabelledRecording
    bounds : pair of int
        Half-open rows.
    prefix : str
        What the names of the hand's markers begin with: "", ``right_`` or ``left_``.

    Returns
    -------
    array, shape (T,)
        Distance from the thumb to the mean of the other fingers, metres; NaN where not seen.
    """
    start, stop = bounds
    fingers = finger_names(recording, prefix)
    thumb = f"{prefix}thumb"
    if not fingers:
        return np.full(stop - start, np.nan)
    tips = np.mean([recording.marker(name)[start:stop] for name in fingers], axis=0)
    return np.asarray(np.linalg.norm(tips - recording.marker(thumb)[start:stop], axis=1))


def finger_names(recording: LabelledRecording, prefix: str) -> list[str]:
    """Return the markers of the fingers beside the thumb; none if there is no thumb."""
    if f"{prefix}thumb" not in recording.markers:
        return []
    return [prefix + name for name in _FINGERS if prefix + name in recording.markers]
