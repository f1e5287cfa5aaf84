"""Datasets of one arm that reaches: step pattern, lever, pick-and-place (thesis 3.2 to 3.4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from besman.geometry.frames import quaternion_to_rotation
from besman.synthetic.body import RIGHT, BodyMotion
from besman.synthetic.capture import Box
from besman.synthetic.person import Person
from besman.synthetic.script import Composer, Temper, pose_at
from besman.synthetic.take import Action, Plan
from besman.synthetic.throw_motion import Pose

FloatArray = npt.NDArray[np.float64]
Streams = Callable[[int], np.random.Generator]

_HANG_WRIST_DEG = (58.0, 10.0, -4.0)
_HANG_POLE = (-0.80, -0.60, -0.60)
_REACH_POLE = (-0.15, -0.80, -0.60)

STEP_CLASSES = ("right", "up", "left", "down")
STEP_M = 0.16
_STEP_WAY = ("right", "up", "right", "up", "down", "left", "down", "left")
_STEP_DIRECTIONS = {
    "right": np.array([0.0, -STEP_M, 0.0]),
    "up": np.array([0.0, 0.0, STEP_M]),
    "left": np.array([0.0, STEP_M, 0.0]),
    "down": np.array([0.0, 0.0, -STEP_M]),
}
# Lower left corner of the upright pattern, from the shoulder, metres.
_STEP_CORNER = np.array([0.36, 0.20, -0.28])
# The stick has two millimetres of room on each side of the path.
_STEP_PLAY_M = 0.001

LEVER_CLASSES = ("idle", "approach_forward", "move_lever", "move_to_rest")

PICK_AND_PLACE_CLASSES = (
    "approach_forward",
    "move_obj_table",
    "move_to_rest_right",
    "approach_right",
    "move_obj_shelf",
    "move_to_rest_down",
)
_BOX_HALF_M = np.array([0.04, 0.05, 0.09])
# Markers on two of its faces, off by their radius, in the box's frame.
BOX_MARKERS = {
    "box_back": np.array([-_BOX_HALF_M[0] - 0.008, 0.0, 0.075]),
    "box_left": np.array([0.0, -_BOX_HALF_M[1] - 0.008, 0.03]),
}
# Middle of the box from the hand that grasps it: ahead, left, up.
_BOX_FROM_HAND = np.array([0.085, 0.095, -0.02])
FINGER_MARKERS = {
    "thumb": (np.array([0.030, 0.060, -0.010]), np.array([0.026, 0.052, -0.040])),
    "index": (np.array([0.115, 0.020, 0.005]), np.array([0.100, 0.015, -0.022])),
    "middle": (np.array([0.118, -0.016, 0.005]), np.array([0.106, -0.018, -0.022])),
}
_GRASP_S = 0.25


def hanging(person: Person, rng: np.random.Generator) -> Pose:
    """Draw how an arm hangs at rest."""
    hand = person.reach_m * np.array([0.12, -0.14, -0.91]) + rng.normal(0.0, 0.006, 3)
    wrist = np.array(_HANG_WRIST_DEG) + rng.normal(0.0, 2.0, 3)
    return pose_at(person, hand, wrist, _HANG_POLE)


def plan_step(person: Person, temper: Temper, streams: Streams, repetitions: range) -> Plan:
    """Move a stick up and down a step pattern, whose walls keep it on its path."""

    def corner(where: FloatArray, rng: np.random.Generator) -> Pose:
        hand = where + rng.normal(0.0, _STEP_PLAY_M, 3) * [0.3, 1.0, 1.0]
        return pose_at(person, hand, (75.0, -5.0, 0.0), _REACH_POLE)

    composer = Composer(person, temper, streams(-1), corner(_STEP_CORNER, streams(-1)))
    composer.rest(0.8)
    actions: list[Action] = []
    for repetition in repetitions:
        composer.rng = rng = streams(repetition)
        where = _STEP_CORNER.copy()
        for number, label in enumerate(_STEP_WAY):
            if number % 4 == 0:
                first = len(composer.phases)
            where = where + _STEP_DIRECTIONS[label]
            # Precise people come to a halt in a corner, fast ones hardly do.
            follow_on = 0.35 if number % 4 else 0.0
            composer.move(
                label, corner(where, rng), 0.55, follow_on=follow_on, stray_m=_STEP_PLAY_M
            )
            if number % 4 == 3:
                name = "step_up" if number < 4 else "step_down"
                actions.append(Action(name, {RIGHT: (first, len(composer.phases))}))
                composer.clock += rng.uniform(0.0, 0.1)
    composer.rest(0.8)
    return Plan({RIGHT: composer.script()}, tuple(actions))


def plan_lever(person: Person, temper: Temper, streams: Streams, repetitions: range) -> Plan:
    """Pull a lever down, from rest and back to rest."""
    place = streams(-1)
    lever = np.array([0.66, 0.10, -0.02]) * person.reach_m + place.normal(0.0, 0.02, 3)
    composer = Composer(person, temper, place, hanging(person, place))
    composer.rest(1.2)
    for repetition in repetitions:
        composer.rng = rng = streams(repetition)
        near = temper.spread_m * rng.normal(0.0, 0.5, 3)
        grip = pose_at(person, lever + near, (30.0, 10.0, 0.0), _REACH_POLE)
        pulled = lever + near + np.array([-0.10, 0.0, -0.26])
        down = pose_at(person, pulled, (30.0, 25.0, 0.0), _REACH_POLE)
        composer.move("approach_forward", grip, 1.05, (0.05, -0.05, 0.02), may_hesitate=True)
        composer.clock += rng.uniform(0.0, 0.1)
        composer.move("move_lever", down, 0.8, (0.04, 0.0, 0.0), twist_deg=2.0)
        composer.clock += rng.uniform(0.0, 0.1)
        composer.move(
            "move_to_rest", hanging(person, rng), 0.95, (0.03, -0.05, 0.0), twist_deg=-2.0
        )
        # The other arm lifts the lever again.
        composer.rest(2.2)
    return Plan({RIGHT: composer.script()})


def plan_pick_and_place(
    person: Person, temper: Temper, streams: Streams, repetitions: range
) -> Plan:
    """Take a box from a shelf to a table on the right, and back."""
    place = streams(-1)
    composer = Composer(person, temper, place, hanging(person, place))
    composer.rest(0.7)
    for repetition in repetitions:
        composer.rng = rng = streams(repetition)

        def near(
            share: tuple[float, float, float],
            wrist: tuple[float, float, float],
            rng: np.random.Generator = rng,
        ) -> Pose:
            hand = person.reach_m * np.array(share) + rng.normal(0.0, 2.0 * temper.spread_m, 3)
            return pose_at(person, hand, wrist, _REACH_POLE)

        shelf = near((0.74, 0.18, 0.10), (78.0, 5.0, 5.0))
        table = near((0.30, -0.64, -0.42), (75.0, 0.0, -8.0))
        again = near((0.74, 0.18, 0.10), (78.0, 5.0, 5.0))
        bulge = (0.08, 0.0, 0.10)
        composer.move("approach_forward", shelf, 1.25, (0.06, -0.05, 0.05), may_hesitate=True)
        composer.rest(0.35)
        composer.move("move_obj_table", table, 1.35, bulge, twist_deg=-8.0)
        composer.rest(0.35)
        composer.move("move_to_rest_right", hanging(person, rng), 1.1, (0.0, -0.08, 0.04))
        composer.rest(0.6)
        composer.move("approach_right", table, 1.2, (0.0, -0.08, 0.05), may_hesitate=True)
        composer.rest(0.35)
        composer.move("move_obj_shelf", again, 1.4, bulge, twist_deg=8.0)
        composer.rest(0.35)
        composer.move("move_to_rest_down", hanging(person, rng), 1.15, (0.06, -0.05, 0.0))
        composer.rest(0.7)
    return Plan({RIGHT: composer.script()})


def handle_box(
    plan: Plan, spans: Mapping[str, list[tuple[float, float]]], body: BodyMotion, time: FloatArray
) -> tuple[Box, ...]:
    """Add fingers that open and close and a box that goes where the hand takes it.

    Parameters
    ----------
    plan : Plan
    spans : mapping of list of (start, end)
        Side to when its phases begin and end, seconds.
    body : BodyMotion
        Gets the markers of fingers and box.
    time : array, shape (T,)
        Seconds.

    Returns
    -------
    tuple of one Box
    """
    pose = body.hands[RIGHT]
    hand2lab = quaternion_to_rotation(pose[:, 3:])
    carries = [
        span
        for phase, span in zip(plan.arms[RIGHT].phases, spans[RIGHT], strict=True)
        if phase.label in {"move_obj_table", "move_obj_shelf"}
    ]
    closed = np.zeros(len(time))
    for start, end in carries:
        closing = np.clip((time - start + _GRASP_S) / _GRASP_S, 0.0, 1.0)
        opening = np.clip((time - end) / _GRASP_S, 0.0, 1.0)
        closed += _smooth(closing) - _smooth(opening)
    for name, (wide, tight) in FINGER_MARKERS.items():
        offset = wide + closed[:, np.newaxis] * (tight - wide)
        body.markers[name] = pose[:, :3] + np.einsum("tij,tj->ti", hand2lab, offset)
    box = _carry(pose, hand2lab, carries, time)
    for name, offset in BOX_MARKERS.items():
        body.markers[name] = box.centre + box.box2lab @ offset
    return (box,)


def _smooth(share: FloatArray) -> FloatArray:
    """Go from 0 to 1 without a jerk."""
    return share * share * (3.0 - 2.0 * share)


def _carry(
    pose: FloatArray, hand2lab: FloatArray, carries: list[tuple[float, float]], time: FloatArray
) -> Box:
    """Move a box with the hand while it is held; it stays upright and turns with the hand."""
    heading = np.unwrap(np.arctan2(hand2lab[:, 1, 0], hand2lab[:, 0, 0]))
    centre = np.empty((len(time), 3))
    yaw = np.empty(len(time))
    rows = [np.searchsorted(time, span) for span in carries]
    grasp = rows[0][0]
    turned, done = heading[grasp], 0
    where = pose[grasp, :3] + Rotation.from_euler("Z", turned).apply(_BOX_FROM_HAND)
    for start, end in rows:
        centre[done:start], yaw[done:start] = where, turned
        turns = heading[start:end] - heading[start]
        cos, sin = np.cos(turns), np.sin(turns)
        arm = where - pose[start, :3]
        swung = np.column_stack(
            [cos * arm[0] - sin * arm[1], sin * arm[0] + cos * arm[1], np.full(len(turns), arm[2])]
        )
        centre[start:end] = pose[start:end, :3] + swung
        yaw[start:end] = turned + turns
        where, turned, done = centre[end - 1], yaw[end - 1], end
    centre[done:], yaw[done:] = where, turned
    # Its x axis points to the person, its back away.
    cos, sin, zero = -np.cos(yaw), -np.sin(yaw), np.zeros(len(yaw))
    axes = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1.0], axis=-1)
    return Box(centre, axes.reshape(-1, 3, 3), _BOX_HALF_M)
