"""Which markers, or segments of a sensor suit, are a person's back and arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from besman.exceptions import RecognitionError

_CHEST = "t8"
_SIDES = ("right", "left")


@dataclass(frozen=True)
class Arm:
    """One arm.

    Attributes
    ----------
    hand, elbow, shoulder : str
        What is near each joint; a sensor suit names segments by the limb that starts there.
    cluster : tuple of str
        Three markers that tell the hand's orientation; empty for a suit, which measures it.
    """

    hand: str
    elbow: str
    shoulder: str
    cluster: tuple[str, ...] = ()

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
        named = {_side(name) for name in markers}
        return tuple(arm for arm in self.arms if _side(arm.hand) in named) or self.arms[:1]


def _side(marker: str) -> str:
    return "left" if marker.startswith("left_") else "right"


def find_body(markers: Sequence[str], source: str) -> Body:
    """Find back and arms among the names of a recording.

    Cameras see clusters of markers: ``back_top``, ``back_left``, ``back_right``, and for the right
    arm ``shoulder``, ``elbow``, ``hand_top``, ``hand_left``, ``hand_right``, with or without
    ``right_`` in front, for the left arm with ``left_``. A sensor suit reports ``t8`` (the chest),
    ``right_shoulder`` and ``left_shoulder``, or the upper arms, which begin near them, and for each
    arm ``right_upper_arm``, ``right_fore_arm``, ``right_hand``.

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
    body = _suit(names) if _CHEST in names and "back_top" not in names else _cameras(names)
    missing = [name for name in body.back if name not in names]
    if missing:
        raise RecognitionError(
            f"{source}: no marker {missing[0]!r}: the person's frame needs back_top, back_left, "
            "back_right, or of a sensor suit t8, right_shoulder, left_shoulder"
        )
    if not body.arms:
        raise RecognitionError(
            f"{source}: no arm is complete: got {', '.join(markers)}; expected hand_top, elbow and "
            "shoulder, or of a sensor suit right_hand, right_fore_arm and right_upper_arm"
        )
    return body


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
    arms = (Arm(f"{side}_hand", f"{side}_fore_arm", f"{side}_upper_arm") for side in _SIDES)
    sides = {
        side: next((name for name in options if name in names), options[0])
        for side, options in (
            ("left", ("left_shoulder", "left_upper_arm", _CHEST)),
            ("right", ("right_shoulder", "right_upper_arm", _CHEST)),
        )
    }
    complete = tuple(arm for arm in arms if set(arm.markers) <= names)
    return Body((_CHEST, sides["left"], sides["right"]), complete)
