"""Whether named markers can be on a person: size, how upright, and left and right."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError, RecognitionError, RecordingWarning
from besman.person.body import Arm, find_body
from besman.person.body_frames import BodyFrames
from besman.person.build import LimbLength, find_scale, measure_limbs, measure_upright
from besman.person.marker_set import MarkerSet
from besman.person.sides import find_exchanged, name_frames, weigh_back, weigh_hand
from besman.records import LabelledRecording

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_BACK = ("back_top", "back_left", "back_right")
_MOST_LEAN_DEG = 60.0
_THROUGHOUT = 0.95
_UNITS = {
    1e3: "mm read as m",
    1e2: "cm read as m",
    1e1: "mm read as cm",
    1e-1: "cm read as mm",
    1e-2: "m read as cm",
    1e-3: "m read as mm",
}


def check_person(recording: LabelledRecording, marker_set: MarkerSet) -> None:
    """Refuse markers that can be on no person, and warn of those that are exchanged for a time.

    Parameters
    ----------
    recording : LabelledRecording
        As named.
    marker_set : MarkerSet
        Its roles say what is shoulder, elbow and hand.

    Raises
    ------
    LabellingError
        If the person is ten times too large or too small, never upright, or has left and right
        exchanged throughout.

    Warns
    -----
    RecordingWarning
        With the frames in which left and right of back or hand are exchanged.
    """
    if isinstance(marker_set.frames, BodyFrames):
        return  # a robot arm, built as it is
    points = {marker: recording.marker(marker) for marker in recording.markers}
    for limbs in limbs_of_arms(points, marker_set):
        _refuse_size(limbs, recording.source)
    _refuse_lying(points, recording.source)
    for markers, exchanged, why in find_exchanges(points, recording.rate_hz, recording.source):
        _report_exchange(recording, markers, exchanged, why)


def limbs_of_arms(
    points: Mapping[str, FloatArray], marker_set: MarkerSet
) -> Iterator[list[LimbLength]]:
    """Yield the limbs of each arm of a marker set, as far as its markers are there."""
    for side in ("", "left_"):
        roles = {
            part: marker_set.roles.get(side + part, "") for part in ("shoulder", "elbow", "hand")
        }
        yield measure_limbs(
            {part: points[marker] for part, marker in roles.items() if marker in points}
        )


def say_limbs(limbs: list[LimbLength]) -> str:
    """Say how long limbs are, and how long those of people are."""
    return ", ".join(
        f"{one.limb.first} to {one.limb.second} is {one.length_m:.3g} m (people: "
        f"{one.limb.range_m[0]:.2f} to {one.limb.range_m[1]:.2f} m)"
        for one in limbs
    )


def _refuse_size(limbs: list[LimbLength], source: str) -> None:
    """Refuse a person ten times too large or too small."""
    scale = find_scale(limbs)
    if scale is not None:
        times = f"{scale:g} times too large" if scale > 1 else f"{1 / scale:g} times too small"
        unit = _UNITS.get(scale, "another one than the file says")
        raise LabellingError(
            f"{source}: the person is {times}: {say_limbs(limbs)}; the unit of the coordinates is "
            f"wrong, likely {unit}"
        )


def _refuse_lying(points: Mapping[str, FloatArray], source: str) -> None:
    """Refuse a person who is never upright."""
    if not set(_BACK) <= points.keys():
        return
    lean = measure_upright(*(points[name] for name in _BACK))
    if lean > _MOST_LEAN_DEG:
        raise LabellingError(
            f"{source}: the back is never upright: it leans {lean:.0f} degrees or more for nine "
            f"tenths of the time, expected at most {_MOST_LEAN_DEG:g}; z has to point up, and the "
            "person to stand or sit: is another axis up in this file, or are markers of the back "
            "exchanged?"
        )


def find_exchanges(
    points: Mapping[str, FloatArray], rate_hz: float, source: str
) -> Iterator[tuple[tuple[str, str], BoolArray, str]]:
    """Yield what has left and right exchanged: two markers, in which frames, and how that shows.

    Parameters
    ----------
    points : mapping of str to array, shape (T, 3)
        Markers by name, metres, z up; NaN where not seen.
    rate_hz : float
        Frames per second.
    source : str
        Named in no message: a body that is not complete has nothing to compare.

    Yields
    ------
    markers : two str
    exchanged : bool array, shape (T,)
    why : str
    """
    if not set(_BACK) <= points.keys():
        return
    try:
        arms = find_body(tuple(points), source).arms
    except RecognitionError:
        return
    yield from _exchanged_back(points, arms, rate_hz)
    for arm in arms:
        if arm.cluster:
            top, left, right = (points[marker] for marker in arm.cluster)
            weight = weigh_hand(
                (top, left, right), points[arm.elbow], points[arm.shoulder], _sign(arm)
            )
            exchanged = find_exchanged(left, right, weight, rate_hz)
            if exchanged.any():
                why = "the hand is turned as no forearm turns it"
                yield (arm.cluster[1], arm.cluster[2]), exchanged, why


def _exchanged_back(
    points: Mapping[str, FloatArray], arms: tuple[Arm, ...], rate_hz: float
) -> Iterator[tuple[tuple[str, str], BoolArray, str]]:
    """Find the frames in which left and right of the back are exchanged, or those of the arms."""
    left, right = points["back_left"], points["back_right"]
    weights = [weigh_back(left, right, points[arm.shoulder], _sign(arm)) for arm in arms]
    exchanged = find_exchanged(left, right, np.mean(weights, axis=0), rate_hz)
    if exchanged.any():
        sides = " and ".join(arm.side for arm in arms)
        other = f"the {sides} shoulder{'s lie' if len(arms) > 1 else ' lies'} on the other side"
        yield ("back_left", "back_right"), exchanged, other


def _sign(arm: Arm) -> float:
    return 1.0 if arm.side == "left" else -1.0


def _report_exchange(
    recording: LabelledRecording, markers: tuple[str, str], exchanged: BoolArray, why: str
) -> None:
    """Refuse an exchange that lasts, warn of one that does not."""
    first, second = markers
    paths = recording.marker(first) - recording.marker(second)
    seen = int(np.isfinite(paths).all(axis=1).sum())
    what = f"{recording.source}: {first} and {second} are exchanged"
    if exchanged.sum() >= _THROUGHOUT * seen:
        raise LabellingError(f"{what} throughout: {why}; give each the other's name")
    frames = name_frames(exchanged, recording.first_frame)
    warnings.warn(f"{what} in frames {frames}: {why}", RecordingWarning, stacklevel=3)
