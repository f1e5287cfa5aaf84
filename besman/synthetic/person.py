"""A simulated person: a right arm of seven joints on a torso."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from besman.exceptions import BesmanError

FloatArray = npt.NDArray[np.float64]

JOINT_NAMES = (
    "shoulder_flexion",
    "shoulder_abduction",
    "shoulder_rotation",
    "elbow_flexion",
    "forearm_rotation",
    "wrist_flexion",
    "wrist_deviation",
)

# Markers over the joints, from the joint (metres): on top of the shoulder (torso frame), on the
# outer side of the elbow (upper arm frame).
SHOULDER_MARKER = np.array([0.0, 0.010, 0.050])
ELBOW_MARKER = np.array([0.0, -0.045, 0.0])
# Markers of the hand in the hand frame (metres): a plate on the back of the hand.
HAND_MARKERS = {
    "hand_top": np.array([0.040, 0.0, 0.0]),
    "hand_left": np.array([-0.020, 0.030, 0.0]),
    "hand_right": np.array([-0.020, -0.030, 0.0]),
}
# Markers of the back in the torso frame, seen from their centroid (metres).
BACK_MARKERS = {
    "back_top": np.array([0.008, 0.0, 0.080]),
    "back_left": np.array([-0.004, 0.060, -0.040]),
    "back_right": np.array([-0.004, -0.060, -0.040]),
}


class ReachError(BesmanError):
    """A hand position that a person's arm does not reach."""


@dataclass(frozen=True)
class Person:
    """Lengths of one person.

    Limbs are shares of the height after Drillis and Contini [1]_: shoulder height 0.818, half
    shoulder width 0.129, upper arm 0.186, forearm 0.146, hand 0.108.

    Attributes
    ----------
    height_m : float
    upper_arm_m, forearm_m : float
        Shoulder to elbow, elbow to wrist.
    wrist_to_hand : array, shape (3,)
        From the wrist to the centroid of the hand markers, metres in the hand frame.
    shoulder : array, shape (3,)
        Shoulder joint in the torso frame (origin on the floor below the neck, x forward, y left,
        z up), metres.
    back : array, shape (3,)
        Centroid of the back markers in the torso frame, metres.

    References
    ----------
    .. [1] D. A. Winter: Biomechanics and Motor Control of Human Movement, 4th edition, 2009,
       figure 4.1. doi:10.1002/9780470549148
    """

    height_m: float
    upper_arm_m: float
    forearm_m: float
    wrist_to_hand: FloatArray
    shoulder: FloatArray
    back: FloatArray

    @property
    def hips(self) -> FloatArray:
        """Point about which the torso turns and leans, metres in the torso frame."""
        return np.array([0.0, 0.0, 0.53 * self.height_m])

    @property
    def reach_m(self) -> float:
        """Distance of the hand from the shoulder with the arm stretched, metres."""
        return self.upper_arm_m + self.forearm_m + float(self.wrist_to_hand[0])


def draw_person(rng: np.random.Generator) -> Person:
    """Draw a person: height from 1.58 to 1.82 m, limbs within 3 % of their usual share."""
    height = rng.uniform(1.58, 1.82)
    upper_arm, forearm, hand = height * np.array([0.186, 0.146, 0.108]) * rng.uniform(0.97, 1.03, 3)
    return Person(
        height_m=height,
        upper_arm_m=upper_arm,
        forearm_m=forearm,
        # The plate sits on the back of the hand, above the middle of its bones.
        wrist_to_hand=np.array([0.38 * hand, 0.0, 0.020]),
        shoulder=np.array([0.0, -0.129 * height, 0.818 * height]),
        back=np.array([-0.095, 0.0, 0.780 * height]),
    )


def see_from_torso(person: Person, hand: FloatArray, torso2body: Rotation) -> FloatArray:
    """Express a hand position in the axes of a torso that has turned about the hips.

    Parameters
    ----------
    person : Person
    hand : array, shape (T, 3)
        From where the shoulder is with the torso upright, metres.
    torso2body : Rotation of length T

    Returns
    -------
    array, shape (T, 3)
        From the shoulder, metres in the torso's axes.
    """
    shoulder = person.shoulder - person.hips
    moved: FloatArray = torso2body.inv().apply(hand + shoulder) - shoulder
    return moved


def solve_arm(
    person: Person, hand: FloatArray, hand2torso: FloatArray, pole: FloatArray
) -> FloatArray:
    """Inverse kinematics of the arm, closed form: seven joints from hand pose and elbow side.

    Parameters
    ----------
    person : Person
    hand : array, shape (T, 3)
        Centroid of the hand markers from the shoulder joint, metres in the torso's axes.
    hand2torso : array, shape (T, 3, 3)
        Orientation of the hand frame.
    pole : array, shape (T, 3)
        Direction to which the elbow points.

    Returns
    -------
    array, shape (T, 7)
        Joint angles in rad, in the order of `JOINT_NAMES`.

    Raises
    ------
    ReachError
        If the wrist would have to be farther away, or nearer, than the arm allows.
    """
    line = hand - hand2torso @ person.wrist_to_hand
    distance = np.linalg.norm(line, axis=1)
    upper, fore = person.upper_arm_m, person.forearm_m
    cosine = (upper**2 + distance**2 - fore**2) / (2.0 * upper * distance)
    if np.any(np.abs(cosine) >= 1.0):
        raise ReachError(
            f"the wrist is {distance.min():.3f} to {distance.max():.3f} m from the shoulder, "
            f"the arm allows {abs(upper - fore):.3f} to {upper + fore:.3f} m"
        )
    along = line / distance[:, np.newaxis]
    side = pole - np.einsum("ti,ti->t", pole, along)[:, np.newaxis] * along
    side /= np.linalg.norm(side, axis=1)[:, np.newaxis]
    sine = np.sqrt(1.0 - cosine**2)
    upper_x = cosine[:, np.newaxis] * along + sine[:, np.newaxis] * side
    fore_x = (line - upper * upper_x) / fore
    elbow_axis = np.cross(fore_x, upper_x)
    elbow_axis /= np.linalg.norm(elbow_axis, axis=1)[:, np.newaxis]
    upper2torso = np.stack([upper_x, elbow_axis, np.cross(upper_x, elbow_axis)], axis=-1)
    fore2torso = np.stack([fore_x, elbow_axis, np.cross(fore_x, elbow_axis)], axis=-1)
    elbow = np.arccos(np.clip(np.einsum("ti,ti->t", upper_x, fore_x), -1.0, 1.0))
    hand2fore = np.swapaxes(fore2torso, 1, 2) @ hand2torso
    joints = np.column_stack(
        [
            Rotation.from_matrix(upper2torso).as_euler("YZX"),
            elbow,
            Rotation.from_matrix(hand2fore).as_euler("XYZ"),
        ]
    )
    return np.unwrap(joints, axis=0)


def reach_with(
    person: Person, hand: FloatArray, wrist_joints: FloatArray, pole: FloatArray
) -> FloatArray:
    """Inverse kinematics of shoulder and elbow, closed form, with given forearm and wrist joints.

    Parameters
    ----------
    person : Person
    hand : array, shape (T, 3)
        Centroid of the hand markers from the shoulder joint, metres in the torso's axes.
    wrist_joints : array, shape (T, 3)
        The last three joint angles of `JOINT_NAMES`, rad.
    pole : array, shape (T, 3)
        Direction to which the elbow points.

    Returns
    -------
    array, shape (T, 7)
        Joint angles in rad, in the order of `JOINT_NAMES`.

    Raises
    ------
    ReachError
        If the hand would have to be farther away, or nearer, than the arm allows.
    """
    upper = np.array([person.upper_arm_m, 0.0, 0.0])
    # Forearm and hand are one rigid link while the wrist keeps its angles.
    link = Rotation.from_euler("XYZ", wrist_joints).apply(person.wrist_to_hand)
    link[:, 0] += person.forearm_m
    distance = np.linalg.norm(hand, axis=1)
    lever = np.hypot(link[:, 0], link[:, 2])
    cosine = (distance**2 - upper[0] ** 2 - (link**2).sum(axis=1)) / (2.0 * upper[0] * lever)
    if np.any(np.abs(cosine) >= 1.0):
        raise ReachError(
            f"the hand is {distance.min():.3f} to {distance.max():.3f} m from the shoulder, "
            f"the arm reaches {person.reach_m:.3f} m"
        )
    elbow = np.arccos(cosine) - np.arctan2(link[:, 2], link[:, 0])
    in_upper = upper + Rotation.from_euler("Y", -elbow[:, np.newaxis]).apply(link)
    upper2torso = _swivel(hand, pole) @ np.swapaxes(_swivel(in_upper, np.sign(upper)), 1, 2)
    shoulder = Rotation.from_matrix(upper2torso).as_euler("YZX")
    return np.column_stack([np.unwrap(shoulder, axis=0), elbow, wrist_joints])


def _swivel(line: FloatArray, side: FloatArray) -> FloatArray:
    """Frames, shape (T, 3, 3), with x along a line and y towards a side of it."""
    x = line / np.linalg.norm(line, axis=1)[:, np.newaxis]
    y = side - (side * x).sum(axis=1)[:, np.newaxis] * x
    y /= np.linalg.norm(y, axis=1)[:, np.newaxis]
    return np.stack([x, y, np.cross(x, y)], axis=-1)


@dataclass(frozen=True)
class ArmPose:
    """Where the parts of the arm are, from the shoulder joint, in the torso's axes.

    Attributes
    ----------
    elbow : array, shape (T, 3)
        Elbow joint, metres.
    upper2torso : array, shape (T, 3, 3)
        Orientation of the upper arm: x to the elbow, y along the elbow's axis, inwards.
    hand : array, shape (T, 3)
        Centroid of the hand markers, metres.
    hand2torso : array, shape (T, 3, 3)
        Orientation of the hand frame.
    """

    elbow: FloatArray
    upper2torso: FloatArray
    hand: FloatArray
    hand2torso: FloatArray


def move_arm(person: Person, joints: FloatArray) -> ArmPose:
    """Forward kinematics of the arm.

    Parameters
    ----------
    person : Person
    joints : array, shape (T, 7)
        Joint angles in rad, in the order of `JOINT_NAMES`; with all at zero the arm points
        forward, its elbow axis left.

    Returns
    -------
    ArmPose
    """
    upper2torso = Rotation.from_euler("YZX", joints[:, :3])
    fore2torso = upper2torso * Rotation.from_euler("Y", -joints[:, 3:4])
    hand2torso = fore2torso * Rotation.from_euler("XYZ", joints[:, 4:])
    elbow = upper2torso.apply([person.upper_arm_m, 0.0, 0.0])
    wrist = elbow + fore2torso.apply([person.forearm_m, 0.0, 0.0])
    return ArmPose(
        elbow=elbow,
        upper2torso=upper2torso.as_matrix(),
        hand=wrist + hand2torso.apply(person.wrist_to_hand),
        hand2torso=hand2torso.as_matrix(),
    )
