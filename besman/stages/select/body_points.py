"""Three points on a person's back and three on a hand, without gaps where that can be had."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError, RecognitionError
from besman.geometry.frames import quaternion_to_rotation
from besman.geometry.gaps import fill_gaps, find_runs
from besman.geometry.rigid_bodies import fill_cluster
from besman.person.body import Arm, find_body
from besman.records import LabelledRecording
from besman.records.layers import Side

FloatArray = npt.NDArray[np.float64]

_BACK = ("back_top", "back_left", "back_right")
_HAND = ("hand_top", "hand_left", "hand_right")
_PARTS = (slice(0, 3), slice(3, 6))
# Where orientations were measured, they are filtered as three markers around the hand.
_REACH_M = 0.03
# Beside a gap this much of the recording tells a cluster's shape and how its markers move.
_CONTEXT_S = 5.0
_SMALLEST_NORM = 1e-6


@dataclass(frozen=True)
class GapLimits:
    """Which gaps are filled.

    Attributes
    ----------
    spline_s : float
        Up to this length by a spline through the sightings before and after, seconds.
    rigid_s : float
        Up to this length where the other two markers of a cluster are seen, seconds.
    """

    spline_s: float = 0.25
    rigid_s: float = 1.0


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Back and hand around a segment, as far as they are seen without a break.

    Attributes
    ----------
    back : array, shape (B, 3, 3)
        Middle, left and right of the back in the laboratory frame, metres.
    back_first : int
        Row of the recording that the first sample of `back` is.
    hand : array, shape (H, 3, 3)
        Top, left and right of the hand, see `besman.geometry.frames.hand_frame`.
    hand_first : int
        Row of the recording that the first sample of `hand` is.
    """

    back: FloatArray
    back_first: int
    hand: FloatArray
    hand_first: int


def find_body_points(
    recording: LabelledRecording,
    bounds: tuple[int, int],
    side: Side,
    *,
    name: str,
    margin_s: float,
    gaps: GapLimits,
) -> BodyPoints:
    """Find back and hand around a segment.

    Parameters
    ----------
    recording : LabelledRecording
        With the markers of back and hand, or the segments of a sensor suit or links of an
        exoskeleton with their orientations; see `besman.person.body.find_body`.
    bounds : pair of int
        Half-open rows of the segment. The back must be seen in the first of them, the hand in
        all.
    side : "right" or "left"
        The arm.
    name : str
        Of the demonstration, for messages.
    margin_s : float
        How much more to take on each side where it is seen, seconds.
    gaps : GapLimits
        Which gaps are filled.

    Returns
    -------
    BodyPoints

    Raises
    ------
    MappingError
        If a marker is not there, has a gap that is too long, or nothing tells how the hand is
        turned.
    """
    start, stop = bounds
    margin = int(margin_s * recording.rate_hz)
    low, high = max(start - margin, 0), min(stop + margin, len(recording.time))
    source = _Source(recording, point_names(recording, side, name), side, name)
    positions = source.read(low, high)
    if not np.isfinite(positions).all():
        positions = source.read_filled(low, high, gaps)
    parts = []
    for part, last in zip(_PARTS, (start + 1, stop), strict=True):
        hidden = np.argwhere(~np.isfinite(positions[start - low : last - low, part]).all(axis=2))
        if len(hidden):
            source.refuse(start + int(hidden[0, 0]), part.start + int(hidden[0, 1]), gaps)
        first, end = _seen_span(positions[:, part], (start - low, last - low))
        parts.append((positions[first:end, part], low + first))
    return BodyPoints(*parts[0], *parts[1])


@dataclass(frozen=True, eq=False)
class _Source:
    """Where six points are read from."""

    recording: LabelledRecording
    names: tuple[str, ...]
    side: Side
    demonstration: str

    @property
    def has_cluster(self) -> bool:
        """Whether markers tell how the hand is turned; else its orientation was measured."""
        return self.names[3] != self.names[4]

    def read(self, low: int, high: int) -> FloatArray:
        """Return the points in some rows, shape (T, 6, 3), metres; NaN where not seen."""
        columns = [self.recording.markers.index(one) for one in self.names]
        positions: FloatArray = self.recording.positions[low:high, columns]
        if not self.has_cluster:
            arm, _ = _find_arm(self.recording, self.side, self.demonstration)
            around = _around_hand(self.recording, arm, low, high, self.demonstration)
            positions[:, 3:] += around
        return positions

    def read_filled(self, low: int, high: int, gaps: GapLimits) -> FloatArray:
        """Return the points in some rows with gaps filled, as far as that can be had."""
        context = int(_CONTEXT_S * self.recording.rate_hz)
        wide_low = max(low - context, 0)
        wide = self.read(wide_low, min(high + context, len(self.recording.time)))
        filled = _fill(wide, self.recording.rate_hz, gaps, self.has_cluster)
        return filled[low - wide_low : high - wide_low]

    def refuse(self, row: int, point: int, gaps: GapLimits) -> NoReturn:
        """Raise an error about the gap of a point that a row is in."""
        path = self.read(0, len(self.recording.time))[:, point]
        hidden = np.asarray(~np.isfinite(path).all(axis=1), dtype=np.bool_)
        begin, end = next(run for run in find_runs(hidden) if run[0] <= row < run[1])
        first = self.recording.first_frame
        raise MappingError(
            f"{self.demonstration}: {self.names[point]!r} is not seen in frames {first + begin} to "
            f"{first + end - 1}; gaps up to longest_gap_s = {gaps.spline_s:g} s are filled, and "
            f"up to longest_rigid_gap_s = {gaps.rigid_s:g} s where the other two markers of a "
            "cluster are seen"
        )


def point_names(recording: LabelledRecording, side: Side, name: str) -> tuple[str, ...]:
    """Return what each of the six points is taken from; a hand without a cluster three times.

    Parameters
    ----------
    recording : LabelledRecording
        Its positions are not looked at.
    side : "right" or "left"
    name : str
        For messages.

    Returns
    -------
    tuple of six str
        Middle, left and right of the back; top, left and right of the hand.

    Raises
    ------
    MappingError
        If one of them is not there.
    """
    markers = recording.markers
    if _BACK[0] in markers:
        prefix = "left_" if side == "left" else ""
        if side == "right" and "right_hand_top" in markers:
            prefix = "right_"
        names = _BACK + tuple(prefix + one for one in _HAND)
    else:
        arm, back = _find_arm(recording, side, name)
        names = (*back, arm.hand, arm.hand, arm.hand)
    for one in names:
        if one not in markers:
            raise MappingError(f"{name}: the recording has no marker {one!r}")
    return names


def _find_arm(
    recording: LabelledRecording, side: Side, name: str
) -> tuple[Arm, tuple[str, str, str]]:
    """Return an arm and the back of a body that has no cluster of markers on the back."""
    try:
        body = find_body(recording.markers, recording.source)
    except RecognitionError as error:
        raise MappingError(f"{name}: {error}") from None
    arm = next((one for one in body.arms if one.side == side), None)
    if arm is None:
        raise MappingError(
            f"{name}: the {side} arm is not complete; got {', '.join(recording.markers)}"
        )
    return arm, body.back


def _around_hand(
    recording: LabelledRecording, arm: Arm, low: int, high: int, name: str
) -> FloatArray:
    """Return three points relative to a hand whose orientation was measured, shape (T, 3, 3)."""
    if recording.orientations is None:
        raise MappingError(
            f"{name}: nothing tells how {arm.hand} is turned; expected its orientation or the "
            "markers hand_top, hand_left and hand_right"
        )
    measured = np.array(recording.orientations[low:high, recording.markers.index(arm.hand)])
    unseen = ~(np.linalg.norm(measured, axis=1) > _SMALLEST_NORM)
    measured[unseen] = (1.0, 0.0, 0.0, 0.0)
    hand2lab = arm.turn(quaternion_to_rotation(measured))
    hand2lab[unseen] = np.nan
    # Top, left and right of `hand_frame`, with the hand as their centroid.
    offsets = _REACH_M * np.array([[2.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
    around: FloatArray = np.einsum("tij,kj->tki", hand2lab, offsets)
    return around


def _fill(positions: FloatArray, rate_hz: float, gaps: GapLimits, clusters: bool) -> FloatArray:
    """Fill gaps between sightings; clusters first, then each point, then clusters again."""
    spline, rigid = (
        int(np.floor(seconds * rate_hz + 1e-6)) for seconds in (gaps.spline_s, gaps.rigid_s)
    )
    result = positions.copy()
    # Rigid filling may use a mate's gap only once that is filled itself.
    for by_cluster in (True, False, True):
        for part in _PARTS:
            if not by_cluster:
                for point in range(part.start, part.stop):
                    result[:, point] = _fill_between(result[:, point], spline)
            elif clusters:
                result[:, part] = fill_cluster(result[:, part], rigid)[0]
    return result


def _fill_between(path: FloatArray, longest: int) -> FloatArray:
    """Fill the short gaps of one point (T, 3), but nothing before the first or after the last."""
    seen = np.flatnonzero(np.isfinite(path).all(axis=1))
    filled, _ = fill_gaps(path, longest)
    if len(seen):
        filled[: seen[0]] = filled[seen[-1] + 1 :] = np.nan
    return filled


def _seen_span(positions: FloatArray, rows: tuple[int, int]) -> tuple[int, int]:
    """Return the longest half-open span around some rows in which three points are all seen."""
    hidden = np.flatnonzero(~np.isfinite(positions).all(axis=(1, 2)))
    before, after = hidden[hidden < rows[0]], hidden[hidden >= rows[1]]
    first = int(before[-1]) + 1 if len(before) else 0
    return first, int(after[0]) if len(after) else len(positions)
