"""How a hand moves, whether it rests, and whether the other one helps it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.classifiers.novelty import UNKNOWN
from besman.exceptions import MappingError
from besman.geometry.frames import hand_frame
from besman.person.body import find_body
from besman.records import LabelledRecording, LabelledSegments
from besman.records.layers import IDLE
from besman.stages.select.handled_objects import ObjectTrack
from besman.stages.select.holds import find_holds

FloatArray = npt.NDArray[np.float64]

# Within this distance a hand that rests sways and turns.
_STAYS_M = 0.05


def call_rests(
    recording: LabelledRecording, found: LabelledSegments, side: str
) -> LabelledSegments:
    """Call what is unknown idle where the hand stays: rests are like no other rest.

    Parameters
    ----------
    recording : LabelledRecording
    found : LabelledSegments
        Its blocks.
    side : "right" or "left"
        The arm.
    """
    if UNKNOWN not in found.labels:
        return found
    path, _ = hand_motion(recording, (0, len(recording.time)), side)
    labels = list(found.labels)
    for k, (start, end) in enumerate(found.bounds):
        apart = np.linalg.norm(path[start:end] - path[start], axis=1)
        if labels[k] == UNKNOWN and np.max(apart) <= _STAYS_M:
            labels[k] = IDLE
    return replace(found, labels=tuple(labels))


def hand_motion(
    recording: LabelledRecording, rows: tuple[int, int], side: str
) -> tuple[FloatArray, FloatArray | None]:
    """Return centre and orientation of a hand.

    Parameters
    ----------
    recording : LabelledRecording
    rows : pair of int
        Half-open.
    side : "right" or "left"

    Returns
    -------
    centre : array, shape (T, 3)
        Of the hand's markers, metres; NaN where it is not seen.
    hand2lab : array, shape (T, 3, 3), or None
        None if the hand has not three markers, or one of them is not seen somewhere.

    Raises
    ------
    MappingError
        If the recording does not show that arm.
    """
    body = find_body(recording.markers, recording.source)
    arm = next((one for one in body.arms if one.side == side), None)
    if arm is None:
        raise MappingError(f"{recording.source}: the {side} arm is not complete")
    own = [recording.marker(name)[slice(*rows)] for name in arm.cluster or (arm.hand,)]
    centre = np.asarray(np.mean(own, axis=0))
    if len(own) < 3 or not np.isfinite(centre).all():
        return centre, None
    return centre, hand_frame(*own)[0]


def hand_prefix(recording: LabelledRecording, side: str) -> str:
    """Return what names of a hand's markers begin with."""
    return f"{side}_" if f"{side}_hand_top" in recording.markers else ""


def refuse_both_hands(
    recording: LabelledRecording,
    rows: tuple[int, int],
    held: tuple[int, int],
    thing: tuple[str, ObjectTrack],
    side: str,
    name: str,
) -> None:
    """Refuse an object that the other hand, if it is seen, holds at the same time.

    Parameters
    ----------
    recording : LabelledRecording
    rows : pair of int
        Half-open: those of the object's track.
    held : pair of int
        When this hand holds it, counted from the first of them.
    thing : pair of str and ObjectTrack
    side : "right" or "left"
        This hand.
    name : str
        Of the demonstration, for the message.

    Raises
    ------
    MappingError
    """
    other = "left" if side == "right" else "right"
    if all(arm.side != other for arm in find_body(recording.markers, recording.source).arms):
        return
    way, hand2lab = hand_motion(recording, rows, other)
    for grasp, release in find_holds(way, thing[1].positions, recording.rate_hz, hand2lab):
        if grasp < held[1] and release > held[0]:
            at_s = (rows[0] + max(grasp, held[0])) / recording.rate_hz
            raise MappingError(
                f"{name}: {thing[0]} is held by both hands at {at_s:.2f} s of the recording; "
                f"expected the {side} hand alone, which one arm follows"
            )
