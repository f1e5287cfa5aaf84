"""Record mapping: the movement of the hand in the person's own frame, and where a throw ended.

References
----------
L. Gutzeit: From human movement recordings to robot behavior, thesis, sections 7.1 and 7.2.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError
from besman.geometry.cubic_spline import interpolate_cubic
from besman.geometry.frames import back_frame, hand_frame, rotation_to_quaternion
from besman.records import HandTrajectory, LabelledRecording, LabelledSegments
from besman.records.layers import Side
from besman.stages.select.body_points import BodyPoints, GapLimits, find_body_points
from besman.stages.select.palm import turn_palm_to_push
from besman.stages.select.release import HandPath
from besman.stages.select.targets import Aim, find_target

FloatArray = npt.NDArray[np.float64]

# Beside the segment the filter sees this much of the recording, so that its ends do not bend.
_FILTER_MARGIN_S = 1.0
_USUAL_GAPS = GapLimits()
_NO_AIM = Aim()
# The push is told from the hand's acceleration, in which noise grows with the square of this.
_PUSH_CUTOFF_HZ = 4.0

Palm = Literal["measured", "push"]


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
    *labels: str,
    merge: bool = False,
    least_duration_s: float = 0.0,
    greatest_duration_s: float = np.inf,
) -> tuple[Selected, ...]:
    """Pick the segments of one class, or of several.

    Parameters
    ----------
    segments : tuple of LabelledSegments
        One per recording.
    *labels : str
        The classes.
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
        If no segment has one of the labels.
    """
    names = sorted({name for part in segments for name in part.labels})
    for label in labels:
        if label not in names:
            raise MappingError(
                f"select: no segment is labelled {label!r}; labels: {', '.join(names) or 'none'}"
            )
    found = []
    for (index, part), label in product(enumerate(segments), labels):
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
    aim: Aim = _NO_AIM,
    palm: Palm = "measured",
    side: Side = "right",
    gaps: GapLimits = _USUAL_GAPS,
    grasp: npt.ArrayLike = (np.nan,) * 7,
) -> HandTrajectory:
    """Take the hand's movement out of a recording, in the person's back frame.

    The back frame is the one at the first sample and stands still. Start and end of the movement
    need not be at rest.

    Parameters
    ----------
    recording : LabelledRecording
        With the markers of back and hand, or the segments of a sensor suit or links of an
        exoskeleton with their orientations; see `besman.person.body.find_body`.
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
    aim : Aim
        Where the target comes from.
    palm : "measured" or "push"
        How the hand is turned: as was measured, or with its palm along its push, see
        `besman.stages.select.palm.turn_palm_to_push`.
    side : "right" or "left"
        The arm.
    gaps : GapLimits
        Which gaps are filled.
    grasp : array, shape (7,)
        What the tool centre point is to follow, see `besman.records.HandTrajectory`.

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
    points = find_body_points(
        recording, bounds, side, name=name, margin_s=_FILTER_MARGIN_S, gaps=gaps
    )
    hand = _smooth(points.hand, recording.rate_hz, cutoff_hz)
    rotation, origin = _back_at(points, start, recording.rate_hz, cutoff_hz)
    duration = float(recording.time[stop - 1] - recording.time[start])
    n_samples = max(int(np.ceil(duration * rate_hz - 1e-9)) + 1, 3)
    time = np.linspace(0.0, duration, n_samples)
    rows = slice(points.hand_first, points.hand_first + len(hand))
    seen = recording.time[rows] - recording.time[start]
    between = interpolate_cubic(seen, hand.reshape(len(hand), -1), time)
    local = (between.reshape(-1, *hand.shape[1:]) - origin) @ rotation
    hand2back, position = hand_frame(local[:, 0], local[:, 1], local[:, 2])
    throw = slice(start - points.hand_first, stop - points.hand_first)
    path = HandPath(recording.time[rows], hand.mean(axis=1), throw)
    if palm == "push":
        slow = _smooth(points.hand.mean(axis=1), recording.rate_hz, _PUSH_CUTOFF_HZ)
        pushing = HandPath(path.time, slow, throw)
        at = recording.time[start] + time
        hand2back = rotation.T @ turn_palm_to_push(pushing, rotation[:, 0], at)
    target, target_by = find_target(recording, bounds, path, aim)
    return HandTrajectory(
        time=time,
        poses=np.hstack([position, rotation_to_quaternion(hand2back)]),
        name=name,
        label=label,
        target=(target - origin) @ rotation,
        grasp=np.array(grasp),
        target_by=target_by,
    )


def find_back_frame(
    recording: LabelledRecording,
    bounds: tuple[int, int],
    side: Side,
    name: str,
    cutoff_hz: float,
    gaps: GapLimits,
) -> tuple[FloatArray, FloatArray]:
    """Return the frame that `map_record` gives a movement in.

    Parameters
    ----------
    recording, bounds, side, name, cutoff_hz, gaps
        As of `map_record`.

    Returns
    -------
    back2lab : array, shape (3, 3)
    origin : array, shape (3,)
        Metres, laboratory frame.

    Raises
    ------
    MappingError
        As `map_record`.
    """
    points = find_body_points(
        recording, bounds, side, name=name, margin_s=_FILTER_MARGIN_S, gaps=gaps
    )
    return _back_at(points, bounds[0], recording.rate_hz, cutoff_hz)


def _back_at(
    points: BodyPoints, row: int, rate_hz: float, cutoff_hz: float
) -> tuple[FloatArray, FloatArray]:
    """Return rotation and origin of the back frame at a row of the recording."""
    return back_frame(*_smooth(points.back, rate_hz, cutoff_hz)[row - points.back_first])


def _smooth(positions: FloatArray, rate_hz: float, cutoff_hz: float) -> FloatArray:
    """Low-pass without delay; nothing to do if the cutoff is above what the rate can carry."""
    if cutoff_hz >= 0.45 * rate_hz:
        return positions
    from besman.geometry.low_pass import low_pass

    n_beyond = min(len(positions) - 1, int(3 * rate_hz / cutoff_hz))
    return low_pass(positions, rate_hz, cutoff_hz, n_beyond)
