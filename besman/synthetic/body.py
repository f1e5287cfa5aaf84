"""Markers, hands and occluding limbs of a simulated person, from joint angles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from besman.geometry.frames import rotation_to_quaternion
from besman.synthetic.person import (
    BACK_MARKERS,
    ELBOW_MARKER,
    HAND_MARKERS,
    SHOULDER_MARKER,
    ArmPose,
    Person,
    move_arm,
)
from besman.synthetic.stance import Stance

FloatArray = npt.NDArray[np.float64]
ToLab = Callable[[FloatArray], FloatArray]

RIGHT, LEFT = "right", "left"
MIRROR = np.diag([1.0, -1.0, 1.0])
"""A left arm is a right arm in a mirror."""

_MARKER_RADIUS_M = 0.007
_ARM_RADII_M = {"upper_arm": 0.042, "forearm": 0.036, "hand": 0.025}
_TRUNK_RADIUS_M = 0.085
_HEAD_RADIUS_M = 0.090
_LEG_RADIUS_M = 0.070
# The bones of the hand lie below its plate of markers; the wrist is the origin.
_HAND_AXIS = np.array([[0.0, 0.0, -0.012], [0.150, 0.0, -0.012]])


@dataclass(frozen=True)
class Capsules:
    """What hides markers: limbs as cylinders with round ends.

    Attributes
    ----------
    names : tuple of str, length K
    starts, ends : array, shape (T, K, 3)
        Ends of the axes, metres in the laboratory frame.
    radii : array, shape (K,)
        Metres; small enough that the limb's own markers stay outside.
    """

    names: tuple[str, ...]
    starts: FloatArray
    ends: FloatArray
    radii: FloatArray


@dataclass(frozen=True)
class BodyMotion:
    """A person in motion.

    Attributes
    ----------
    markers : dict of array, shape (T, 3)
        Canonical name to position, metres in the laboratory frame, without noise.
    hands : dict of array, shape (T, 7)
        Side to true pose of the hand frame in the laboratory: position (m), quaternion wxyz.
    joints : dict of array, shape (T, 7)
        Side to joint angles, rad, in the order of `besman.synthetic.person.JOINT_NAMES`; of the
        left arm as in a mirror.
    parts : dict of (array, shape (T, 3); array, shape (T, 3, 3))
        Part of the body to its proximal joint (m) and its orientation in the laboratory.
    capsules : Capsules
    """

    markers: dict[str, FloatArray]
    hands: dict[str, FloatArray]
    joints: dict[str, FloatArray]
    parts: dict[str, tuple[FloatArray, FloatArray]]
    capsules: Capsules


def place_body(
    person: Person,
    stance: Stance,
    torso2body: Rotation,
    joints: Mapping[str, FloatArray],
    time: FloatArray,
) -> BodyMotion:
    """Place a person in the laboratory.

    Parameters
    ----------
    person : Person
    stance : Stance
    torso2body : Rotation of length T
        Turn and lean of the torso about the hips.
    joints : mapping of array, shape (T, 7)
        Joint angles of the arms that are recorded; an arm that is not hangs down.
    time : array, shape (T,)
        Seconds.

    Returns
    -------
    BodyMotion
        With one arm the markers are called ``hand_top``, with two ``right_hand_top`` and so on.
    """
    torso2lab = (stance.heading * torso2body).as_matrix()
    hips = stance.heading.apply(person.hips + stance.sway(time)) + stance.place

    def to_lab(points: FloatArray) -> FloatArray:
        moved = np.broadcast_to(points - person.hips, (len(time), 3))
        placed: FloatArray = np.einsum("tij,tj->ti", torso2lab, moved) + hips
        return placed

    markers = {name: to_lab(person.back + offset) for name, offset in BACK_MARKERS.items()}
    hands: dict[str, FloatArray] = {}
    parts = {"torso": (hips, torso2lab), **_spine(person, to_lab, torso2lab)}
    limbs = _trunk(person, stance, to_lab, len(time))
    for side in (RIGHT, LEFT):
        flip = MIRROR if side == LEFT else np.eye(3)
        if side not in joints:
            limbs[f"{side}_arm"] = _hanging_arm(person, flip, to_lab)
            continue
        arm = move_arm(person, joints[side])
        prefix = f"{side}_" if len(joints) > 1 else ""
        markers |= {prefix + k: to_lab(v) for k, v in _arm_markers(person, arm, side, flip).items()}
        pieces = _arm_parts(person, arm, flip)
        parts |= {f"{side}_{k}": (to_lab(o), torso2lab @ r) for k, (o, r) in pieces.items()}
        rotation = torso2lab @ (flip @ arm.hand2torso @ flip)
        origin = to_lab((person.shoulder + arm.hand) @ flip)
        hands[side] = np.column_stack([origin, rotation_to_quaternion(rotation)])
        limbs |= _arm_limbs(person, parts, side)
    return BodyMotion(markers, hands, dict(joints), parts, _bundle(limbs))


def join_bodies(bodies: Sequence[BodyMotion]) -> BodyMotion:
    """Join stretches of one person's motion, one after the other."""
    first = bodies[0]
    capsules = [body.capsules for body in bodies]
    return BodyMotion(
        markers={k: np.concatenate([body.markers[k] for body in bodies]) for k in first.markers},
        hands={k: np.concatenate([body.hands[k] for body in bodies]) for k in first.hands},
        joints={k: np.concatenate([body.joints[k] for body in bodies]) for k in first.joints},
        parts={
            name: (
                np.concatenate([body.parts[name][0] for body in bodies]),
                np.concatenate([body.parts[name][1] for body in bodies]),
            )
            for name in first.parts
        },
        capsules=Capsules(
            first.capsules.names,
            np.concatenate([one.starts for one in capsules]),
            np.concatenate([one.ends for one in capsules]),
            first.capsules.radii,
        ),
    )


def _arm_markers(
    person: Person, arm: ArmPose, side: str, flip: FloatArray
) -> dict[str, FloatArray]:
    """Markers of one arm in the torso frame, shape (T, 3) or (3,)."""
    found = {
        "shoulder": person.shoulder + SHOULDER_MARKER,
        "elbow": person.shoulder + arm.elbow + arm.upper2torso @ ELBOW_MARKER,
    }
    found |= {
        name: person.shoulder + arm.hand + arm.hand2torso @ offset
        for name, offset in HAND_MARKERS.items()
    }
    if side == LEFT:
        # Seen from above with the palm down, the mirror swaps left and right.
        found["hand_left"], found["hand_right"] = found["hand_right"], found["hand_left"]
    return {name: point @ flip for name, point in found.items()}


def _arm_parts(
    person: Person, arm: ArmPose, flip: FloatArray
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Joints and orientations of one arm in the torso frame."""
    wrist = arm.hand - arm.hand2torso @ person.wrist_to_hand
    along = (wrist - arm.elbow) / person.forearm_m
    axis = arm.upper2torso[..., 1]
    forearm = np.stack([along, axis, np.cross(along, axis)], axis=-1)
    return {
        "upper_arm": (
            np.broadcast_to(person.shoulder @ flip, wrist.shape),
            flip @ arm.upper2torso @ flip,
        ),
        "forearm": ((person.shoulder + arm.elbow) @ flip, flip @ forearm @ flip),
        "hand": ((person.shoulder + wrist) @ flip, flip @ arm.hand2torso @ flip),
    }


def _arm_limbs(
    person: Person, parts: Mapping[str, tuple[FloatArray, FloatArray]], side: str
) -> dict[str, tuple[FloatArray, FloatArray, float]]:
    """Capsules of one arm in the laboratory."""
    shoulder, elbow = parts[f"{side}_upper_arm"][0], parts[f"{side}_forearm"][0]
    wrist, hand2lab = parts[f"{side}_hand"]
    knuckles, tips = (wrist + hand2lab @ point for point in _HAND_AXIS)
    return {
        f"{side}_upper_arm": (shoulder, elbow, _ARM_RADII_M["upper_arm"]),
        # Sleeve and elbow's marker share the joint: the marker stands off by its radius.
        f"{side}_forearm": (
            elbow,
            wrist,
            min(_ARM_RADII_M["forearm"], abs(ELBOW_MARKER[1]) - _MARKER_RADIUS_M),
        ),
        f"{side}_hand": (
            knuckles,
            tips,
            min(_ARM_RADII_M["hand"], person.wrist_to_hand[2] + 0.012 - _MARKER_RADIUS_M),
        ),
    }


def _trunk(
    person: Person, stance: Stance, to_lab: ToLab, n_samples: int
) -> dict[str, tuple[FloatArray, FloatArray, float]]:
    """Capsules of torso, head and legs in the laboratory."""
    height = person.height_m
    limbs: dict[str, tuple[FloatArray, FloatArray, float]] = {}
    for side, y in ((RIGHT, -0.08), (LEFT, 0.08)):
        low = np.array([0.0, y, 0.53 * height])
        high = np.array([0.0, y, 0.79 * height])
        limbs[f"{side}_trunk"] = (to_lab(low), to_lab(high), _TRUNK_RADIUS_M)
        thigh = np.array([[0.0, y, 0.50 * height], [0.0, y, 0.04 * height]])
        top, foot = stance.heading.apply(thigh) + stance.place
        limbs[f"{side}_leg"] = (
            np.broadcast_to(top, (n_samples, 3)),
            np.broadcast_to(foot, (n_samples, 3)),
            _LEG_RADIUS_M,
        )
    chin, crown = np.array([0.02, 0.0, 0.88 * height]), np.array([0.02, 0.0, 0.94 * height])
    limbs["head"] = (to_lab(chin), to_lab(crown), _HEAD_RADIUS_M)
    return limbs


def _hanging_arm(
    person: Person, flip: FloatArray, to_lab: ToLab
) -> tuple[FloatArray, FloatArray, float]:
    """Capsule of an arm that is not recorded, in the laboratory."""
    shoulder = person.shoulder @ flip
    down = np.array([0.05, 0.0, -0.9 * person.reach_m])
    return to_lab(shoulder), to_lab(shoulder + down), _ARM_RADII_M["upper_arm"]


def _spine(
    person: Person, to_lab: ToLab, torso2lab: FloatArray
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Joints of neck and head, orientations of the torso."""
    heights = {"chest": 0.70, "neck": 0.82, "head": 0.87}
    return {
        name: (to_lab(np.array([0.0, 0.0, share * person.height_m])), torso2lab)
        for name, share in heights.items()
    }


def _bundle(limbs: Mapping[str, tuple[FloatArray, FloatArray, float]]) -> Capsules:
    """Stack capsules."""
    return Capsules(
        names=tuple(limbs),
        starts=np.stack([start for start, _, _ in limbs.values()], axis=1),
        ends=np.stack([end for _, end, _ in limbs.values()], axis=1),
        radii=np.array([radius for _, _, radius in limbs.values()]),
    )
