"""From the script of a person's arms to a capture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from besman.records import LabelledSegments, Recording
from besman.synthetic.body import RIGHT, BodyMotion, place_body
from besman.synthetic.capture import Box, Capture
from besman.synthetic.person import Person, reach_with, see_from_torso
from besman.synthetic.script import (
    ArmScript,
    Movement,
    keep_within_reach,
    play_script,
)
from besman.synthetic.stance import Stance
from besman.synthetic.true_borders import time_parts, time_phases

FloatArray = npt.NDArray[np.float64]

_FIRST_FRAME = 1
_PART = "_part"


@dataclass(frozen=True)
class Action:
    """What several building blocks, of one arm or two, make together.

    Attributes
    ----------
    label : str
    phases : mapping of (int, int)
        Side to the first phase and the one after the last.
    """

    label: str
    phases: Mapping[str, tuple[int, int]]


@dataclass(frozen=True)
class Plan:
    """What a person does in one take.

    Attributes
    ----------
    arms : mapping of ArmScript
        By side, ``right`` and ``left``.
    actions : tuple of Action
    """

    arms: Mapping[str, ArmScript]
    actions: tuple[Action, ...] = ()

    @property
    def end(self) -> float:
        """When the take is over, seconds."""
        return max(script.end for script in self.arms.values())


Bounds = list[tuple[float, float, str]]
Things = Callable[
    [Plan, Mapping[str, list[tuple[float, float]]], BodyMotion, FloatArray], tuple[Box, ...]
]
JointNoise = Callable[[FloatArray, float], FloatArray]


@dataclass(frozen=True)
class Setting:
    """How a take is recorded.

    Attributes
    ----------
    rate_hz : float
    source : str
        File name.
    noise : Generator
        Of the measurement.
    noise_m : float
        Standard deviation of a coordinate.
    things : callable, optional
        Adds markers of objects and fingers to the body and returns boxes.
    joint_noise : callable, optional
        Changes joint angles, shape (T, 7), rad, given the rate.
    """

    rate_hz: float
    source: str
    noise: np.random.Generator
    noise_m: float = 0.00015
    things: Things | None = None
    joint_noise: JointNoise | None = None
    hidden: frozenset[str] = field(default_factory=frozenset)


def play_plan(person: Person, stance: Stance, plan: Plan, setting: Setting) -> Capture:
    """Let a person do what a plan says, before cameras that see everything.

    Parameters
    ----------
    person : Person
    stance : Stance
    plan : Plan
    setting : Setting

    Returns
    -------
    Capture
        With the phases of the arm as segments; with actions if there are any, and then the
        phases of each hand as layers ``right_hand`` and ``left_hand``.
    """
    time = np.arange(round(plan.end * setting.rate_hz) + 1) / setting.rate_hz
    body = _move_body(person, stance, plan, setting, time)
    spans = {side: time_phases(script) for side, script in plan.arms.items()}
    boxes = setting.things(plan, spans, body, time) if setting.things else ()
    names = [name for name in body.markers if name not in setting.hidden]
    positions = np.stack([body.markers[name] for name in names], axis=1)
    positions += setting.noise.normal(0.0, setting.noise_m, positions.shape)
    layers = {
        f"{side}_hand": _record(_label(script, spans[side]), len(time), setting)
        for side, script in plan.arms.items()
    }
    main = layers[f"{RIGHT}_hand"]
    if plan.actions:
        main = _record(_label_actions(plan, spans), len(time), setting)
    return Capture(
        recording=Recording(
            time=time,
            positions=positions,
            names=tuple(name.capitalize().replace("_", " ") for name in names),
            rate_hz=setting.rate_hz,
            source=setting.source,
            first_frame=_FIRST_FRAME,
        ),
        segments=main,
        layers=layers if plan.actions else {},
        body=body,
        boxes=boxes,
    )


def _move_body(
    person: Person, stance: Stance, plan: Plan, setting: Setting, time: FloatArray
) -> BodyMotion:
    """Solve both arms over the whole take."""
    paths = {side: play_script(script, time) for side, script in plan.arms.items()}
    # A left arm's script is seen in a mirror, where the torso turns the other way.
    twist = sum(
        (path[3] if side == RIGHT else -path[3] for side, path in paths.items()),
        np.zeros(len(time)),
    )
    joints = {}
    for side, (hand, wrist_joints, pole, _) in paths.items():
        turn = _turned(twist if side == RIGHT else -twist)
        seen = keep_within_reach(person, see_from_torso(person, hand, turn), wrist_joints)
        solved = reach_with(person, seen, wrist_joints, turn.inv().apply(pole))
        if setting.joint_noise is not None:
            solved = setting.joint_noise(solved, setting.rate_hz)
        joints[side] = solved
    return place_body(person, stance, _turned(twist), joints, time)


def _turned(twist: FloatArray) -> Rotation:
    """Torso turned left, rad, shape (T,)."""
    return Rotation.from_euler("Z", twist[:, np.newaxis])


def _label(script: ArmScript, spans: list[tuple[float, float]]) -> Bounds:
    """Label the phases of an arm, with the parts of movements that were slowed down."""
    found: Bounds = []
    for phase, (start, end) in zip(script.phases, spans, strict=True):
        found.append((start, end, phase.label))
        if isinstance(phase, Movement) and phase.parts:
            borders = time_parts(script, phase, (start, end))
            found += [(one, two, phase.label + _PART) for one, two in pairwise(borders)]
    return found


def _label_actions(plan: Plan, spans: Mapping[str, list[tuple[float, float]]]) -> Bounds:
    """Label what both arms do together; neighbours share their border."""
    found: Bounds = []
    for action in plan.actions:
        starts = [spans[side][first][0] for side, (first, _) in action.phases.items()]
        ends = [spans[side][stop - 1][1] for side, (_, stop) in action.phases.items()]
        start, end = min(starts), max(ends)
        if found and start < found[-1][1]:
            start = 0.5 * (start + found[-1][1])
            found[-1] = (found[-1][0], start, found[-1][2])
        found.append((start, end, action.label))
    return found


def _record(bounds: Bounds, n_samples: int, setting: Setting) -> LabelledSegments:
    """Round seconds to rows; stretches shorter than two rows are left out."""
    rows = [
        (min(round(start * setting.rate_hz), n_samples), round(end * setting.rate_hz), label)
        for start, end, label in bounds
    ]
    kept = [(start, min(end, n_samples - 1), label) for start, end, label in rows]
    kept = [row for row in kept if row[1] - row[0] >= 2]
    return LabelledSegments(
        bounds=np.array([row[:2] for row in kept], dtype=np.int64).reshape(-1, 2),
        labels=tuple(label for _, _, label in kept),
        distances=np.zeros(len(kept)),
        rate_hz=setting.rate_hz,
        source=setting.source,
        first_frame=_FIRST_FRAME,
    )
