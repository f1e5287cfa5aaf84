"""The frozen records that flow between the stages. SI units; NaN means not seen.

Arrays are copied, made read-only and checked once, at construction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Literal, cast

import numpy as np
import numpy.typing as npt

from besman.exceptions import BesmanError, PlanError

FloatArray = npt.NDArray[np.float64]


class ShapeError(BesmanError):
    """An array of a record that has the wrong shape."""


def freeze(record: object, shapes: dict[str, tuple[int | str, ...]], **dtypes: type) -> None:
    """Copy the named arrays, make them read-only and check their shapes against each other.

    A letter in a shape stands for any length, the same wherever it occurs in the record.
    """
    lengths: dict[str, int] = {}
    for name, shape in shapes.items():
        dtype = dtypes.get(name, np.float64)
        # One layout in memory, because sums over other layouts round differently.
        array: npt.NDArray[Any] = np.array(getattr(record, name), dtype=dtype, order="C")
        if array.size == 0 and 0 not in array.shape[: len(shape)]:
            array = array.reshape([0 if isinstance(side, str) else side for side in shape])
        expected = [lengths.get(side, side) if isinstance(side, str) else side for side in shape]
        fits = len(array.shape) == len(shape) and all(
            isinstance(side, str) or side == got
            for side, got in zip(expected, array.shape, strict=True)
        )
        if not fits:
            sides = ", ".join(str(side) for side in expected)
            raise ShapeError(
                f"{type(record).__name__}.{name} must have shape ({sides}), got {array.shape}"
            )
        for side, got in zip(shape, array.shape, strict=True):
            if isinstance(side, str):
                lengths[side] = got
        array.setflags(write=False)
        object.__setattr__(record, name, array)


class Record:
    """A record; in another process it is made anew, so that it is checked and read-only there.

    Attributes
    ----------
    stored_as : str
        Name of the class in files. It never changes, wherever the class moves to; those with a
        module in them say where it stood when the first files were written.
    """

    stored_as: ClassVar[str]

    def __init_subclass__(cls, *, stored_as: str, **more: Any) -> None:
        super().__init_subclass__(**more)
        cls.stored_as = stored_as

    def __reduce__(self) -> tuple[Any, ...]:
        values = {one.name: getattr(self, one.name) for one in fields(cast(Any, self))}
        return _make, (type(self), values)


def _make(kind: type[Any], values: dict[str, Any]) -> Any:
    """Make a record of its fields."""
    return kind(**values)


@dataclass(frozen=True)
class Failure(Record, stored_as="besman.records:Failure"):
    """A demonstration or motion that a stage had to leave out.

    Attributes
    ----------
    name : str
        Of the demonstration or motion.
    reason : str
        Why it was left out.
    """

    name: str
    reason: str

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}"


@dataclass(frozen=True, eq=False)
class Recording(Record, stored_as="besman.records:Recording"):
    """What the cameras delivered.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds, strictly rising.
    positions : array, shape (T, M, 3)
        Metres in the laboratory frame (z up); NaN where a trajectory was not seen.
    names : tuple of str or None, length M
        Names as written in the file; None for an unnamed trajectory.
    rate_hz : float
        Frames per second.
    source : str
        File name without folder.
    first_frame : int
        Frame number of row 0 (segments files count in frames).
    orientations : array, shape (T, M, 4), or None
        Unit quaternions (w, x, y, z), body2lab, of what was recorded as bodies (segments of a
        sensor suit, links of an exoskeleton); None for markers, which have none.
    """

    time: FloatArray
    positions: FloatArray
    names: tuple[str | None, ...]
    rate_hz: float
    source: str
    first_frame: int = 1
    orientations: FloatArray | None = None

    def __post_init__(self) -> None:
        shapes: dict[str, tuple[int | str, ...]] = {"time": ("T",), "positions": ("T", "M", 3)}
        if self.orientations is not None:
            shapes["orientations"] = ("T", "M", 4)
        freeze(self, shapes)
        if len(self.names) != self.positions.shape[1]:
            raise ShapeError(
                f"Recording.names must name {self.positions.shape[1]} trajectories, "
                f"got {len(self.names)}"
            )


@dataclass(frozen=True, eq=False)
class LabelledRecording(Record, stored_as="besman.records:LabelledRecording"):
    """A recording whose trajectories carry the names of a marker set.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds.
    positions : array, shape (T, M, 3)
        Metres in the laboratory frame (z up). No gaps in the required markers of the set; optional
        ones (fingers, objects) stay NaN where they were unseen for long.
    markers : tuple of str, length M
        Canonical names of the marker set, e.g. ``hand_top``.
    filled : bool array, shape (T, M)
        True where a gap was filled.
    rate_hz, source, first_frame, orientations
        As in `Recording`.
    """

    time: FloatArray
    positions: FloatArray
    markers: tuple[str, ...]
    filled: npt.NDArray[np.bool_]
    rate_hz: float
    source: str
    first_frame: int = 1
    orientations: FloatArray | None = None

    def __post_init__(self) -> None:
        shapes: dict[str, tuple[int | str, ...]] = {
            "time": ("T",),
            "positions": ("T", "M", 3),
            "filled": ("T", "M"),
        }
        if self.orientations is not None:
            shapes["orientations"] = ("T", "M", 4)
        freeze(self, shapes, filled=bool)
        if len(self.markers) != self.positions.shape[1]:
            raise ShapeError(
                f"LabelledRecording.markers must name {self.positions.shape[1]} markers, "
                f"got {len(self.markers)}"
            )

    def marker(self, name: str) -> FloatArray:
        """Return the positions of one marker, shape (T, 3), metres."""
        if name not in self.markers:
            from besman.exceptions import LabellingError, nearest

            raise LabellingError(
                f"{self.source}: no marker {name!r}; {nearest(name, self.markers)}"
            )
        return self.positions[:, self.markers.index(name)]


@dataclass(frozen=True, eq=False)
class Segments(Record, stored_as="besman.records:Segments"):
    """Building blocks of one recording.

    Attributes
    ----------
    bounds : int array, shape (S, 2)
        Half-open row indices into the recording at its own rate.
    log_evidence : float
        Log-probability of the segmentation (NaN where the method has none).
    rate_hz, source, first_frame
        As in `Recording`.
    border_probability : array, shape (T,) or (0,)
        Posterior probability of a border in the sampling period of the method that each row of
        the recording lies in; empty where the method has none.
    """

    bounds: npt.NDArray[np.int64]
    log_evidence: float
    rate_hz: float
    source: str
    first_frame: int = 1
    border_probability: FloatArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        freeze(self, {"bounds": ("S", 2), "border_probability": ("T",)}, bounds=np.int64)


@dataclass(frozen=True, eq=False)
class LabelledSegments(Record, stored_as="besman.records:LabelledSegments"):
    """Building blocks with names. Manual segments are written as this record too.

    Attributes
    ----------
    bounds : int array, shape (S, 2)
        Half-open row indices into the recording at its own rate; may overlap in manual segments.
        Those of one layer do not.
    labels : tuple of str, length S
        One label per segment.
    distances : array, shape (S,)
        Uncertainty of each label: distance to the nearest training example, 0 for manual labels.
    rate_hz, source, first_frame
        As in `Recording`.
    layers : tuple of str, length S or 0
        What a person looked at when labelling: ``right_hand``, ``left_hand`` or ``actions`` (see
        `besman.manual_segments`), "" for a segment without a layer; empty if no segment has one.
    """

    bounds: npt.NDArray[np.int64]
    labels: tuple[str, ...]
    distances: FloatArray
    rate_hz: float
    source: str
    first_frame: int = 1
    layers: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, {"bounds": ("S", 2), "distances": ("S",)}, bounds=np.int64)
        if not any(self.layers) and len(self.layers) == len(self.bounds):
            object.__setattr__(self, "layers", ())
        for name, got in (("labels", len(self.labels)), ("layers", len(self.layers))):
            if got != len(self.bounds) and not (name == "layers" and got == 0):
                raise ShapeError(
                    f"LabelledSegments.{name} must have {len(self.bounds)} entries, got {got}"
                )

    def take(self, rows: Sequence[int] | npt.NDArray[np.int64]) -> LabelledSegments:
        """Return some of the segments, in the order of `rows`, shape (K,)."""
        chosen = [int(row) for row in rows]
        return replace(
            self,
            bounds=self.bounds[chosen].reshape(-1, 2),
            labels=tuple(self.labels[row] for row in chosen),
            distances=self.distances[chosen],
            layers=tuple(self.layers[row] for row in chosen) if self.layers else (),
        )


@dataclass(frozen=True, eq=False)
class Actions(Record, stored_as="besman.records:Actions"):
    """What the building blocks of one recording make.

    Attributes
    ----------
    levels : tuple of LabelledSegments
        Actions of each level, the lowest first; those of a level are made of whole ones of the
        level below, and together they cover the recording. ``distances`` are uncertainties.
    fitness : array, shape (L,)
        Minus the mean uncertainty of each level.
    """

    levels: tuple[LabelledSegments, ...]
    fitness: FloatArray

    def __post_init__(self) -> None:
        freeze(self, {"fitness": ("L",)})
        if len(self.levels) != len(self.fitness):
            raise ShapeError(
                f"Actions.levels must have {len(self.fitness)} entries, got {len(self.levels)}"
            )


@dataclass(frozen=True, eq=False)
class HandTrajectory(Record, stored_as="besman.records:HandTrajectory"):
    """The hand of one selected demonstration.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds from the start of the segment.
    poses : array, shape (T, 7)
        Position (m) and quaternion (w, x, y, z) of the hand frame in the person's back frame.
    name : str
        ``source:segment``, unique within a run.
    label : str
        Class of the segment.
    target : array, shape (3,)
        Where the thrown object met the ground, metres in the back frame; NaN if nothing is thrown.
    grasp : array, shape (7,)
        What the tool centre point is to follow, in the hand frame: position (m) and quaternion
        (w, x, y, z). NaN for either where the robot's tool says it, as ``hand_to_tcp`` does.
    """

    time: FloatArray
    poses: FloatArray
    name: str
    label: str
    target: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    grasp: FloatArray = field(default_factory=lambda: np.full(7, np.nan))

    def __post_init__(self) -> None:
        freeze(self, {"time": ("T",), "poses": ("T", 7), "target": (3,), "grasp": (7,)})


@dataclass(frozen=True, eq=False)
class JointTrajectory(Record, stored_as="besman.records:JointTrajectory"):
    """A movement of one robot arm.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds from 0, strictly rising.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.
    joint_names : tuple of str, length n
    poses : array, shape (T, 7)
        The mapped demonstration in the robot's world frame (floor below the base, z up), that the
        joint trajectory follows: position (m) and quaternion wxyz of the tool centre point.
    position_error : array, shape (T,)
        Metres between tool centre point and mapped demonstration.
    orientation_error : array, shape (T,)
        Radians between them.
    time_stretch : float
        Duration over the demonstration's duration.
    target : array, shape (3,)
        The demonstrated target in the robot's world frame, NaN if there is none.
    name, label
        As in `HandTrajectory`.
    """

    time: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    joint_names: tuple[str, ...]
    poses: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    time_stretch: float
    target: FloatArray
    name: str
    label: str

    def __post_init__(self) -> None:
        freeze(
            self,
            {
                "time": ("T",),
                "positions": ("T", "n"),
                "velocities": ("T", "n"),
                "accelerations": ("T", "n"),
                "poses": ("T", 7),
                "position_error": ("T",),
                "orientation_error": ("T",),
                "target": (3,),
            },
        )


@dataclass(frozen=True, eq=False)
class MotionPlan(Record, stored_as="besman.records:MotionPlan"):
    """A joint-space dynamical movement primitive. Its movement starts and ends at rest.

    Attributes
    ----------
    weights : array, shape (n, K)
        Weights of the forcing term.
    start, goal : array, shape (n,)
        rad; where the primitive starts and ends.
    duration : float
        Seconds of the whole movement, leads included.
    joint_names : tuple of str, length n
    rmse : float
        Root mean square error of the imitation, rad.
    goal_pose : array, shape (7,)
        Demonstrated end pose in the robot's world frame.
    start_pose : array, shape (7,)
        Demonstrated start pose in the robot's world frame; NaN where it is not known.
    target : array, shape (3,)
        As in `JointTrajectory`.
    name, label
        As in `HandTrajectory`.
    kind : "joint_dmp" or "joint_dmp_velocity"
        At rest at start and goal, or moving there (`besman.imitation.velocity_dmp`).
    start_velocity, goal_velocity : array, shape (n,)
        rad/s at start and goal; zero by default, and of a ``joint_dmp``.
    lead_in_s, lead_out_s : float
        Seconds before the start and after the goal, in which the arm speeds up from rest to the
        start's velocity and slows down from the goal's; zero of a ``joint_dmp``.

    Raises
    ------
    PlanError
        If the movement would start or end with a jump of its velocity, or has no duration.
    """

    weights: FloatArray
    start: FloatArray
    goal: FloatArray
    duration: float
    joint_names: tuple[str, ...]
    rmse: float
    goal_pose: FloatArray
    target: FloatArray
    name: str
    label: str
    kind: Literal["joint_dmp", "joint_dmp_velocity"] = "joint_dmp"
    start_velocity: FloatArray = field(default_factory=lambda: np.empty(0))
    goal_velocity: FloatArray = field(default_factory=lambda: np.empty(0))
    lead_in_s: float = 0.0
    lead_out_s: float = 0.0
    start_pose: FloatArray = field(default_factory=lambda: np.full(7, np.nan))

    def __post_init__(self) -> None:
        for name in ("start_velocity", "goal_velocity"):
            if np.size(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.zeros(np.shape(self.start)))
        freeze(
            self,
            {
                "weights": ("n", "K"),
                "start": ("n",),
                "goal": ("n",),
                "goal_pose": (7,),
                "start_pose": (7,),
                "target": (3,),
                "start_velocity": ("n",),
                "goal_velocity": ("n",),
            },
        )
        self._check_leads()

    def _check_leads(self) -> None:
        """Refuse a movement that would jump from rest, or to it."""
        if self.kind == "joint_dmp" and (self.lead_in_s or self.lead_out_s):
            raise PlanError(f"{self.name}: a joint_dmp rests at its ends; got a lead there")
        moving = (self.start_velocity, "lead_in_s"), (self.goal_velocity, "lead_out_s")
        for velocity, lead in moving:
            if not np.any(velocity):
                continue
            if self.kind == "joint_dmp":
                raise PlanError(f"{self.name}: a joint_dmp rests at its ends; got a velocity there")
            if not getattr(self, lead) > 0:
                raise PlanError(
                    f"{self.name}: {lead}: got {getattr(self, lead):g} s, expected more than 0 "
                    "where the primitive moves at its end"
                )
        if not 0 <= self.lead_in_s + self.lead_out_s < self.duration:
            raise PlanError(
                f"{self.name}: duration: got {self.duration:g} s, expected more than the leads' "
                f"{self.lead_in_s + self.lead_out_s:g} s"
            )


@dataclass(frozen=True, eq=False)
class CartesianPlan(Record, stored_as="besman.records:CartesianPlan"):
    """A dynamical movement primitive of the tool's pose, followed by inverse kinematics.

    It starts and ends at rest. See `besman.imitation.cartesian_dmp` and `.joint_path`.

    Attributes
    ----------
    weights : array, shape (6, K)
        Weights of the forcing terms of x, y, z and of the rotation vector to the goal.
    start, goal : array, shape (7,)
        Poses of the tool centre point in the robot's world frame: position (m), unit quaternion
        wxyz. The quaternions' signs say which way round the tool turns: the short way where their
        scalar product is positive.
    duration : float
        Seconds.
    joints : array, shape (n,)
        Joint angles at the start, rad: the branch that inverse kinematics follows.
    joint_names : tuple of str, length n
    orientation_weight_m_rad : float
        One radian of orientation error weighs as much as this many metres, where the arm cannot
        have both.
    free_spin : bool
        The rotation about the tool's z axis does not matter.
    rmse : float
        Root mean square error of the imitation, rad, in joint space.
    goal_pose, start_pose, target, name, label
        As in `MotionPlan`.

    Raises
    ------
    PlanError
        If a quaternion has not the length 1, or the duration is not above zero.
    """

    weights: FloatArray
    start: FloatArray
    goal: FloatArray
    duration: float
    joints: FloatArray
    joint_names: tuple[str, ...]
    orientation_weight_m_rad: float
    free_spin: bool
    rmse: float
    goal_pose: FloatArray
    target: FloatArray
    name: str
    label: str
    kind: Literal["cartesian_dmp"] = "cartesian_dmp"
    start_pose: FloatArray = field(default_factory=lambda: np.full(7, np.nan))

    def __post_init__(self) -> None:
        freeze(
            self,
            {
                "weights": (6, "K"),
                "start": (7,),
                "goal": (7,),
                "joints": ("n",),
                "goal_pose": (7,),
                "start_pose": (7,),
                "target": (3,),
            },
        )
        if not self.duration > 0:
            raise PlanError(f"{self.name}: duration: got {self.duration:g} s, expected more than 0")
        for name in ("start", "goal"):
            length = float(np.linalg.norm(getattr(self, name)[3:]))
            if not abs(length - 1.0) <= 1e-6:
                raise PlanError(
                    f"{self.name}: {name}: got a quaternion of length {length:g}, expected 1"
                )


AnyPlan = MotionPlan | CartesianPlan
"""A motion plan of any kind."""


@dataclass(frozen=True, eq=False)
class RefinedMotion(Record, stored_as="besman.records:RefinedMotion"):
    """A motion plan after the search, and what it does in simulation.

    Attributes
    ----------
    plan : MotionPlan or CartesianPlan
        The best plan found.
    time : array, shape (T,)
        Seconds, at 1 kHz.
    positions, velocities, accelerations : array, shape (T, n)
        Commanded joint trajectory of the best plan: rad, rad/s, rad/s^2.
    returns : array, shape (E,)
        Return of every episode in the order tried; episode 0 is the imitation as it was.
    misses : array, shape (E,)
        Distance of every episode's outcome to the target, metres (NaN: failed episode).
    outcome : array, shape (3,)
        Touchdown or end position reached by the best plan, metres, robot's world frame.
    outcome_before : array, shape (3,)
        The same for the imitation as it was; NaN if it failed.
    object_path : array, shape (F, 3)
        Path of the thrown object in the best episode, metres (F = 0 if nothing is thrown).
    tool_path : array, shape (T, 3)
        Path of the tool centre point in the best episode, metres.
    success : bool
        The task's success criterion is met and no limit is exceeded.
    miss_before, miss : float
        Distance to the target before and after, metres.
    orientation_error : float
        Radians to the demonstrated end orientation; NaN where the task does not ask for it.
    failure : str
        What ended the imitation's episode before its end ("" if nothing did).
    outcomes : array, shape (E, 3)
        Touchdown or end position of every episode, metres (NaN: none).
    generations : int array, shape (E,)
        Generation of every episode; 0 is the imitation alone.
    milestones : tuple of (int, MotionPlan or CartesianPlan)
        Episodes that were the best so far, each with its plan: the imitation, up to three on the
        way, the best.
    """

    plan: AnyPlan
    time: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    returns: FloatArray
    misses: FloatArray
    outcome: FloatArray
    outcome_before: FloatArray
    object_path: FloatArray
    tool_path: FloatArray
    success: bool
    miss_before: float
    miss: float
    orientation_error: float = float("nan")
    failure: str = ""
    outcomes: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    generations: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    milestones: tuple[tuple[int, AnyPlan], ...] = ()

    def __post_init__(self) -> None:
        # What an older record does not have is not known of any episode.
        n = len(self.returns)
        if n and not len(self.outcomes):
            object.__setattr__(self, "outcomes", np.full((n, 3), np.nan))
        if n and not len(self.generations):
            object.__setattr__(self, "generations", np.zeros(n))
        freeze(
            self,
            {
                "time": ("T",),
                "positions": ("T", "n"),
                "velocities": ("T", "n"),
                "accelerations": ("T", "n"),
                "returns": ("E",),
                "misses": ("E",),
                "outcome": (3,),
                "outcome_before": (3,),
                "object_path": ("F", 3),
                "tool_path": ("T", 3),
                "outcomes": ("E", 3),
                "generations": ("E",),
            },
            generations=np.int64,
        )
