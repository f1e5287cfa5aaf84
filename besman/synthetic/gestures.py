"""Gestures in a sensor suit (thesis 3.6): eleven classes with several bells each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from besman.geometry.frames import rotation_to_quaternion
from besman.records import Recording
from besman.synthetic.body import LEFT, RIGHT, BodyMotion
from besman.synthetic.capture import Capture
from besman.synthetic.person import Person
from besman.synthetic.reaching import Streams, hanging
from besman.synthetic.script import Composer, Temper, pose_at
from besman.synthetic.take import Plan
from besman.synthetic.throw_motion import Pose

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Gesture:
    """One gesture: where it happens and how it goes to and fro.

    Attributes
    ----------
    hand : three float
        Where it begins, hand from the shoulder as share of the reach (x forward, y left, z up).
    wrist_deg : three float
        Forearm rotation (0: palm down), wrist flexion, deviation at the beginning.
    swing : three float
        From the beginning to the other end of a wave, as share of the reach.
    swing_deg : three float
        What the wrist does meanwhile.
    waves : two int
        Fewest and most waves; none means that the hand is held still.
    wave_s : float
        Duration of one way.
    bend : three float
        How far a wave bulges, as share of the reach; the way back bulges to the other side.
    """

    hand: tuple[float, float, float]
    wrist_deg: tuple[float, float, float]
    swing: tuple[float, float, float] = (0.0, 0.0, 0.0)
    swing_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    waves: tuple[int, int] = (0, 0)
    wave_s: float = 0.4
    bend: tuple[float, float, float] = (0.0, 0.0, 0.0)


_GESTURES = {
    "come_closer": _Gesture(
        (0.70, -0.02, -0.10), (165, -20, 0), (-0.24, 0.0, 0.16), (0, 70, 0), (2, 4), 0.42
    ),
    "move_backwards": _Gesture(
        (0.46, -0.02, -0.06), (15, 55, 0), (0.28, 0.0, 0.04), (0, -85, 0), (2, 4), 0.42
    ),
    "move_upwards": _Gesture(
        (0.66, -0.10, -0.36), (165, 5, 0), (0.02, 0.0, 0.34), (0, 15, 0), (2, 4), 0.45
    ),
    "move_downwards": _Gesture(
        (0.68, -0.10, 0.00), (8, -10, 0), (-0.02, 0.0, -0.34), (0, 20, 0), (2, 4), 0.45
    ),
    "move_left": _Gesture(
        (0.72, -0.26, -0.12), (85, -25, 0), (-0.02, 0.36, 0.0), (0, 60, 0), (1, 3), 0.45
    ),
    "move_right": _Gesture(
        (0.70, 0.12, -0.12), (85, 35, 0), (0.02, -0.38, 0.0), (0, -60, 0), (1, 3), 0.45
    ),
    "stop": _Gesture((0.78, -0.06, 0.14), (10, -65, 0)),
    "rally": _Gesture(
        (0.32, -0.34, 0.50), (60, 0, 0), (0.0, 0.22, 0.0), (0, 0, 0), (2, 4), 0.38, (0.12, 0, 0)
    ),
    "hello": _Gesture(
        (0.42, -0.50, 0.48), (20, -35, -15), (0.02, 0.26, 0.0), (0, 0, 30), (2, 5), 0.33
    ),
    "thumbs_up": _Gesture((0.74, -0.04, -0.10), (90, 0, -5)),
    "thumbs_down": _Gesture((0.74, -0.04, -0.14), (-60, 0, 10)),
}
GESTURE_CLASSES = tuple(_GESTURES)

_GESTURE_POLE = (-0.30, -0.75, -0.60)
_HOLD_S = 0.7
# A suit's axes in those of a limb here, whose x goes along it and z out of the back of the hand.
_SUIT_AXES = {
    RIGHT: np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    LEFT: np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
}
# What a sensor suit measures drifts by centimetres and hardly jitters.
_DRIFT_M = 0.012
_DRIFT_S = 4.0
_JITTER_M = 0.0004


def gesture_planner(label: str) -> Callable[[Person, Temper, Streams, range], Plan]:
    """Return what plans a take of one gesture, again and again, from rest to rest."""

    def plan(person: Person, temper: Temper, streams: Streams, repetitions: range) -> Plan:
        # What a person makes of a gesture: place, size and number of waves.
        taste = streams(-1)
        gesture = _GESTURES[label]
        place = np.array(gesture.hand) + taste.normal(0.0, 0.06, 3)
        size = taste.uniform(0.6, 1.3)
        usual = int(taste.integers(gesture.waves[0], gesture.waves[1] + 1))
        composer = Composer(person, temper, taste, hanging(person, taste))
        composer.rest(0.9)
        for repetition in repetitions:
            composer.rng = rng = streams(repetition)
            waves = max(usual + int(rng.integers(-1, 2)), 1)
            way = _way(person, gesture, place, size, waves, rng)
            back = (hanging(person, rng), 0.95, (0.03, -0.04, 0.0))
            composer.wave(label, [*way, back])
            composer.rest(1.0)
        return Plan({RIGHT: composer.script()})

    return plan


def _way(
    person: Person,
    gesture: _Gesture,
    place: FloatArray,
    size: float,
    waves: int,
    rng: np.random.Generator,
) -> list[tuple[Pose, float, npt.ArrayLike]]:
    """Raise the arm, then wave or hold it."""
    near = place + rng.normal(0.0, 0.02, 3)
    wrist = np.array(gesture.wrist_deg) + rng.normal(0.0, 4.0, 3)

    def reach(hand: FloatArray, angles: FloatArray) -> Pose:
        return pose_at(person, person.reach_m * hand, angles, _GESTURE_POLE)

    begin = reach(near, wrist)
    way: list[tuple[Pose, float, npt.ArrayLike]] = [(begin, 0.95, (0.04, -0.04, 0.0))]
    if gesture.waves[1] == 0:
        still = reach(near + rng.normal(0.0, 0.006, 3), wrist)
        return [*way, (still, _HOLD_S * rng.uniform(0.6, 1.6), (0.0, 0.0, 0.0))]
    bend = size * person.reach_m * np.array(gesture.bend)
    for _ in range(waves):
        there = near + size * np.array(gesture.swing) + rng.normal(0.0, 0.012, 3)
        turned = wrist + size * np.array(gesture.swing_deg)
        seconds = gesture.wave_s * float(np.sqrt(size))
        way += [(reach(there, turned), seconds, bend), (begin, seconds, -bend)]
    return way


def see_segments(capture: Capture, rng: np.random.Generator) -> Capture:
    """Turn a capture of markers into what a sensor suit reports: parts of the body that drift.

    Parameters
    ----------
    capture : Capture
        With its true motion.
    rng : Generator
        Of drift and jitter.

    Returns
    -------
    Capture
        One trajectory per segment of the body, called as the suit calls it.
    """
    from dataclasses import replace

    assert capture.body is not None
    segments = suit_segments(capture.body)
    recording = capture.recording
    n_samples = len(recording.time)
    points = np.stack([origin for origin, _ in segments.values()], axis=1)
    drift = gaussian_filter1d(
        rng.normal(0.0, 1.0, (n_samples, 1, 3)), _DRIFT_S * recording.rate_hz, axis=0
    )
    points = points + _DRIFT_M * drift / max(float(drift.std()), 1e-12)
    points += rng.normal(0.0, _JITTER_M, points.shape)
    return replace(
        capture,
        recording=Recording(
            time=recording.time,
            positions=points,
            names=tuple(segments),
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
            orientations=rotation_to_quaternion(
                np.stack([axes for _, axes in segments.values()], axis=1)
            ),
        ),
    )


def suit_segments(body: BodyMotion) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Segments of the body as a sensor suit calls them: joint (T, 3), metres; axes (T, 3, 3).

    Each has the axes of the laboratory (x forward, y left, z up) when the person stands with the
    arms stretched out sideways and the palms down.
    """
    names = {
        "Pelvis": "torso",
        "T8": "chest",
        "Neck": "neck",
        "Head": "head",
    }
    segments = {name: body.parts[part] for name, part in names.items()}
    for side in (RIGHT, LEFT):
        if f"{side}_hand" not in body.parts:
            continue
        limbs = {"UpperArm": "upper_arm", "ForeArm": "forearm", "Hand": "hand"}
        for name, limb in limbs.items():
            joint, axes = body.parts[f"{side}_{limb}"]
            segments[side.capitalize() + name] = joint, axes @ _SUIT_AXES[side]
    return segments
