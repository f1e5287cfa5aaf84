"""Simulated captures of people who throw a stick or a ball (thesis 3.5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from besman.exceptions import ConfigError
from besman.geometry.frames import quaternion_to_rotation
from besman.io.segments_json import ThrowEvent
from besman.records import LabelledSegments, Recording
from besman.synthetic.body import RIGHT, BodyMotion, join_bodies, place_body
from besman.synthetic.capture import Capture
from besman.synthetic.person import (
    BACK_MARKERS,
    HAND_MARKERS,
    Person,
    draw_person,
    reach_with,
    see_from_torso,
)
from besman.synthetic.stance import Stance, draw_stance, stream
from besman.synthetic.throw_motion import (
    STICK_IN_HAND,
    Pose,
    Stroke,
    Style,
    draw_rest,
    draw_strokes,
    draw_style,
    move_hand,
    move_torso,
)

FloatArray = npt.NDArray[np.float64]

GRAVITY_MPS2 = 9.81
MARKERS = (*BACK_MARKERS, "shoulder", "elbow", *HAND_MARKERS, "stick")
_NOISE_M = 0.00015
# An annotator sees a movement begin once it has a few percent of its speed.
_VISIBLE_SHARE = 0.03
_FINE_STEP_S = 0.001
_FIRST_FRAME = 1


@dataclass(frozen=True)
class ThrowKind:
    """What is thrown, and how.

    Attributes
    ----------
    draw_style : callable
        Draws how a person throws.
    marked : bool
        What is thrown carries a marker, ``stick``.
    key : tuple of int
        Makes the people others than those of another kind.
    """

    draw_style: Callable[[np.random.Generator], Style] = draw_style
    marked: bool = True
    key: tuple[int, ...] = ()


STICK = ThrowKind()


@dataclass(frozen=True)
class _Throw:
    """One throw and the idle time before it, on the clock of the recording."""

    start: float
    rest: Pose
    strokes: tuple[Stroke, Stroke, Stroke]
    in_hand_from: float
    on_ground_for: float


def generate_stick_throws(
    n_subjects: int = 2, n_repetitions: int = 8, rate_hz: float = 100, seed: int = 0
) -> list[Capture]:
    """Simulate people who throw a stick.

    A person is the same whatever the number of people; a throw is the same whatever the number
    of throws and the rate.

    Parameters
    ----------
    n_subjects : int
        How many people.
    n_repetitions : int
        How many throws each.
    rate_hz : float
        Frames per second, 100 to 500.
    seed : int
        Another seed, other people.

    Returns
    -------
    list of Capture
        One per person.

    Raises
    ------
    ConfigError
        If a number is out of range.
    """
    for name, value, low, high in (
        ("subjects", n_subjects, 1, 1000),
        ("throws", n_repetitions, 1, 1000),
        ("rate_hz", rate_hz, 100, 500),
        ("seed", seed, 0, 2**63),
    ):
        if not low <= value <= high:
            raise ConfigError(f"stick_throw: {name}: got {value}, expected {low} to {high}")
    return [
        simulate_throw_take(STICK, subject, range(n_repetitions), float(rate_hz), seed)
        for subject in range(n_subjects)
    ]


def simulate_throw_take(
    kind: ThrowKind,
    subject: int,
    repetitions: range,
    rate_hz: float,
    seed: int,
    source: str | None = None,
) -> Capture:
    """Simulate one take of one person.

    Parameters
    ----------
    kind : ThrowKind
    subject : int
        Counted from 0.
    repetitions : range
        Which of the person's throws.
    rate_hz : float
    seed : int
    source : str, optional
        File name; ``subject1.tsv`` and so on by default.

    Returns
    -------
    Capture
    """
    rng = stream(seed, *kind.key, subject, 0)
    person, style = draw_person(rng), kind.draw_style(rng)
    stance = draw_stance(rng)
    rest = draw_rest(person, style, rng)
    throws = _draw_throws(kind, person, style, repetitions, rest, seed, subject)
    end = throws[-1].strokes[-1].bell.end + style.idle_s
    time = np.arange(round(end * rate_hz) + 1) / rate_hz
    starts = np.searchsorted(time, [throw.start for throw in throws])
    bodies: list[BodyMotion] = []
    events: list[ThrowEvent] = []
    for throw, start, stop in zip(throws, starts, [*starts[1:], len(time)], strict=True):
        bodies.append(_place_body(person, stance, throw, time[start:stop]))
        events.append(_let_fly(person, stance, throw, rate_hz))
    body = join_bodies(bodies)
    body.markers["stick"] = _place_stick(throws, events, time, body.markers["stick"])
    markers = MARKERS if kind.marked else MARKERS[:-1]
    positions = np.stack([body.markers[name] for name in markers], axis=1)
    noise = stream(seed, *kind.key, subject, repetitions.start, repetitions.stop, 1)
    if repetitions.start == 0 and not kind.key:
        noise = stream(seed, subject, repetitions.stop + 1)
    positions += noise.normal(0.0, _NOISE_M, positions.shape)
    source = source or f"subject{subject + 1}.tsv"
    return Capture(
        recording=Recording(
            time=time,
            positions=positions,
            names=tuple(name.capitalize().replace("_", " ") for name in markers),
            rate_hz=rate_hz,
            source=source,
            first_frame=_FIRST_FRAME,
        ),
        segments=_true_segments(throws, len(time), rate_hz, source),
        throws=tuple(events),
        body=body,
    )


def _draw_throws(
    kind: ThrowKind,
    person: Person,
    style: Style,
    repetitions: range,
    rest: Pose,
    seed: int,
    subject: int,
) -> list[_Throw]:
    """Draw the throws of one person, one after the other."""
    throws: list[_Throw] = []
    start = 0.0
    for index in repetitions:
        rng = stream(seed, *kind.key, subject, index + 1)
        begin = start + style.idle_s * rng.uniform(0.9, 1.1)
        after = draw_rest(person, style, rng)
        strokes = draw_strokes(person, style, after, begin, rng)
        in_hand_from = begin - rng.uniform(0.5, 0.8) if throws else 0.0
        throws.append(_Throw(start, rest, strokes, in_hand_from, rng.uniform(0.4, 0.7)))
        start, rest = strokes[-1].bell.end, after
    return throws


def _place_body(person: Person, stance: Stance, throw: _Throw, time: FloatArray) -> BodyMotion:
    """Place a person in the laboratory, the stick in the hand."""
    hand, wrist_joints, pole = move_hand(throw.rest, throw.strokes, time)
    torso2body = Rotation.from_euler("ZY", np.column_stack(move_torso(throw.strokes, time)))
    # The torso turns; the hand's goal stays where it is in the room.
    seen = see_from_torso(person, hand, torso2body)
    joints = reach_with(person, seen, wrist_joints, torso2body.inv().apply(pole))
    body = place_body(person, stance, torso2body, {RIGHT: joints}, time)
    pose = body.hands[RIGHT]
    body.markers["stick"] = pose[:, :3] + quaternion_to_rotation(pose[:, 3:]) @ STICK_IN_HAND
    return body


def _let_fly(person: Person, stance: Stance, throw: _Throw, rate_hz: float) -> ThrowEvent:
    """Release the stick where the hand is fastest, and follow it to the ground."""
    bell = throw.strokes[1].bell
    time = np.arange(bell.start, bell.end, _FINE_STEP_S)
    speed = _hand_speed(throw, time)
    release = float(time[np.argmax(speed)])
    around = release + _FINE_STEP_S * np.array([-1.0, 0.0, 1.0])
    before, position, after = _place_body(person, stance, throw, around).markers["stick"]
    velocity = (after - before) / (2.0 * _FINE_STEP_S)
    rise = velocity[2]
    flight = float((rise + np.sqrt(rise**2 + 2.0 * GRAVITY_MPS2 * position[2])) / GRAVITY_MPS2)
    touchdown = position + flight * velocity * np.array([1.0, 1.0, 0.0])
    return ThrowEvent(
        release_frame=_FIRST_FRAME + round(release * rate_hz),
        release_time_s=round(release, 6),
        touchdown_time_s=round(release + flight, 6),
        release_m=_to_tuple(position),
        touchdown_m=_to_tuple(touchdown * np.array([1.0, 1.0, 0.0])),
    )


def _to_tuple(point: FloatArray) -> tuple[float, float, float]:
    """Round a point to a micrometre."""
    x, y, z = (round(float(value), 6) + 0.0 for value in point)
    return x, y, z


def _place_stick(
    throws: list[_Throw], events: list[ThrowEvent], time: FloatArray, in_hand: FloatArray
) -> FloatArray:
    """Path of the stick, shape (T, 3): in the hand, in flight, on the ground, unseen, in the hand.

    The stick is unseen while it is fetched.
    """
    stick = in_hand.copy()
    for index, (throw, event) in enumerate(zip(throws, events, strict=True)):
        release, touchdown = np.array(event.release_m), np.array(event.touchdown_m)
        duration = event.touchdown_time_s - event.release_time_s
        flying = (time > event.release_time_s) & (time <= event.touchdown_time_s)
        since = time[flying, np.newaxis] - event.release_time_s
        stick[flying] = release + since / duration * (touchdown - release)
        stick[flying, 2] += 0.5 * GRAVITY_MPS2 * (since * (duration - since))[:, 0]
        last = index + 1 == len(throws)
        fetched = np.inf if last else event.touchdown_time_s + throw.on_ground_for
        back = np.inf if last else throws[index + 1].in_hand_from
        stick[(time > event.touchdown_time_s) & (time <= back)] = touchdown
        stick[(time > fetched) & (time <= back)] = np.nan
    return stick


def _true_segments(
    throws: list[_Throw], n_samples: int, rate_hz: float, source: str
) -> LabelledSegments:
    """Cut at the borders of the noise-free movements, shape (S, 2)."""
    borders, labels = [0.0], ["idle"]
    for throw in throws:
        borders += _borders(throw)
        labels += [stroke.label for stroke in throw.strokes] + ["idle"]
    rows = [*np.round(np.array(borders) * rate_hz).astype(int).tolist(), n_samples - 1]
    bounds = np.column_stack([rows[:-1], rows[1:]])
    return LabelledSegments(
        bounds=bounds,
        labels=tuple(labels),
        distances=np.zeros(len(labels)),
        rate_hz=rate_hz,
        source=source,
        first_frame=_FIRST_FRAME,
    )


def _borders(throw: _Throw) -> list[float]:
    """When strike out, throw and swing out begin and the last one ends, seconds."""
    strike, forward, swing = (stroke.bell for stroke in throw.strokes)
    time = np.arange(strike.start, swing.end, _FINE_STEP_S)
    speed = _hand_speed(throw, time)

    def visible(start: float, end: float) -> FloatArray:
        inside = (time >= start) & (time <= end)
        seen: FloatArray = time[inside & (speed > _VISIBLE_SHARE * speed[inside].max())]
        return seen

    def slowest(start: float, end: float) -> float:
        inside = (time >= start) & (time <= end)
        # A short rest between two movements belongs half to each.
        quiet = time[inside & (speed <= speed[inside].min() + 1e-6)]
        return float(quiet.mean())

    return [
        float(visible(strike.start, strike.peak_time)[0]),
        slowest(strike.peak_time, forward.peak_time),
        slowest(forward.peak_time, swing.peak_time),
        float(visible(swing.peak_time, swing.end)[-1]),
    ]


def _hand_speed(throw: _Throw, time: FloatArray) -> FloatArray:
    """Speed of the hand without sway and noise, m/s, shape of `time`."""
    ahead, behind = (
        move_hand(throw.rest, throw.strokes, time + shift)[0] for shift in (5e-4, -5e-4)
    )
    speed: FloatArray = np.linalg.norm(ahead - behind, axis=1) / 1e-3
    return speed
