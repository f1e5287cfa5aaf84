"""Segments of a recording, resampled and brought into the person's frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError, RecognitionError, nearest
from besman.geometry.frames import back_frame, quaternion_to_rotation
from besman.person.body import Arm, find_body
from besman.records import LabelledRecording
from besman.stages.recognize.splines import resample_segments

FloatArray = npt.NDArray[np.float64]
Bounds = npt.NDArray[np.int64]

BACK_MARKERS = ("back_top", "back_left", "back_right")


class Stretch(NamedTuple):
    """Segments of one recording, resampled to the same number of points.

    Attributes
    ----------
    paths : dict of array, shape (S, P, 3)
        Path of each marker in the back frame at the first sample of its segment, metres.
    step_s : array, shape (S,)
        Time between two points, seconds.
    arms : tuple of Arm
        Arms that are looked at.
    hand_axes : tuple of array, shape (S, P, 6)
        For each arm of a sensor suit that reports orientations, first and third axis of the hand.
    back : three str
        Middle, left and right of the back.
    """

    paths: dict[str, FloatArray]
    step_s: FloatArray
    arms: tuple[Arm, ...] = ()
    hand_axes: tuple[FloatArray, ...] = ()
    back: tuple[str, str, str] = BACK_MARKERS

    def rate(self, values: FloatArray) -> FloatArray:
        """Return the derivative with respect to time of values, shape (S, P, ...)."""
        step = self.step_s.reshape(-1, *[1] * (values.ndim - 1))
        return np.gradient(values, axis=1) / step

    def speed(self, path: FloatArray) -> FloatArray:
        """Return the speed along a path, shape (S, P, 1), metres per second."""
        speed: FloatArray = np.linalg.norm(self.rate(path), axis=2, keepdims=True)
        return speed

    def object_path(self, objects: Sequence[str]) -> FloatArray:
        """Return the centroid of an object's markers, shape (S, P, 3)."""
        centroid: FloatArray = np.mean([self.paths[name] for name in objects], axis=0)
        return centroid


def cut_stretch(
    recording: LabelledRecording,
    bounds: npt.ArrayLike,
    names: Sequence[str],
    hands: Sequence[Arm],
    n_points: int,
) -> Stretch:
    """Cut segments out of a recording, interpolate them and bring them into the back frame.

    Parameters
    ----------
    recording : LabelledRecording
    bounds : int array, shape (S, 2)
        Half-open rows of the segments.
    names : sequence of str
        Markers that are wanted besides the back.
    hands : sequence of Arm
        Arms whose hand's orientation is wanted.
    n_points : int
        Points per segment.

    Returns
    -------
    Stretch
        Without arms.

    Raises
    ------
    RecognitionError
        If a marker is unknown or was not seen in a segment, or a segment is shorter than two
        samples or not inside the recording.
    """
    rows = _check_bounds(recording, bounds)
    body = find_body(recording.markers, recording.source)
    clusters = [name for arm in hands for name in arm.cluster]
    wanted = tuple(dict.fromkeys((*body.back, *names, *clusters)))
    missing = [name for name in wanted if name not in recording.markers]
    if missing:
        raise RecognitionError(
            f"{recording.source}: no marker {missing[0]!r}; "
            f"{nearest(missing[0], recording.markers)}"
        )
    positions = recording.positions[:, [recording.markers.index(name) for name in wanted]]
    _check_seen(positions, rows, recording, wanted)
    n_samples, n_wanted = positions.shape[:2]
    axes = _hand_axes(recording, hands)
    values = np.concatenate([positions.reshape(n_samples, -1), axes], axis=1)
    points, step_s = resample_segments(recording.time, values, rows, n_points)
    back = positions[rows[:, 0]][:, [wanted.index(name) for name in body.back]]
    rotation, origin = _back_frames(back, rows, recording.source)
    vectors = points.reshape(len(rows), n_points, values.shape[1] // 3, 3)
    vectors[:, :, :n_wanted] -= origin[:, np.newaxis, np.newaxis]
    vectors = vectors @ rotation[:, np.newaxis]
    paths = {name: vectors[:, :, k] for k, name in enumerate(wanted)}
    turned = vectors[:, :, n_wanted:].reshape(len(rows), n_points, axes.shape[1] // 6, 6)
    hand_axes = tuple(turned[:, :, k] for k in range(turned.shape[2]))
    return Stretch(paths, step_s, hand_axes=hand_axes, back=body.back)


def _back_frames(back: FloatArray, rows: Bounds, source: str) -> tuple[FloatArray, FloatArray]:
    """Return the back frame of each segment, out of its markers, shape (S, 3, 3)."""
    across = np.linalg.norm((back[:, 1] - back[:, 2])[:, :2], axis=1)
    # The worst first, so that a message names the row.
    for markers, row in zip(back[across.argsort()[:1]], rows[across.argsort()[:1], 0], strict=True):
        try:
            back_frame(*markers)
        except LabellingError as error:
            raise RecognitionError(f"{source}: row {row}: {error}") from None
    return back_frame(back[:, 0], back[:, 1], back[:, 2])


def _hand_axes(recording: LabelledRecording, hands: Sequence[Arm]) -> FloatArray:
    """Return first and third axis of each hand without markers, shape (T, 6 * n), laboratory."""
    measured = [arm for arm in hands if not arm.cluster]
    if not measured:
        return np.empty((len(recording.time), 0))
    if recording.orientations is None:
        raise RecognitionError(
            f"{recording.source}: hand_orientation needs {measured[0].hand}'s orientation or three "
            "markers on the hand, got neither"
        )
    columns = [recording.markers.index(arm.hand) for arm in measured]
    measured_axes = quaternion_to_rotation(recording.orientations[:, columns])
    rotation = np.stack([arm.turn(measured_axes[:, k]) for k, arm in enumerate(measured)], axis=1)
    axes = np.concatenate([rotation[..., 0], rotation[..., 2]], axis=2)
    return axes.reshape(len(axes), -1)


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


def _check_seen(
    positions: FloatArray, rows: Bounds, recording: LabelledRecording, names: tuple[str, ...]
) -> None:
    """Refuse gaps inside segments; positions have shape (T, M, 3)."""
    unseen = np.isnan(positions).any(axis=2)
    if not unseen.any():
        return
    for start, end in rows:
        gaps = np.argwhere(np.asarray(unseen)[start:end])
        if len(gaps):
            row, column = gaps[0]
            raise RecognitionError(
                f"{recording.source}: marker {names[column]!r} was not seen in frame "
                f"{recording.first_frame + start + row}; expected no gaps inside a segment"
            )
