"""What a simulated arm does, written as poses to pass and pauses between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from besman.synthetic.bells import Bell
from besman.synthetic.person import Person
from besman.synthetic.throw_motion import Pose, Stroke, even_pace

FloatArray = npt.NDArray[np.float64]

IDLE = "idle"
# Shares of the reach between which a hand stays: the elbow neither locks nor folds.
_NEAREST, _FARTHEST = 0.32, 0.93
# Shares of the stretched arm: what is never passed, and within how much of it hands slow down.
_LOCKED, _SOFT = 0.985, 0.02
# Two movements with less rest between them are not told apart by a pause.
_SHORTEST_PAUSE_S = 0.12
# A hesitation: share of the way done before it, and how long both parts take.
_BEFORE_HESITATION = 0.80
_PARTS_OF_DURATION = (0.80, 0.55)
_PARTS_OVERLAP = 0.20


@dataclass(frozen=True)
class Temper:
    """How one person moves; drawn once per person.

    Attributes
    ----------
    pace : float
        Factor on every duration.
    peak : float
        Share of a movement's duration at which it is fastest.
    sharpness : float
        As in `Bell`.
    overlap : float
        Share of a movement's duration by which the next one may begin before its end.
    hesitation : float
        Probability of a slow-down before grasping.
    amplitude : float
        Factor on how far paths bulge and gestures reach.
    spread_m : float
        Standard deviation of the places reached for.
    """

    pace: float
    peak: float
    sharpness: float
    overlap: float
    hesitation: float
    amplitude: float
    spread_m: float


def draw_temper(rng: np.random.Generator, diversity: float = 1.0) -> Temper:
    """Draw how a person moves; with more `diversity` people differ more."""
    return Temper(
        pace=float(np.exp(diversity * rng.uniform(-0.20, 0.20))),
        peak=0.48 + diversity * rng.uniform(-0.05, 0.05),
        sharpness=rng.uniform(4.2, 5.4),
        overlap=rng.uniform(0.02, 0.18),
        hesitation=rng.uniform(0.0, 0.35),
        amplitude=1.0 + diversity * rng.uniform(-0.12, 0.12),
        spread_m=rng.uniform(0.005, 0.015),
    )


@dataclass(frozen=True)
class Movement:
    """One building block: a stroke, or several if the person hesitates or waves.

    Attributes
    ----------
    label : str
    strokes : tuple of Stroke
    parts : bool
        The strokes are parts that an annotator would mark as well.
    """

    label: str
    strokes: tuple[Stroke, ...]
    parts: bool = False


@dataclass(frozen=True)
class Pause:
    """A rest that has a label of its own, until `end` (seconds)."""

    label: str
    end: float


@dataclass(frozen=True)
class ArmScript:
    """What one arm does; of a left arm as seen in a mirror.

    Attributes
    ----------
    start : Pose
    phases : tuple of Movement or Pause
        In the order of time.
    end : float
        Seconds.
    """

    start: Pose
    phases: tuple[Movement | Pause, ...]
    end: float

    @property
    def strokes(self) -> tuple[Stroke, ...]:
        """All strokes in the order of time."""
        movements = [phase for phase in self.phases if isinstance(phase, Movement)]
        return tuple(stroke for movement in movements for stroke in movement.strokes)


@dataclass
class Composer:
    """Writes the script of one arm, movement by movement.

    Attributes
    ----------
    person : Person
    temper : Temper
    rng : Generator
        Replaced for every repetition, so that one does not depend on the number of others.
    pose : Pose
        Where the arm is now.
    clock : float
        When the last movement ended, seconds.
    """

    person: Person
    temper: Temper
    rng: np.random.Generator
    pose: Pose
    clock: float = 0.0
    phases: list[Movement | Pause] = field(default_factory=list)
    start: Pose = field(init=False)

    def __post_init__(self) -> None:
        self.start = self.pose

    def rest(self, seconds: float, label: str = IDLE) -> None:
        """Do nothing for a while."""
        self.clock += max(seconds * self.rng.uniform(0.9, 1.1), 2.0 * _SHORTEST_PAUSE_S)
        self.phases.append(Pause(label, self.clock))

    def wait_until(self, clock: float, label: str) -> None:
        """Do nothing until a time; a wait that is too short to be seen leaves no phase."""
        if clock > self.clock + _SHORTEST_PAUSE_S:
            self.phases.append(Pause(label, clock))
        self.clock = max(clock, self.clock)

    def move(
        self,
        label: str,
        pose: Pose,
        seconds: float,
        bend: npt.ArrayLike = (0.0, 0.0, 0.0),
        *,
        may_hesitate: bool = False,
        follow_on: float = 0.0,
        twist_deg: float = 0.0,
        stray_m: float = 0.006,
    ) -> None:
        """Go to a pose.

        Parameters
        ----------
        label : str
        pose : Pose
            Hand from the shoulder at rest, metres.
        seconds : float
            Usual duration, before the person's pace.
        bend : three float
            How far the path leaves the straight line half-way, metres.
        may_hesitate : bool
            The person may slow down before the end, which makes two movements of one.
        follow_on : float
            Share of the person's overlap with which this movement runs into the one before.
        twist_deg : float
            How far the torso turns left.
        stray_m : float
            Standard deviation of the bend.
        """
        rng, temper = self.rng, self.temper
        duration = seconds * temper.pace * rng.normal(1.0, 0.04)
        start = self.clock - follow_on * temper.overlap * duration
        curve = temper.amplitude * np.asarray(bend) + rng.normal(0.0, stray_m, 3)
        twist = np.deg2rad(twist_deg)
        hesitates = may_hesitate and rng.random() < temper.hesitation
        if hesitates:
            strokes = self._hesitate(label, pose, start, duration, curve, twist)
        else:
            strokes = (Stroke(label, self._bell(start, duration), pose, curve, twist),)
        self.phases.append(Movement(label, strokes, parts=hesitates))
        self.pose, self.clock = pose, strokes[-1].bell.end

    def wave(self, label: str, way: Sequence[tuple[Pose, float, npt.ArrayLike]]) -> None:
        """Go through several poses, each (pose, usual seconds, bend), as one block."""
        strokes: list[Stroke] = []
        for pose, seconds, bend in way:
            duration = seconds * self.temper.pace * self.rng.normal(1.0, 0.06)
            start = self.clock - (self.temper.overlap * duration if strokes else 0.0)
            curve = np.asarray(bend) + self.rng.normal(0.0, 0.005, 3)
            strokes.append(Stroke(label, self._bell(start, duration), pose, curve))
            self.clock = strokes[-1].bell.end
        self.pose = strokes[-1].to
        self.phases.append(Movement(label, tuple(strokes)))

    def script(self) -> ArmScript:
        """Return what was written so far."""
        return ArmScript(self.start, tuple(self.phases), self.clock)

    def _bell(self, start: float, duration: float) -> Bell:
        peak = float(np.clip(self.temper.peak + self.rng.normal(0.0, 0.015), 0.38, 0.62))
        return Bell(start, duration, peak, self.temper.sharpness)

    def _hesitate(
        self,
        label: str,
        pose: Pose,
        start: float,
        duration: float,
        curve: FloatArray,
        twist: float,
    ) -> tuple[Stroke, ...]:
        """Split a movement in two, with a slow-down between."""
        share = _BEFORE_HESITATION + self.rng.uniform(-0.08, 0.08)
        before = self.pose
        way = 4.0 * share * (1.0 - share) * curve
        middle = Pose(
            before.hand + share * (pose.hand - before.hand) + way,
            before.wrist_joints + share * (pose.wrist_joints - before.wrist_joints),
            before.pole + share * (pose.pole - before.pole),
        )
        first = self._bell(start, _PARTS_OF_DURATION[0] * duration)
        second_duration = _PARTS_OF_DURATION[1] * duration
        second = self._bell(first.end - _PARTS_OVERLAP * second_duration, second_duration)
        # Each piece of the path bulges by its share of the curve.
        return (
            Stroke(label, first, middle, share**2 * curve, share * twist),
            Stroke(label, second, pose, (1.0 - share) ** 2 * curve, (1.0 - share) * twist),
        )


def pose_at(
    person: Person, hand: npt.ArrayLike, wrist_deg: npt.ArrayLike, pole: npt.ArrayLike
) -> Pose:
    """Make a pose that the arm can take: the hand is drawn in to what it reaches.

    Parameters
    ----------
    person : Person
    hand : three float
        From the shoulder at rest, metres (x forward, y left, z up).
    wrist_deg : three float
        Forearm rotation (0: palm down, 90: thumb up), wrist flexion and deviation, degrees.
    pole : three float
        Where the elbow points.
    """
    where = np.asarray(hand, dtype=np.float64)
    distance = float(np.linalg.norm(where))
    allowed = float(np.clip(distance, _NEAREST * person.reach_m, _FARTHEST * person.reach_m))
    return Pose(where * allowed / distance, np.deg2rad(wrist_deg), np.asarray(pole, np.float64))


def play_script(
    script: ArmScript, time: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Add up the strokes of a script.

    Parameters
    ----------
    script : ArmScript
    time : array, shape (T,)
        Seconds, rising.

    Returns
    -------
    hand : array, shape (T, 3)
        From the shoulder at rest, metres.
    wrist_joints : array, shape (T, 3)
        Forearm rotation, wrist flexion and deviation, rad.
    pole : array, shape (T, 3)
        Where the elbow points.
    twist : array, shape (T,)
        How far the torso has turned left, rad.
    """
    n_samples = len(time)
    moved = np.zeros((n_samples, 10))
    steps = np.zeros((n_samples + 1, 10))
    before = script.start
    for stroke in script.strokes:
        first, last = np.searchsorted(time, [stroke.bell.start, stroke.bell.end])
        share = stroke.bell.progress(time[first:last])[:, np.newaxis]
        chord = stroke.to.hand - before.hand
        along = even_pace(share, chord, stroke.bend)
        wrist, pole = stroke.to.wrist_joints - before.wrist_joints, stroke.to.pole - before.pole
        rest = np.concatenate([wrist, pole, [stroke.twist]])
        moved[first:last, :3] += along * chord + 4.0 * along * (1.0 - along) * stroke.bend
        moved[first:last, 3:] += share * rest
        steps[last] += np.concatenate([chord, rest])
        before = stroke.to
    moved += np.cumsum(steps, axis=0)[:-1]
    start = np.concatenate([script.start.hand, script.start.wrist_joints, script.start.pole, [0.0]])
    moved += start
    return moved[:, :3], moved[:, 3:6], moved[:, 6:9], moved[:, 9]


def keep_within_reach(person: Person, hand: FloatArray, wrist_joints: FloatArray) -> FloatArray:
    """Draw hand positions smoothly in to what the arm reaches.

    Overlapping strokes and bends may lead a little past the poses they join, and a bent wrist
    makes the arm shorter.

    Parameters
    ----------
    person : Person
    hand : array, shape (T, 3)
        From the shoulder, metres.
    wrist_joints : array, shape (T, 3)
        Forearm rotation, wrist flexion and deviation, rad.

    Returns
    -------
    array, shape (T, 3)
    """
    link = Rotation.from_euler("XYZ", wrist_joints).apply(person.wrist_to_hand)
    link[:, 0] += person.forearm_m
    # Stretched, the elbow turns forearm and hand into the upper arm's direction but for the part
    # along its axis.
    stretched = person.upper_arm_m + np.hypot(link[:, 0], link[:, 2])
    farthest = np.hypot(stretched, link[:, 1])
    distance = np.linalg.norm(hand, axis=1) / farthest
    low = _NEAREST - 0.02 + _SOFT * np.logaddexp(0.0, (distance - _NEAREST + 0.02) / _SOFT)
    within = _LOCKED - _SOFT * np.logaddexp(0.0, (_LOCKED - low) / _SOFT)
    drawn: FloatArray = hand * (within / distance)[:, np.newaxis]
    return drawn
