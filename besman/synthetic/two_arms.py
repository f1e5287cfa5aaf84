"""Datasets of two arms: turning a frame (thesis 3.7), and the exoskeleton's (chapter 8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from scipy.signal import butter, sosfiltfilt

from besman.synthetic.body import LEFT, RIGHT, Body
from besman.synthetic.capture import Box
from besman.synthetic.person import Person
from besman.synthetic.reaching import Streams, hanging
from besman.synthetic.script import IDLE, Composer, Temper, pose_at
from besman.synthetic.take import Action, JointNoise, Plan
from besman.synthetic.throw_motion import Pose

FloatArray = npt.NDArray[np.float64]

OBJECT_ROTATION_ACTIONS = ("lift", "turn_clockwise", "turn_counterclockwise", "place")
OBJECT_ROTATION_BLOCKS = (
    "lift",
    "re-grasp_down",
    "re-grasp_up",
    "hold",
    "turn_clockwise",
    "turn_counterclockwise",
    "place",
)
HOLD = "hold"
# The frame's middle from the middle between the shoulders, as shares of the reach.
_HELD = np.array([0.60, 0.0, -0.12])
_ON_TABLE = np.array([0.56, 0.0, -0.46])
_WIDE, _NARROW = 0.46, 0.38
_FRAME_HALF_M = np.array([0.006, 0.16, 0.10])
_PALM_WRIST_DEG = (70.0, 5.0, 0.0)
_POLE = (-0.20, -0.85, -0.50)
# How far a hand goes round the middle of the frame, degrees.
_REGRASP_DEG = 62.0
_HALF_TURN_DEG = 34.0

# RH5-like: 0.355 and 0.386 m, shoulders 0.313 m to each side.
EXOSKELETON_LENGTHS_M = (0.355, 0.386)
EXOSKELETON_SHOULDER_M = 0.313


class _Pair:
    """Two arms that act together on a frame."""

    def __init__(self, person: Person, temper: Temper, streams: Streams) -> None:
        self.person, self.temper = person, temper
        first = streams(-1)
        start = self.grasp(_ON_TABLE, _WIDE, 0.0, first)
        self.arms = {side: Composer(person, temper, first, start) for side in (RIGHT, LEFT)}
        self.actions: list[Action] = []

    def grasp(
        self, middle: FloatArray, radius: float, up_deg: float, rng: np.random.Generator
    ) -> Pose:
        """Hold the frame at its side, raised by an angle round its middle."""
        person, angle = self.person, np.deg2rad(up_deg)
        reach = person.reach_m
        hand = reach * (middle + radius * np.array([0.0, -np.cos(angle), np.sin(angle)]))
        # The middle is seen from between the shoulders, the hand from its own.
        hand = hand - np.array([0.0, person.shoulder[1], 0.0])
        hand = hand + rng.normal(0.0, 0.6 * self.temper.spread_m, 3)
        wrist = np.array(_PALM_WRIST_DEG) + np.array([0.25 * up_deg, 0.0, -0.15 * up_deg])
        return pose_at(person, hand, wrist, _POLE)

    def both(
        self,
        moves: Mapping[str, tuple[str, Pose | None, float, Sequence[float]]],
        lag_s: Mapping[str, float],
    ) -> None:
        """Let both hands act; None instead of a pose means to hold until the other is done."""
        start = max(composer.clock for composer in self.arms.values())
        for side, (label, pose, seconds, bend) in moves.items():
            if pose is not None:
                composer = self.arms[side]
                composer.wait_until(start + lag_s.get(side, 0.0), HOLD)
                composer.move(label, pose, seconds, bend)
        end = max(composer.clock for composer in self.arms.values())
        for composer in self.arms.values():
            composer.wait_until(end, HOLD)

    def rest(self, seconds: float, label: str = IDLE) -> None:
        """Let both hands rest until the same time."""
        start = max(composer.clock for composer in self.arms.values())
        end = start + seconds
        for composer in self.arms.values():
            composer.wait_until(end, label)

    def act(self, label: str, begin: Mapping[str, int]) -> None:
        """Note that everything since `begin` is one action."""
        phases = {side: (begin[side], len(self.arms[side].phases)) for side in self.arms}
        self.actions.append(Action(label, phases))

    def begin(self) -> dict[str, int]:
        """Where an action begins."""
        return {side: len(composer.phases) for side, composer in self.arms.items()}

    def plan(self) -> Plan:
        """Return what was written."""
        return Plan({s: c.script() for s, c in self.arms.items()}, tuple(self.actions))


def plan_object_rotation(
    person: Person, temper: Temper, streams: Streams, repetitions: range
) -> Plan:
    """Lift a frame, turn it one way and back with re-grasping, put it down.

    Both variants of re-grasping occur: one hand holds while the other re-grasps, or it turns the
    frame meanwhile; hands act at once or one after the other.
    """
    pair = _Pair(person, temper, streams)
    pair.rest(0.9)
    for repetition in repetitions:
        rng = streams(repetition)
        for composer in pair.arms.values():
            composer.rng = rng
        begin = pair.begin()
        held = {side: pair.grasp(_HELD, _WIDE, 0.0, rng) for side in pair.arms}
        lags = _draw_lags(rng)
        pair.both({s: ("lift", held[s], 1.05, (0.02, 0.0, 0.0)) for s in pair.arms}, lags)
        pair.act("lift", begin)
        order = [("turn_clockwise", RIGHT), ("turn_counterclockwise", LEFT)]
        if rng.random() < 0.5:
            order.reverse()
        for number, (label, side) in enumerate(order):
            _turn(pair, label, side, _NARROW if number == 0 else _WIDE, rng)
        begin = pair.begin()
        down = {side: pair.grasp(_ON_TABLE, _WIDE, 0.0, rng) for side in pair.arms}
        lags = _draw_lags(rng)
        pair.both({s: ("place", down[s], 1.1, (0.02, 0.0, 0.0)) for s in pair.arms}, lags)
        pair.act("place", begin)
        pair.rest(1.0)
    return pair.plan()


def _draw_lags(rng: np.random.Generator) -> dict[str, float]:
    """Draw which hand begins late: none in half of the cases."""
    late = RIGHT if rng.random() < 0.5 else LEFT
    return {late: 0.0 if rng.random() < 0.5 else rng.uniform(0.15, 0.4)}


def _turn(pair: _Pair, label: str, turner: str, radius: float, rng: np.random.Generator) -> None:
    """Turn the frame: the turning hand re-grasps above and goes down, the other one after it."""
    other = LEFT if turner == RIGHT else RIGHT
    turns_meanwhile = rng.random() < 0.5
    outwards = (0.0, -0.05, 0.0)
    begin = pair.begin()
    above = pair.grasp(_HELD, radius, _REGRASP_DEG, rng)
    raised = pair.grasp(_HELD, radius, _HALF_TURN_DEG, rng) if turns_meanwhile else None
    pair.both(
        {
            turner: ("re-grasp_up", above, 0.85, outwards),
            other: (label if turns_meanwhile else HOLD, raised, 0.95, (0.0, 0.02, 0.0)),
        },
        _draw_lags(rng),
    )
    side = pair.grasp(_HELD, radius, 0.0, rng)
    below = pair.grasp(_HELD, radius, -8.0 if not turns_meanwhile else 0.0, rng)
    pair.both(
        {
            turner: (label, side, 0.95, (0.0, -0.03, 0.0)),
            other: ("re-grasp_down", below, 0.85, (0.0, -0.08, 0.02)),
        },
        _draw_lags(rng),
    )
    pair.act(label, begin)


def hold_frame(
    plan: Plan, spans: Mapping[str, list[tuple[float, float]]], body: Body, time: FloatArray
) -> tuple[Box, ...]:
    """Put the frame between the hands, which hides what is behind it."""
    right, left = (body.hands[side][:, :3] for side in (RIGHT, LEFT))
    across = left - right
    across /= np.linalg.norm(across, axis=1)[:, np.newaxis]
    forward = np.cross(across, [0.0, 0.0, 1.0])
    forward /= np.linalg.norm(forward, axis=1)[:, np.newaxis]
    axes = np.stack([forward, across, np.cross(forward, across)], axis=-1)
    return (Box(0.5 * (right + left), axes, _FRAME_HALF_M),)


def exoskeleton_person(person: Person) -> Person:
    """Give a person the arm lengths and shoulders of the exoskeleton's robot."""
    from dataclasses import replace

    upper, fore = EXOSKELETON_LENGTHS_M
    shoulder = person.shoulder * [1.0, 0.0, 1.0] - np.array([0.0, EXOSKELETON_SHOULDER_M, 0.0])
    return replace(person, upper_arm_m=upper, forearm_m=fore, shoulder=shoulder)


def plan_circle_drawing(
    person: Person, temper: Temper, streams: Streams, repetitions: range
) -> Plan:
    """Draw half a circle up with each hand, and down again (thesis 8.2.2)."""
    pair = _Pair(person, temper, streams)
    rest = hanging(person, streams(-1))
    for composer in pair.arms.values():
        composer.pose = composer.start = rest
    pair.rest(1.0)
    radius = 0.26 * temper.amplitude
    middle = np.array([0.58, 0.0, -0.05])
    for repetition in repetitions:
        rng = streams(repetition)
        for composer in pair.arms.values():
            composer.rng = rng
        low, high = (
            pair.grasp(middle + np.array([0.0, 0.0, sign * radius]), 0.12, 0.0, rng)
            for sign in (-1.0, 1.0)
        )
        bulge = (0.0, -radius * person.reach_m, 0.0)
        for label, pose, seconds, bend in (
            ("move_to_start", low, 1.6, (0.0, 0.0, 0.0)),
            ("circle_up", high, 2.2, bulge),
            ("circle_down", low, 2.2, bulge),
            ("move_to_rest", hanging(person, rng), 1.6, (0.0, 0.0, 0.0)),
        ):
            begin = pair.begin()
            pair.both({s: (label, pose, seconds, bend) for s in pair.arms}, {})
            pair.act(label, begin)
        pair.rest(1.2)
    return pair.plan()


def plan_rotation(person: Person, temper: Temper, streams: Streams, repetitions: range) -> Plan:
    """Turn a frame by about 30 degrees and back, both hands on it (thesis 8.2.3)."""
    pair = _Pair(person, temper, streams)
    for composer in pair.arms.values():
        composer.pose = composer.start = pair.grasp(_HELD, 0.5, 0.0, streams(-1))
    pair.rest(1.0)
    for repetition in repetitions:
        rng = streams(repetition)
        for composer in pair.arms.values():
            composer.rng = rng
        angle = rng.normal(30.0, 2.5)
        for label, up in (("turn_clockwise", angle), ("turn_counterclockwise", 0.0)):
            begin = pair.begin()
            ways = {RIGHT: pair.grasp(_HELD, 0.5, -up, rng), LEFT: pair.grasp(_HELD, 0.5, up, rng)}
            pair.both({s: (label, ways[s], 1.9, (0.0, 0.0, 0.0)) for s in pair.arms}, {})
            pair.act(label, begin)
        pair.rest(1.0)
    return pair.plan()


_JOINT_LOW_DEG = np.array([-140.0, -80.0, -90.0, 12.0, -95.0, -60.0, -35.0])
_JOINT_HIGH_DEG = np.array([140.0, 80.0, 90.0, 135.0, 150.0, 60.0, 35.0])
_STICTION_HZ = (1.2, 4.0)


def constrain_joints(rng: np.random.Generator) -> JointNoise:
    """Return what an exoskeleton does to a movement: joints that stick, jerk and have limits."""
    amplitude = np.deg2rad(rng.uniform(0.6, 1.3))

    def constrain(joints: FloatArray, rate_hz: float) -> FloatArray:
        band = butter(2, _STICTION_HZ, "bandpass", fs=rate_hz, output="sos")
        noise = sosfiltfilt(band, rng.normal(0.0, 1.0, joints.shape), axis=0)
        noise /= noise.std(axis=0)
        speed = np.abs(np.gradient(joints, 1.0 / rate_hz, axis=0))
        # Nothing sticks where nothing moves.
        share = speed / (speed + np.deg2rad(12.0))
        jerky = joints + amplitude * share * noise
        return np.clip(jerky, np.deg2rad(_JOINT_LOW_DEG), np.deg2rad(_JOINT_HIGH_DEG))

    return constrain


def see_joints(body: Body) -> dict[str, FloatArray]:
    """Where shoulder, elbow and wrist of both arms are, shape (T, 3) each, metres."""
    parts = {"shoulder": "upper_arm", "elbow": "forearm", "wrist": "hand"}
    return {
        f"{side}_{joint}": body.parts[f"{side}_{part}"][0]
        for side in (RIGHT, LEFT)
        for joint, part in parts.items()
    }
