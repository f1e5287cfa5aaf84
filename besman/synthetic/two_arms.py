"""Dataset of two arms: turning a frame with re-grasping (thesis 3.7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from besman.synthetic.body import LEFT, RIGHT, BodyMotion
from besman.synthetic.capture import Box
from besman.synthetic.person import Person
from besman.synthetic.reaching import Streams
from besman.synthetic.script import IDLE, Composer, Temper, pose_at
from besman.synthetic.take import Action, Plan
from besman.synthetic.throw_motion import Pose

FloatArray = npt.NDArray[np.float64]

OBJECT_ROTATION_ACTIONS = ("lift", "turn_clockwise", "turn_counterclockwise", "place")
HOLD = "hold"
# The frame's middle from the middle between the shoulders, as shares of the reach.
HELD = np.array([0.60, 0.0, -0.12])
_ON_TABLE = np.array([0.56, 0.0, -0.46])
_WIDE, _NARROW = 0.46, 0.38
_FRAME_HALF_M = np.array([0.006, 0.16, 0.10])
_PALM_WRIST_DEG = (70.0, 5.0, 0.0)
_POLE = (-0.20, -0.85, -0.50)
# How far a hand goes round the middle of the frame, degrees.
_REGRASP_DEG = 62.0
_HALF_TURN_DEG = 34.0


class Pair:
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
    pair = Pair(person, temper, streams)
    pair.rest(0.9)
    for repetition in repetitions:
        rng = streams(repetition)
        for composer in pair.arms.values():
            composer.rng = rng
        begin = pair.begin()
        held = {side: pair.grasp(HELD, _WIDE, 0.0, rng) for side in pair.arms}
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


def _turn(pair: Pair, label: str, turner: str, radius: float, rng: np.random.Generator) -> None:
    """Turn the frame: the turning hand re-grasps above and goes down, the other one after it."""
    other = LEFT if turner == RIGHT else RIGHT
    turns_meanwhile = rng.random() < 0.5
    outwards = (0.0, -0.05, 0.0)
    begin = pair.begin()
    above = pair.grasp(HELD, radius, _REGRASP_DEG, rng)
    raised = pair.grasp(HELD, radius, _HALF_TURN_DEG, rng) if turns_meanwhile else None
    pair.both(
        {
            turner: ("re-grasp_up", above, 0.85, outwards),
            other: (label if turns_meanwhile else HOLD, raised, 0.95, (0.0, 0.02, 0.0)),
        },
        _draw_lags(rng),
    )
    side = pair.grasp(HELD, radius, 0.0, rng)
    below = pair.grasp(HELD, radius, -8.0 if not turns_meanwhile else 0.0, rng)
    pair.both(
        {
            turner: (label, side, 0.95, (0.0, -0.03, 0.0)),
            other: ("re-grasp_down", below, 0.85, (0.0, -0.08, 0.02)),
        },
        _draw_lags(rng),
    )
    pair.act(label, begin)


def hold_frame(
    plan: Plan, spans: Mapping[str, list[tuple[float, float]]], body: BodyMotion, time: FloatArray
) -> tuple[Box, ...]:
    """Put the frame between the hands, which hides what is behind it."""
    right, left = (body.hands[side][:, :3] for side in (RIGHT, LEFT))
    across = left - right
    across /= np.linalg.norm(across, axis=1)[:, np.newaxis]
    forward = np.cross(across, [0.0, 0.0, 1.0])
    forward /= np.linalg.norm(forward, axis=1)[:, np.newaxis]
    axes = np.stack([forward, across, np.cross(forward, across)], axis=-1)
    return (Box(0.5 * (right + left), axes, _FRAME_HALF_M),)
