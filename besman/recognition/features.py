"""Features of movement segments, relative to the person."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError, RecognitionError, nearest
from besman.frames import back_frame, hand_frame
from besman.records import LabelledRecording

FloatArray = npt.NDArray[np.float64]
Bounds = npt.NDArray[np.int64]

BACK_MARKERS = ("back_top", "back_left", "back_right")
HAND_MARKERS = ("hand_top", "hand_left", "hand_right")
BODY_MARKERS = (*BACK_MARKERS, *HAND_MARKERS, "shoulder", "elbow", "thumb", "index", "middle")
"""Markers on the person; any other marker of a recording is on an object."""


class Stretch(NamedTuple):
    """Segments of one recording, resampled to the same number of points.

    Attributes
    ----------
    paths : dict of array, shape (S, P, 3)
        Path of each marker in the back frame at the first sample of its segment, metres.
    step_s : array, shape (S,)
        Time between two points, seconds.
    """

    paths: dict[str, FloatArray]
    step_s: FloatArray

    def rate(self, values: FloatArray) -> FloatArray:
        """Return the derivative with respect to time of values, shape (S, P, ...)."""
        step = self.step_s.reshape(-1, *[1] * (values.ndim - 1))
        return np.gradient(values, axis=1) / step

    def object_path(self, objects: Sequence[str]) -> FloatArray:
        """Return the centroid of an object's markers, shape (S, P, 3)."""
        return np.mean([self.paths[name] for name in objects], axis=0)


Feature = Callable[[Stretch, Sequence[str], Sequence[str]], FloatArray]
"""From stretch, markers and object markers to channels, shape (S, P, C)."""


def _positions(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    return np.concatenate([stretch.paths[name] for name in markers], axis=2)


def _speeds(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    speeds = [np.linalg.norm(stretch.rate(stretch.paths[name]), axis=2) for name in markers]
    return np.stack(speeds, axis=2)


def _hand_orientation(
    stretch: Stretch, markers: Sequence[str], objects: Sequence[str]
) -> FloatArray:
    # Two axes of the rotation matrix: unlike angles and quaternions they never jump.
    rotation, _ = hand_frame(*(stretch.paths[name] for name in HAND_MARKERS))
    return np.concatenate([rotation[..., 0], rotation[..., 2]], axis=2)


def _elbow_angle(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    elbow = stretch.paths["elbow"]
    return _angle(stretch.paths["shoulder"] - elbow, stretch.paths["hand_top"] - elbow)


def _elbow_rate(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    return stretch.rate(_elbow_angle(stretch, markers, objects))


def _shoulder_angle(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    top, left, right = (stretch.paths[name] for name in BACK_MARKERS)
    return _angle((left + right) / 2 - top, stretch.paths["elbow"] - stretch.paths["shoulder"])


def _shoulder_rate(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    return stretch.rate(_shoulder_angle(stretch, markers, objects))


def _object_distance(
    stretch: Stretch, markers: Sequence[str], objects: Sequence[str]
) -> FloatArray:
    apart = stretch.object_path(objects) - stretch.paths["hand_top"]
    return np.linalg.norm(apart, axis=2, keepdims=True)


def _object_speed(stretch: Stretch, markers: Sequence[str], objects: Sequence[str]) -> FloatArray:
    velocity = stretch.rate(stretch.object_path(objects))
    return np.linalg.norm(velocity, axis=2, keepdims=True)


def _angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle between vectors, radians, shape (S, P, 1)."""
    sine = np.linalg.norm(np.cross(a, b), axis=2, keepdims=True)
    return np.arctan2(sine, np.sum(a * b, axis=2, keepdims=True))


_FEATURES: dict[str, tuple[Feature, tuple[str, ...]]] = {
    "positions": (_positions, ()),
    "speeds": (_speeds, ()),
    "hand_orientation": (_hand_orientation, HAND_MARKERS),
    "elbow_angle": (_elbow_angle, ("shoulder", "elbow", "hand_top")),
    "elbow_rate": (_elbow_rate, ("shoulder", "elbow", "hand_top")),
    "shoulder_angle": (_shoulder_angle, ("shoulder", "elbow")),
    "shoulder_rate": (_shoulder_rate, ("shoulder", "elbow")),
    "object_distance": (_object_distance, ("hand_top",)),
    "object_speed": (_object_speed, ()),
}

FEATURE_NAMES = tuple(_FEATURES)
"""The features of thesis 5.3.2, in its order."""

OBJECT_FEATURES = ("object_distance", "object_speed")


def count_channels(features: Sequence[str], markers: Sequence[str]) -> tuple[int, ...]:
    """Return how many channels each feature has."""
    widths = {"positions": 3 * len(markers), "speeds": len(markers), "hand_orientation": 6}
    return tuple(widths.get(name, 1) for name in features)


def extract_features(
    recording: LabelledRecording,
    bounds: npt.ArrayLike,
    features: Sequence[str],
    markers: Sequence[str],
    objects: Sequence[str] = (),
    n_points: int = 25,
) -> FloatArray:
    """Compute the features of segments of one recording.

    Parameters
    ----------
    recording : LabelledRecording
        The recording; the laboratory frame has z up.
    bounds : int array, shape (S, 2)
        Half-open rows of the segments.
    features : sequence of str
        Names out of `FEATURE_NAMES`.
    markers : sequence of str
        Markers whose positions and speeds are features.
    objects : sequence of str
        Markers on the object, for the features that need it.
    n_points : int
        Points that every segment is interpolated to by a cubic spline.

    Returns
    -------
    array, shape (S, n_points, C)
        Channels of all features in the order given: metres, metres per second, radians, radians
        per second, components of unit vectors.

    Raises
    ------
    RecognitionError
        If a feature or marker is unknown, a marker was not seen in a segment, or a segment is
        shorter than two samples or not inside the recording.

    References
    ----------
    Thesis 5.3.1 and 5.3.2.
    """
    unknown = [name for name in features if name not in _FEATURES]
    if unknown:
        raise RecognitionError(f"no feature {unknown[0]!r}; {nearest(unknown[0], FEATURE_NAMES)}")
    if not objects and set(features) & set(OBJECT_FEATURES):
        raise RecognitionError(
            f"{recording.source}: features {', '.join(OBJECT_FEATURES)} need markers on an object, "
            "got none"
        )
    stretch = _cut(
        recording, _check_bounds(recording, bounds), _needed(features, markers, objects), n_points
    )
    try:
        channels = [_FEATURES[name][0](stretch, markers, objects) for name in features]
    except LabellingError as error:
        raise RecognitionError(f"{recording.source}: {error}") from None
    return np.concatenate(channels, axis=2)


def _needed(
    features: Sequence[str], markers: Sequence[str], objects: Sequence[str]
) -> tuple[str, ...]:
    """Return the markers that features need, each once."""
    needed = [*BACK_MARKERS, *(name for feature in features for name in _FEATURES[feature][1])]
    if {"positions", "speeds"} & set(features):
        needed += markers
    if set(OBJECT_FEATURES) & set(features):
        needed += objects
    return tuple(dict.fromkeys(needed))


def _check_bounds(recording: LabelledRecording, bounds: npt.ArrayLike) -> Bounds:
    """Refuse segments that are too short or not inside the recording."""
    rows = np.asarray(bounds, dtype=np.int64).reshape(-1, 2)
    for start, end in rows:
        if start < 0 or end > len(recording.time) or end - start < 2:
            raise RecognitionError(
                f"{recording.source}: got segment [{start}, {end}); expected at least 2 samples "
                f"inside [0, {len(recording.time)})"
            )
    return rows


def _cut(
    recording: LabelledRecording, bounds: Bounds, names: tuple[str, ...], n_points: int
) -> Stretch:
    """Cut segments out of a recording, interpolate them and bring them into the back frame."""
    from scipy.interpolate import CubicSpline

    missing = [name for name in names if name not in recording.markers]
    if missing:
        raise RecognitionError(
            f"{recording.source}: no marker {missing[0]!r}; "
            f"{nearest(missing[0], recording.markers)}"
        )
    columns = [recording.markers.index(name) for name in names]
    paths = np.empty((len(bounds), n_points, len(names), 3))
    step_s = np.empty(len(bounds))
    for index, (start, end) in enumerate(bounds):
        piece = recording.positions[start:end, columns]
        _check_seen(piece, recording, int(start), names)
        time = recording.time[start:end] - recording.time[start]
        points = np.linspace(0.0, time[-1], n_points)
        step_s[index] = points[1]
        paths[index] = CubicSpline(time, piece)(points)
        try:
            rotation, origin = back_frame(*(piece[0, names.index(name)] for name in BACK_MARKERS))
        except LabellingError as error:
            raise RecognitionError(f"{recording.source}: row {start}: {error}") from None
        paths[index] = (paths[index] - origin) @ rotation
    return Stretch({name: paths[:, :, k] for k, name in enumerate(names)}, step_s)


def _check_seen(
    piece: FloatArray, recording: LabelledRecording, start: int, names: tuple[str, ...]
) -> None:
    """Refuse gaps, piece has shape (n, M, 3)."""
    seen = np.isfinite(piece).all(axis=2)
    if not seen.all():
        row, column = np.argwhere(~seen)[0]
        raise RecognitionError(
            f"{recording.source}: marker {names[column]!r} was not seen in frame "
            f"{recording.first_frame + start + row}; expected no gaps inside a segment"
        )
