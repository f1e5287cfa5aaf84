"""Frames of a stream as those of a marker set; and whether they are what they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from besman.exceptions import RecordingError
from besman.following.plans import label_by_names
from besman.geometry.up_axis import find_up_axis
from besman.live.stream import StreamFormat
from besman.person.marker_set import MarkerSet
from besman.person.mirror import mirror_positions
from besman.records import FloatArray, LabelledRecording, Recording

# Markers of a person, farthest from each other, metres; what is beyond is in another unit.
_EXTENT_M = (0.1, 8.0)
_FARTHEST_MEDIAN_M = 100.0
_SURE = 0.95
_AXIS_AFTER_S = 1.0
# Correlations of the heights of markers with those of an earlier recording: as good as the same,
# and not the same whatever the person does.
_ALIKE, _UNLIKE = 0.98, 0.9
_LEAST_MARKERS = 5


class StreamLabels:
    """Gives the markers of every frame the names of a marker set, by the names of the stream.

    Parameters
    ----------
    stream : StreamFormat
    marker_set : MarkerSet

    Attributes
    ----------
    blank : LabelledRecording
        One frame: what a follower has to expect.
    required : int array, shape (R,)
        Columns of the stream that hold the required markers.

    Raises
    ------
    BesmanError
        If a required marker is not among the names.
    """

    def __init__(self, stream: StreamFormat, marker_set: MarkerSet) -> None:
        still = np.zeros((1, len(stream.names), 3))
        self._recording = Recording(np.zeros(1), still, stream.names, stream.rate_hz, stream.source)
        self.blank = label_by_names(self._recording, marker_set)
        found = marker_set.match(stream.names, stream.source)
        self._marker_set = marker_set
        self._columns = np.array(list(found.values()), dtype=np.int64)
        self._required = marker_set.required
        self.required = np.array([found[name] for name in marker_set.required], dtype=np.int64)

    def find_unseen(self, positions: FloatArray) -> str | None:
        """Return a required marker that a frame does not show; None if it shows all."""
        unseen = np.flatnonzero(~np.isfinite(positions[self.required]).all(axis=1))
        return self._required[int(unseen[0])] if len(unseen) else None

    def label(self, positions: FloatArray) -> FloatArray:
        """Return the markers of the set in one frame, shape (M', 3), metres."""
        if self._marker_set.frames is not None:
            one = replace(self._recording, positions=positions[np.newaxis])
            whole: FloatArray = label_by_names(one, self._marker_set).positions[0]
            return whole
        labelled: FloatArray = positions[self._columns]
        return mirror_positions(labelled) if self._marker_set.side == "left" else labelled


class StreamChecks:
    """Looks whether a stream is a person in metres with z up.

    Parameters
    ----------
    stream : StreamFormat
    labels : StreamLabels
        Of it.
    earlier : LabelledRecording, optional
        An earlier movement of such a person, z up: markers that were high are so again.
    """

    def __init__(
        self,
        stream: StreamFormat,
        labels: StreamLabels,
        earlier: LabelledRecording | None = None,
    ) -> None:
        self._stream, self._labels, self._earlier = stream, labels, earlier
        self._first: list[FloatArray] | None = []

    def look_at(self, positions: FloatArray) -> None:
        """Look at the next frame, shape (M, 3).

        Raises
        ------
        RecordingError
            At the first frame, if its size is that of another unit; after a second, if another axis
            surely points up.
        """
        if self._first is None:
            return
        if not self._first:
            self._check_extent(positions)
        self._first.append(positions)
        if len(self._first) > _AXIS_AFTER_S * self._stream.rate_hz:
            self._check_axis(np.array(self._first))
            self._first = None

    def check_distances(self, positions: FloatArray) -> None:
        """Look at a frame as it came, shape (M, 3), before any was given on.

        Raises
        ------
        RecordingError
            If half of the required markers are farther away than any camera sees.
        """
        distances = np.abs(positions[self._labels.required])
        known = distances[~np.isnan(distances)]
        if (
            known.size
            and np.partition(known, known.size // 2)[known.size // 2] > _FARTHEST_MEDIAN_M
        ):
            raise RecordingError(
                f"{self._stream.source}: half of the coordinates of the required markers are "
                f"beyond {_FARTHEST_MEDIAN_M:g} m: is the stream in another unit than it says? "
                "--units tells what it is in"
            )

    def _check_extent(self, positions: FloatArray) -> None:
        extent = float(np.linalg.norm(np.ptp(positions[self._labels.required], axis=0)))
        if not _EXTENT_M[0] <= extent <= _EXTENT_M[1]:
            raise RecordingError(
                f"{self._stream.source}: the required markers are {extent:.4g} m apart; expected "
                f"{_EXTENT_M[0]:g} to {_EXTENT_M[1]:g} m: is the stream in another unit than it "
                "says? --units tells what it is in"
            )

    def _check_axis(self, frames: FloatArray) -> None:
        found = find_up_axis(frames, self._stream.names, self._stream.rate_hz)
        axis: str | None = found.axis if found.confidence >= _SURE else None
        why = found.told_by
        if axis is None and self._earlier is not None:
            axis, why = self._compare(frames, self._earlier), "the earlier recordings"
        if axis not in (None, "z"):
            raise RecordingError(
                f"{self._stream.source}: {axis} points up, as {why} tell; expected z: --up tells a "
                "stream's axis"
            )

    def _compare(self, frames: FloatArray, earlier: LabelledRecording) -> str | None:
        """Return the axis along which markers are as high as they were; None if none is."""
        names = self._labels.blank.markers
        shared = [name for name in names if name in earlier.markers]
        if len(shared) < _LEAST_MARKERS:
            return None
        n = int(_AXIS_AFTER_S * earlier.rate_hz)
        columns = [earlier.markers.index(name) for name in shared]
        heights = _middle(earlier.positions[:n, columns, 2])
        now = np.array([self._labels.label(frame) for frame in frames])
        places = _middle(now[:, [names.index(name) for name in shared]])
        known = np.isfinite(heights) & np.isfinite(places).all(axis=1)
        if known.sum() < _LEAST_MARKERS:
            return None
        alike = [float(np.corrcoef(heights[known], axis)[0, 1]) for axis in places[known].T]
        best = int(np.argmax(np.abs(alike)))
        if abs(alike[best]) < _ALIKE or alike[2] > _UNLIKE:
            return None
        return ("" if alike[best] > 0 else "-") + "xyz"[best]


def _middle(values: FloatArray) -> FloatArray:
    """Return the mean over time; NaN where a marker was never seen."""
    seen = np.isfinite(values)
    total: FloatArray = np.where(seen, values, 0.0).sum(axis=0)
    return np.where(seen.any(axis=0), total / np.maximum(seen.sum(axis=0), 1), np.nan)
