"""Which markers, segments of a sensor suit or links of an exoskeleton are a person's body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError, see_look
from besman.records.layers import SIDES, Side, side_of

FloatArray = npt.NDArray[np.float64]
Axes = tuple[tuple[float, float, float], ...]

_CHEST = "t8"
_SAME: Axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
# All segments of a suit have the axes of the laboratory while the arms are stretched out sideways,
# palms down: x forward, y left, z up.
_SUIT_HANDS: dict[Side, Axes] = {
    "right": ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "left": ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}


@dataclass(frozen=True)
class Arm:
    """One arm.

    Attributes
    ----------
    hand, elbow, shoulder : str
        What is near each joint; a sensor suit names segments by the limb that starts there.
    cluster : tuple of str
        Three markers that tell the hand's orientation; empty for a suit, which measures it.
    axes : three of three float
        Axes of the hand's frame in the frame that is measured where there is no cluster: x towards
        the fingers, then y, and z out of the back of the hand.
    """

    hand: str
    elbow: str
    shoulder: str
    cluster: tuple[str, ...] = ()
    axes: Axes = _SAME

    @property
    def side(self) -> Side:
        """Which arm it is."""
        return side_of((self.hand,))

    def turn(self, part2lab: FloatArray) -> FloatArray:
        """Return hand2lab, shape (..., 3, 3), for the measured orientation of the same shape."""
        hand2lab: FloatArray = part2lab @ np.array(self.axes).T
        return hand2lab

    @property
    def markers(self) -> tuple[str, str, str]:
        """Hand, elbow and shoulder."""
        return self.hand, self.elbow, self.shoulder


@dataclass(frozen=True)
class Body:
    """A person as a recording shows them.

    Attributes
    ----------
    back : three str
        Middle, left and right of the back.
    arms : tuple of Arm
        The right one first.
    """

    back: tuple[str, str, str]
    arms: tuple[Arm, ...]

    def arms_of(self, markers: Sequence[str]) -> tuple[Arm, ...]:
        """Return the arms that some of the markers are on; the first one if they are on none."""
        named = {side_of((name,)) for name in markers}
        return tuple(arm for arm in self.arms if arm.side in named) or self.arms[:1]


def find_body(markers: Sequence[str], source: str) -> Body:
    """Find back and arms among the names of a recording.

    Cameras see clusters of markers: ``back_top``, ``back_left``, ``back_right``, and for the right
    arm ``shoulder``, ``elbow``, ``hand_top``, ``hand_left``, ``hand_right``, with or without
    ``right_`` in front, for the left arm with ``left_``. A sensor suit reports ``t8`` (the chest),
    ``right_shoulder`` and ``left_shoulder``, or the upper arms, which begin near them, and for each
    arm ``right_upper_arm``, ``right_fore_arm``, ``right_hand``. An exoskeleton with two arms has
    ``right_shoulder``, ``right_elbow`` and ``right_wrist``, and the same of the left arm; the
    person's frame lies between the shoulders, and the link at the wrist has the hand's axes.

    Parameters
    ----------
    markers : sequence of str
        Names in the recording.
    source : str
        Its name, for the message.

    Returns
    -------
    Body

    Raises
    ------
    RecognitionError
        If the back cannot be found, or no arm is complete.

    References
    ----------
    Thesis 5.3.1.
    """
    names = frozenset(markers)
    body = _cameras(names)
    if _is_suit(names):
        body = _suit(names)
    elif "back_top" not in names and names & {"right_wrist", "left_wrist"}:
        body = _exoskeleton(names)
    missing = [name for name in body.back if name not in names]
    if missing:
        raise RecognitionError(
            f"{source}: no marker {missing[0]!r}: the person's frame needs back_top, back_left, "
            "back_right, of a sensor suit t8, right_shoulder, left_shoulder, or of an exoskeleton "
            "right_shoulder, left_shoulder" + see_look(source)
        )
    if not body.arms:
        raise RecognitionError(
            f"{source}: no arm is complete: got {', '.join(markers)}; expected hand_top, elbow and "
            "shoulder, of a sensor suit right_hand, right_fore_arm and right_upper_arm, or of an "
            "exoskeleton right_wrist, right_elbow and right_shoulder" + see_look(source)
        )
    return body


def find_back(markers: Sequence[str]) -> tuple[str, ...]:
    """Return what tells where the person stands: middle, left and right of the back.

    Parameters
    ----------
    markers : sequence of str
        Names in the recording.

    Returns
    -------
    tuple of str
        Three markers or segments of a suit; none of an exoskeleton, which measures from its own
        base, and where the back is not complete.
    """
    names = frozenset(markers)
    back = (_suit if _is_suit(names) else _cameras)(names).back
    return back if set(back) <= names else ()


def _is_suit(names: frozenset[str]) -> bool:
    return _CHEST in names and "back_top" not in names


def _cameras(names: frozenset[str]) -> Body:
    arms: dict[str, Arm] = {}
    for side, prefix in (("right", ""), ("right", "right_"), ("left", "left_")):
        arm = Arm(f"{prefix}hand_top", f"{prefix}elbow", f"{prefix}shoulder")
        cluster = tuple(f"{prefix}hand_{part}" for part in ("top", "left", "right"))
        if set(arm.markers) <= names:
            arms[side] = Arm(*arm.markers, cluster if set(cluster) <= names else ())
    return Body(("back_top", "back_left", "back_right"), tuple(arms.values()))


def _suit(names: frozenset[str]) -> Body:
    """Find the segments of a suit; where it reports one side alone, the chest is the other."""
    arms = (
        Arm(f"{side}_hand", f"{side}_fore_arm", f"{side}_upper_arm", axes=_SUIT_HANDS[side])
        for side in SIDES
    )
    sides = {
        side: next((name for name in options if name in names), options[0])
        for side, options in (
            ("left", ("left_shoulder", "left_upper_arm", _CHEST)),
            ("right", ("right_shoulder", "right_upper_arm", _CHEST)),
        )
    }
    complete = tuple(arm for arm in arms if set(arm.markers) <= names)
    return Body((_CHEST, sides["left"], sides["right"]), complete)


def _exoskeleton(names: frozenset[str]) -> Body:
    """Find the links; the shoulders do not move against the frame of the URDF's root."""
    arms = (Arm(f"{side}_wrist", f"{side}_elbow", f"{side}_shoulder") for side in SIDES)
    complete = tuple(arm for arm in arms if set(arm.markers) <= names)
    return Body(("right_shoulder", "left_shoulder", "right_shoulder"), complete)
