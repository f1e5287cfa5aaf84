"""How a simulated person throws a stick: poses joined by overlapping bells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from besman.synthetic.bells import Bell
from besman.synthetic.person import Person, move_arm, reach_with, see_from_torso, solve_arm

FloatArray = npt.NDArray[np.float64]

_STICK_TILT = np.deg2rad(15.0)
STICK_AXIS_IN_HAND = np.array([np.sin(_STICK_TILT), 0.0, -np.cos(_STICK_TILT)])
"""Where the stick points, in the hand frame: out of the palm, leaning 15 degrees to the fingers.

So a dart is held between thumb and fingertips: with the forearm upright the stick points forward.
"""

STICK_IN_HAND = np.array([0.045, 0.010, -0.045])
"""The stick's point of balance, which carries its marker, in the hand frame, metres."""

# Share of the reach beyond which the elbow would lock.
_GREATEST_REACH = 0.93
# Where the elbow points, beside the head and with the arm forward.
_STRIKE_POLE = np.array([0.25, -0.60, -0.80])
_THROW_POLE = np.array([0.30, -0.10, -0.90])
# How far the hand is rolled inwards about the stick, degrees.
_STRIKE_ROLL_DEG = 3.0
_THROW_ROLL_DEG = 0.0
# How paths bulge half-way, as shares of the reach: strike out and swing out go round the front.
_BENDS = np.array([[0.38, -0.05, 0.00], [-0.02, -0.02, 0.05], [0.36, -0.06, 0.10]])


@dataclass(frozen=True)
class Pose:
    """A pose of the arm between two movements.

    Attributes
    ----------
    hand : array, shape (3,)
        Centroid of the hand markers from the shoulder at rest, metres (x forward, y left, z up).
    wrist_joints : array, shape (3,)
        Forearm rotation, wrist flexion and deviation, rad.
    pole : array, shape (3,)
        Where the elbow points.
    """

    hand: FloatArray
    wrist_joints: FloatArray
    pole: FloatArray


@dataclass(frozen=True)
class Stroke:
    """One movement from pose to pose.

    Attributes
    ----------
    label : str
    bell : Bell
        Its course in time.
    to : Pose
        Where it leads.
    bend : array, shape (3,)
        How far its path leaves the straight line half-way, metres.
    twist : float
        How far the torso turns left, rad.
    lean : float
        How far the torso leans forward, rad.
    """

    label: str
    bell: Bell
    to: Pose
    bend: FloatArray
    twist: float = 0.0
    lean: float = 0.0


@dataclass(frozen=True)
class Style:
    """How one person throws; drawn once per person.

    Attributes
    ----------
    strike_pose, throw_pose, rest_pose : array, shape (3,)
        Hand from the shoulder at the end of strike out, throw and swing out, as shares of the
        reach (x forward, y left, z up).
    speed_mps : float
        Greatest hand speed of the throw.
    strike_s, swing_s, idle_s : float
        Durations of strike out, swing out and the rest between throws.
    hold_s : float
        Rest between strike out and throw; negative if they overlap.
    overlap : float
        Share of the throw's duration that the swing out begins before its end.
    peaks : array, shape (3,)
        Share of the duration at which strike out, throw and swing out are fastest.
    sharpness : float
        As in `Bell`.
    stick_elevation_deg : array, shape (2,)
        How steeply the stick points up at the start and the end of the throw.
    twist : float
        Half of what the torso turns during the throw, rad.
    """

    strike_pose: FloatArray
    throw_pose: FloatArray
    rest_pose: FloatArray
    speed_mps: float
    strike_s: float
    hold_s: float
    swing_s: float
    idle_s: float
    overlap: float
    peaks: FloatArray
    sharpness: float
    stick_elevation_deg: FloatArray
    twist: float


def draw_style(rng: np.random.Generator) -> Style:
    """Draw how a person throws: pace, amplitude, symmetry of the bells, posture."""
    return Style(
        strike_pose=np.array([-0.16, -0.31, 0.10]) + rng.uniform(-0.03, 0.03, 3),
        throw_pose=np.array([0.65, -0.24, 0.61]) + rng.uniform(-0.025, 0.025, 3),
        rest_pose=np.array([0.10, -0.08, -0.93]) + rng.uniform(-0.015, 0.015, 3),
        speed_mps=rng.uniform(2.45, 2.80),
        strike_s=rng.uniform(0.9, 1.15),
        hold_s=rng.uniform(-0.02, 0.10),
        swing_s=rng.uniform(1.05, 1.3),
        idle_s=rng.uniform(1.9, 2.3),
        overlap=rng.uniform(0.16, 0.30),
        peaks=np.array([0.44, 0.57, 0.42]) + rng.uniform(-0.04, 0.04, 3),
        sharpness=rng.uniform(4.5, 5.3),
        stick_elevation_deg=np.array([48.0, 10.0]) + rng.uniform(-5.0, 5.0, 2),
        twist=np.deg2rad(rng.uniform(4.0, 10.0)),
    )


def draw_rest(person: Person, style: Style, rng: np.random.Generator) -> Pose:
    """Draw how the arm hangs before or after a throw."""
    hand = _draw_hand(person, style.rest_pose, 0.008, rng)
    # Palm between thigh and back, as a relaxed arm hangs.
    wrist_joints = np.deg2rad(np.array([58.0, 10.0, -4.0]) + rng.normal(0.0, 2.0, 3))
    return Pose(hand, wrist_joints, np.array([-0.80, -0.60, -0.60]))


def _draw_hand(
    person: Person, pose: FloatArray, spread_m: float, rng: np.random.Generator
) -> FloatArray:
    """Draw a hand position near a pose, with the arm never quite stretched."""
    hand = pose * person.reach_m + rng.normal(0.0, spread_m, 3)
    return hand * min(1.0, _GREATEST_REACH * person.reach_m / float(np.linalg.norm(hand)))


def draw_strokes(
    person: Person, style: Style, rest: Pose, start: float, rng: np.random.Generator
) -> tuple[Stroke, Stroke, Stroke]:
    """Draw one throw: strike out, throw, swing out to the given rest pose.

    Parameters
    ----------
    person : Person
    style : Style
    rest : Pose
        Where the arm comes to rest.
    start : float
        When the strike out begins, seconds.
    rng : Generator

    Returns
    -------
    tuple of three Stroke
    """
    strike = _draw_hand(person, style.strike_pose, 0.012, rng)
    throw = _draw_hand(person, style.throw_pose, 0.012, rng)
    raised, lowered = style.stick_elevation_deg + rng.normal(0.0, 1.5, 2)
    azimuth = rng.normal(0.0, 1.5)
    strike_pace, swing_pace = rng.normal(1.0, 0.035, 2)
    peaks = style.peaks + rng.normal(0.0, 0.012, 3)
    first = Bell(start, style.strike_s * strike_pace, peaks[0], style.sharpness)
    unit = Bell(0.0, 1.0, peaks[1], style.sharpness)
    speed = style.speed_mps * rng.normal(1.0, 0.02)
    duration = unit.peak_rate * float(np.linalg.norm(throw - strike)) / speed
    second = Bell(
        first.end + style.hold_s + rng.normal(0.0, 0.01), duration, peaks[1], style.sharpness
    )
    third = Bell(
        second.end - style.overlap * duration, style.swing_s * swing_pace, peaks[2], style.sharpness
    )
    bends = rng.normal(0.0, 0.01, (3, 3)) + person.reach_m * _BENDS
    twist = style.twist * rng.normal(1.0, 0.05)
    raised_torso, forward_torso = Rotation.from_euler(
        "ZY", [[-twist, -0.25 * twist], [twist, 0.5 * twist]]
    )
    strike_pose = _hold_stick(
        person, strike, aim_stick(raised, azimuth, _STRIKE_ROLL_DEG), _STRIKE_POLE, raised_torso
    )
    throw_pose = _hold_stick(
        person, throw, aim_stick(lowered, azimuth, _THROW_ROLL_DEG), _THROW_POLE, forward_torso
    )
    return (
        Stroke("strike_out", first, strike_pose, bends[0], -twist, -0.25 * twist),
        Stroke("throw", second, throw_pose, bends[1], 2.0 * twist, 0.75 * twist),
        Stroke("swing_out", third, rest, bends[2], -twist, -0.5 * twist),
    )


def _hold_stick(
    person: Person, hand: FloatArray, hand2body: Rotation, pole: FloatArray, torso2body: Rotation
) -> Pose:
    """Find the wrist joints with which the hand has an orientation."""
    seen = see_from_torso(person, hand[np.newaxis], torso2body)
    hand2torso = (torso2body.inv() * hand2body).as_matrix()[np.newaxis]
    side = elbow = torso2body.inv().apply(pole)[np.newaxis]
    for _ in range(5):
        # The pole is seen from the hand, but the orientation fixes the wrist.
        joints = solve_arm(person, seen, hand2torso, elbow)
        elbow = move_arm(person, reach_with(person, seen, joints[:, 4:], side)).elbow
    return Pose(hand, joints[0, 4:], pole)


def move_hand(
    rest: Pose, strokes: tuple[Stroke, ...], time: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Add up the strokes of a throw.

    Parameters
    ----------
    rest : Pose
        Where the hand is before the first stroke.
    strokes : tuple of Stroke
    time : array, shape (T,)
        Seconds.

    Returns
    -------
    hand : array, shape (T, 3)
        From the shoulder at rest, metres.
    wrist_joints : array, shape (T, 3)
        Forearm rotation, wrist flexion and deviation, rad.
    pole : array, shape (T, 3)
        Where the elbow points.
    """
    hand, wrist_joints, pole = (
        np.tile(start, (len(time), 1)) for start in (rest.hand, rest.wrist_joints, rest.pole)
    )
    before = rest
    for stroke in strokes:
        share = stroke.bell.progress(time)[:, np.newaxis]
        chord = stroke.to.hand - before.hand
        along = even_pace(share, chord, stroke.bend)
        hand += along * chord + 4.0 * along * (1.0 - along) * stroke.bend
        wrist_joints += share * (stroke.to.wrist_joints - before.wrist_joints)
        pole += share * (stroke.to.pole - before.pole)
        before = stroke.to
    return hand, wrist_joints, pole


def even_pace(share: FloatArray, chord: FloatArray, bend: FloatArray) -> FloatArray:
    """Find the parameter of a bent path at which the given share of its length is done."""
    parameter: FloatArray = _parameter_of_length(chord.tobytes(), bend.tobytes())(share)
    return parameter


@lru_cache(maxsize=64)
def _parameter_of_length(chord: bytes, bend: bytes) -> CubicSpline:
    """Parameter of a bent path by the share of its length; a path is walked several times."""
    straight, curve = np.frombuffer(chord), np.frombuffer(bend)
    parameter = np.linspace(0.0, 1.0, 65)
    pace = np.linalg.norm(straight + 4.0 * (1.0 - 2.0 * parameter)[:, np.newaxis] * curve, axis=1)
    length = CubicSpline(parameter, pace).antiderivative()(parameter)
    return CubicSpline(length / length[-1], parameter)


def move_torso(strokes: tuple[Stroke, ...], time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far the torso is turned left and leant forward, rad, shape (T,) each."""
    shares = [stroke.bell.progress(time) for stroke in strokes]
    twist = sum(share * stroke.twist for share, stroke in zip(shares, strokes, strict=True))
    lean = sum(share * stroke.lean for share, stroke in zip(shares, strokes, strict=True))
    return np.asarray(twist), np.asarray(lean)


def aim_stick(elevation_deg: float, azimuth_deg: float, inward_deg: float) -> Rotation:
    """Orient the hand so that the stick points where it should.

    Parameters
    ----------
    elevation_deg, azimuth_deg : float
        Direction of the stick above the horizon and left of straight ahead.
    inward_deg : float
        How far the fingers lean to the left, turned about the stick.

    Returns
    -------
    Rotation
        hand2body.
    """
    elevation, azimuth = np.deg2rad([elevation_deg, azimuth_deg])
    stick = np.array(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
    )
    left = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    thumb = Rotation.from_rotvec(-np.deg2rad(inward_deg) * stick).apply(left)
    across = np.cross(stick, thumb)
    tilt = np.arctan2(STICK_AXIS_IN_HAND[0], -STICK_AXIS_IN_HAND[2])
    fingers = np.sin(tilt) * stick + np.cos(tilt) * across
    return orient_hand(fingers, np.cross(fingers, thumb))


def orient_hand(fingers: FloatArray, back_of_hand: FloatArray) -> Rotation:
    """Orient the hand: fingers exactly along the first direction, its back towards the second."""
    x = fingers / np.linalg.norm(fingers)
    z = back_of_hand - (back_of_hand @ x) * x
    z /= np.linalg.norm(z)
    return Rotation.from_matrix(np.column_stack([x, np.cross(z, x), z]))
