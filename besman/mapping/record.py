"""Record mapping: the movement of the hand in the person's own frame, and where a throw ended.

References
----------
L. Gutzeit: From human movement recordings to robot behavior, thesis, sections 7.1 and 7.2.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.signal import butter, savgol_filter, sosfiltfilt

from besman.bodies import Arm, find_body
from besman.exceptions import MappingError, RecognitionError
from besman.frames import (
    back_frame,
    hand_frame,
    quaternion_to_rotation,
    rotation_to_quaternion,
)
from besman.manual_segments import Side
from besman.records import HandTrajectory, LabelledRecording, LabelledSegments

FloatArray = npt.NDArray[np.float64]

GRAVITY = 9.81  # m/s^2
_BACK = ("back_top", "back_left", "back_right")
_HAND = ("hand_top", "hand_left", "hand_right")
# Where orientations were measured, they are filtered as three markers around the hand.
_REACH_M = 0.03
# Beside the segment the filter sees this much of the recording, so that its ends do not bend.
_FILTER_MARGIN_S = 1.0
_ACCELERATION_WINDOW_S = 0.09
_ACCELERATION_TOLERANCE = 3.0  # m/s^2 from free fall, above the noise of markers
_LEAST_FLIGHT_S = 0.06
_LATEST_RELEASE_S = 0.3
_LONGEST_FLIGHT_S = 2.0


@dataclass(frozen=True)
class Selected:
    """One demonstration inside a recording.

    Attributes
    ----------
    recording : int
        Index of the recording.
    segment : int
        Index of its (first) segment.
    start, stop : int
        Half-open rows of the recording.
    """

    recording: int
    segment: int
    start: int
    stop: int


def select_segments(
    segments: tuple[LabelledSegments, ...],
    label: str,
    *,
    merge: bool = False,
    least_duration_s: float = 0.0,
    greatest_duration_s: float = np.inf,
) -> tuple[Selected, ...]:
    """Pick the segments of one class.

    Parameters
    ----------
    segments : tuple of LabelledSegments
        One per recording.
    label : str
        The class.
    merge : bool
        Join segments of the class that touch: a movement that was cut in two.
    least_duration_s, greatest_duration_s : float
        Shorter and longer ones are left out, seconds.

    Returns
    -------
    tuple of Selected
        In the order of the recordings.

    Raises
    ------
    MappingError
        If no segment has the label.
    """
    if not any(label in part.labels for part in segments):
        names = sorted({name for part in segments for name in part.labels})
        raise MappingError(
            f"select: no segment is labelled {label!r}; labels: {', '.join(names) or 'none'}"
        )
    found = []
    for index, part in enumerate(segments):
        chosen = [
            Selected(index, number, int(start), int(stop))
            for number, ((start, stop), name) in enumerate(
                zip(part.bounds, part.labels, strict=True)
            )
            if name == label
        ]
        for item in _merge(chosen) if merge else chosen:
            duration = (item.stop - item.start) / part.rate_hz
            if least_duration_s <= duration <= greatest_duration_s:
                found.append(item)
    return tuple(found)


def _merge(chosen: list[Selected]) -> list[Selected]:
    """Join segments that follow each other without a gap."""
    merged: list[Selected] = []
    for item in sorted(chosen, key=lambda one: one.start):
        if merged and item.start <= merged[-1].stop + 1:
            last = merged.pop()
            item = Selected(last.recording, last.segment, last.start, max(last.stop, item.stop))
        merged.append(item)
    return merged


def map_record(
    recording: LabelledRecording,
    bounds: tuple[int, int],
    label: str,
    *,
    name: str,
    cutoff_hz: float = 10.0,
    rate_hz: float = 100.0,
    thrown: str | None = None,
    side: Side = "right",
) -> HandTrajectory:
    """Take the hand's movement out of a recording, in the person's back frame.

    The back frame is the one at the first sample and stands still. Start and end of the movement
    need not be at rest.

    Parameters
    ----------
    recording : LabelledRecording
        With the markers of back and hand, or the segments of a sensor suit or links of an
        exoskeleton with their orientations; see `besman.bodies.find_body`.
    bounds : pair of int
        Half-open rows of the segment.
    label : str
        Its class.
    name : str
        Name of the demonstration.
    cutoff_hz : float
        Of the low-pass filter (Butterworth, fourth order, forwards and backwards).
    rate_hz : float
        Samples per second of the result, at least.
    thrown : str, optional
        Marker of an object that is thrown; its touchdown becomes the target.
    side : "right" or "left"
        The arm.

    Returns
    -------
    HandTrajectory

    Raises
    ------
    MappingError
        If the segment is shorter than three samples or reaches beyond the recording, a marker is
        not there or not seen, or nothing tells how the hand is turned.
    """
    start, stop = bounds
    if not 0 <= start < stop <= len(recording.time) or stop - start < 3:
        raise MappingError(
            f"{name}: segment {start} to {stop}: expected at least three rows within "
            f"0 to {len(recording.time)}"
        )
    margin = int(_FILTER_MARGIN_S * recording.rate_hz)
    low, high = max(start - margin, 0), min(stop + margin, len(recording.time))
    markers = _smooth(_body_points(recording, side, low, high, name), recording, cutoff_hz)
    rotation, origin = back_frame(*markers[start - low, :3])
    duration = float(recording.time[stop - 1] - recording.time[start])
    n_samples = max(int(np.ceil(duration * rate_hz - 1e-9)) + 1, 3)
    time = np.linspace(0.0, duration, n_samples)
    spline = CubicSpline(recording.time[low:high] - recording.time[start], markers[:, 3:])
    local = (spline(time) - origin) @ rotation
    hand2back, position = hand_frame(local[:, 0], local[:, 1], local[:, 2])
    target = np.full(3, np.nan)
    if thrown is not None:
        target = (object_touchdown(recording, bounds, thrown) - origin) @ rotation
    poses = np.hstack([position, rotation_to_quaternion(hand2back)])
    return HandTrajectory(time=time, poses=poses, name=name, label=label, target=target)


def _body_points(
    recording: LabelledRecording, side: Side, low: int, high: int, name: str
) -> FloatArray:
    """Return three points on the back and three on the hand, shape (T, 6, 3), metres."""
    if _BACK[0] in recording.markers:
        prefix = "left_" if side == "left" else ""
        if side == "right" and "right_hand_top" in recording.markers:
            prefix = "right_"
        return _seen(recording, _BACK + tuple(prefix + one for one in _HAND), low, high, name)
    try:
        body = find_body(recording.markers, recording.source)
    except RecognitionError as error:
        raise MappingError(f"{name}: {error}") from None
    arm = next((one for one in body.arms if one.side == side), None)
    if arm is None:
        raise MappingError(
            f"{name}: the {side} arm is not complete; got {', '.join(recording.markers)}"
        )
    points = _seen(recording, (*body.back, arm.hand), low, high, name)
    return np.concatenate([points[:, :3], _turned_points(recording, arm, low, high, name)], axis=1)


def _turned_points(
    recording: LabelledRecording, arm: Arm, low: int, high: int, name: str
) -> FloatArray:
    """Return three points around a hand whose orientation was measured, shape (T, 3, 3)."""
    if recording.orientations is None:
        raise MappingError(
            f"{name}: nothing tells how {arm.hand} is turned; expected its orientation or the "
            "markers hand_top, hand_left and hand_right"
        )
    column = recording.markers.index(arm.hand)
    hand2lab = arm.turn(quaternion_to_rotation(recording.orientations[low:high, column]))
    # Top, left and right of `hand_frame`, with the hand as their centroid.
    offsets = _REACH_M * np.array([[2.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
    around: FloatArray = np.einsum("tij,kj->tki", hand2lab, offsets)
    return recording.positions[low:high, [column]] + around


def _seen(
    recording: LabelledRecording, names: tuple[str, ...], low: int, high: int, demonstration: str
) -> FloatArray:
    """Return markers (T, M, 3) of some rows; every one of them must have been seen."""
    for name in names:
        if name not in recording.markers:
            raise MappingError(f"{demonstration}: the recording has no marker {name!r}")
    chosen = [recording.markers.index(name) for name in names]
    positions = recording.positions[low:high, chosen]
    hidden = np.argwhere(~np.isfinite(positions).all(axis=2))
    if len(hidden):
        row, marker = hidden[0]
        raise MappingError(
            f"{demonstration}: marker {names[marker]!r} is not seen in frame "
            f"{recording.first_frame + low + row}"
        )
    return positions


def _smooth(positions: FloatArray, recording: LabelledRecording, cutoff_hz: float) -> FloatArray:
    """Low-pass without delay; nothing to do if the cutoff is above what the rate can carry."""
    if cutoff_hz >= 0.45 * recording.rate_hz:
        return positions
    sections = butter(2, cutoff_hz, fs=recording.rate_hz, output="sos")
    padding = min(len(positions) - 1, int(3 * recording.rate_hz / cutoff_hz))
    smooth: FloatArray = sosfiltfilt(sections, positions, axis=0, padlen=padding)
    return smooth


def object_touchdown(
    recording: LabelledRecording, bounds: tuple[int, int], marker: str
) -> FloatArray:
    """Extrapolate the free flight of a thrown object to the floor.

    The flight is the longest stretch from the segment on in which the marker accelerates like a
    falling body; the parabola through it has gravity as its only acceleration.

    Parameters
    ----------
    recording : LabelledRecording
        With hand markers and the object's.
    bounds : pair of int
        Half-open rows of the throw; the object leaves the hand at the latest 0.3 s later.
    marker : str
        The object's marker.

    Returns
    -------
    array, shape (3,)
        Touchdown on z = 0 in the laboratory frame, metres; NaN if no flight was seen.

    Raises
    ------
    MappingError
        If the recording has no such marker.
    """
    if marker not in recording.markers:
        raise MappingError(
            f"{recording.source}: the recording has no marker {marker!r} of a thrown object; "
            f"markers: {', '.join(recording.markers)}"
        )
    last = min(len(recording.time), bounds[1] + int(_LONGEST_FLIGHT_S * recording.rate_hz))
    rows = np.arange(bounds[0], last)
    path = recording.marker(marker)[rows]
    flight = _flight(path, recording.rate_hz, bounds[1] - bounds[0])
    if flight is None:
        return np.full(3, np.nan)
    return _fall(recording.time[rows[flight]], path[flight])


def _flight(path: FloatArray, rate_hz: float, n_throw: int) -> slice | None:
    """Find the longest run of samples in free fall that begins with the throw or shortly after."""
    window = max(round(_ACCELERATION_WINDOW_S * rate_hz) | 1, 5)
    if len(path) < window:
        return None
    acceleration = savgol_filter(
        path, window, 2, deriv=2, delta=1.0 / rate_hz, axis=0, mode="constant", cval=np.nan
    )
    acceleration[:, 2] += GRAVITY
    # NaN, where the object or its past was not seen, compares false.
    falling = np.linalg.norm(acceleration, axis=1) < _ACCELERATION_TOLERANCE
    edges = np.diff(np.concatenate([[0], falling.astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    latest = n_throw + _LATEST_RELEASE_S * rate_hz
    usable = (stops - starts >= _LEAST_FLIGHT_S * rate_hz) & (starts <= latest)
    if not usable.any():
        return None
    longest = int(np.argmax(np.where(usable, stops - starts, 0)))
    return slice(int(starts[longest]), int(stops[longest]))


def _fall(time: FloatArray, path: FloatArray) -> FloatArray:
    """Fit a parabola under gravity and follow it to z = 0."""
    since = time - time[0]
    basis = np.stack([np.ones_like(since), since], axis=1)
    fallen = path + np.outer(since**2, [0.0, 0.0, GRAVITY / 2])
    (start, velocity), *_ = np.linalg.lstsq(basis, fallen, rcond=None)
    below = velocity[2] ** 2 + 2 * GRAVITY * start[2]
    if below < 0.0:
        return np.full(3, np.nan)
    landing = (velocity[2] + np.sqrt(below)) / GRAVITY
    touchdown: FloatArray = start + landing * velocity
    touchdown[2] = 0.0
    return touchdown
