"""The stages that select demonstrations and map them to an arm."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from besman.manual_segments import Side
from besman.mapping.body_points import GapLimits
from besman.mapping.record import Selected, map_record, select_segments
from besman.records import HandTrajectory, LabelledRecording, LabelledSegments
from besman.robot.model import Robot
from besman.stage import Config, Stage, Work

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class SelectConfig(Stage):
    """Take the segments of one class as demonstrations (record mapping).

    Attributes
    ----------
    label : str, optional
        The class of a building block, e.g. ``throw``.
    action : str, optional
        In place of `label`: an action that stage ``compose`` finds.
    object : str, optional
        Marker of an object that is thrown; where it comes down becomes the target.
    arm : "right" or "left"
        The arm whose hand is followed.
    least_duration_s, greatest_duration_s : float
        Shorter and longer segments are left out, seconds.
    merge : bool
        Join segments of the class that touch: a movement that was cut in two.
    cutoff_hz : float
        Of the low-pass filter over the markers.
    rate_hz : float
        Samples per second of the demonstrations.
    longest_gap_s : float
        Gaps of back and hand markers up to this length are filled by a spline, seconds.
    longest_rigid_gap_s : float
        Gaps up to this length are filled where the other two markers of the cluster are seen. A
        segment with a longer gap is no demonstration, and is listed with the reason.
    object_in_hand_m : three float, optional
        Where what is held sits in the hand, metres: the robot's tool centre point follows it, in
        place of the point that the robot's tool says (``hand_to_tcp_m``). The hand's frame has its
        origin in the centroid of the three hand markers, x towards the fingers (from the middle of
        ``hand_left`` and ``hand_right`` to ``hand_top``) and z out of the back of the hand, so that
        y points to the person's left while the palm is down and the fingers forward.
    object_in_hand_wxyz : four float, optional
        How it is turned in the hand's frame: the tool's axes follow its axes, in place of
        ``hand_to_tcp_wxyz``. The tool points along z.
    """

    method: Literal["label"] = "label"
    label: str | None = None
    action: str | None = None
    object: str | None = None
    arm: Side = "right"
    least_duration_s: NotNegative = 0.0
    greatest_duration_s: Positive = 10.0
    merge: bool = False
    cutoff_hz: Positive = 10.0
    rate_hz: Positive = 100.0
    longest_gap_s: NotNegative = 0.25
    longest_rigid_gap_s: NotNegative = 1.0
    object_in_hand_m: tuple[float, float, float] | None = None
    object_in_hand_wxyz: tuple[float, float, float, float] | None = None

    @field_validator("object_in_hand_wxyz")
    @classmethod
    def _check_turn(cls, turn: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if turn is not None and not np.linalg.norm(turn) > 1e-6:
            raise ValueError("a quaternion of zero turns nothing; (1, 0, 0, 0) leaves it as it is")
        return turn

    @model_validator(mode="after")
    def _check_choice(self) -> SelectConfig:
        if (self.label is None) == (self.action is None):
            raise ValueError(
                "expected one of label and action, got "
                + ("none" if self.label is None else "both")
            )
        return self

    @property
    def wanted(self) -> str:
        """The class that is taken, be it a building block or an action."""
        return self.label or self.action or ""

    @property
    def grasp(self) -> np.ndarray:
        """What the tool centre point is to follow, shape (7,); see `HandTrajectory`."""
        place = (np.nan,) * 3 if self.object_in_hand_m is None else self.object_in_hand_m
        turn = (np.nan,) * 4 if self.object_in_hand_wxyz is None else self.object_in_hand_wxyz
        return np.concatenate([place, np.array(turn) / np.linalg.norm(turn)])

    @property
    def other_arm(self) -> SelectConfig:
        """The same for the person's other hand; nothing is thrown with it."""
        return self.model_copy(
            update={"arm": "left" if self.arm == "right" else "right", "object": None}
        )

    def run(
        self,
        recordings: tuple[LabelledRecording, ...],
        segments: tuple[LabelledSegments, ...],
        work: Work = Work(),
    ) -> tuple[HandTrajectory, ...]:
        """Return the demonstrations, hand poses in the person's back frame."""
        chosen = select_segments(
            segments,
            self.wanted,
            merge=self.merge,
            least_duration_s=self.least_duration_s,
            greatest_duration_s=self.greatest_duration_s,
        )

        def take(one: Selected) -> HandTrajectory:
            recording = recordings[one.recording]
            return map_record(
                recording,
                (one.start, one.stop),
                self.wanted,
                name=f"{recording.source}:{one.segment}",
                cutoff_hz=self.cutoff_hz,
                rate_hz=self.rate_hz,
                thrown=self.object,
                side=self.arm,
                gaps=GapLimits(self.longest_gap_s, self.longest_rigid_gap_s),
                grasp=self.grasp,
            )

        # Sending recordings would take longer than reading a movement out of them.
        here = replace(work, jobs=1, workers=None)
        return tuple(
            here.map(
                take, chosen, name=lambda one: f"{recordings[one.recording].source}:{one.segment}"
            )
        )


class PlacementWeights(Config):
    """Weights of the cost of a placement; `besman.mapping.terms.TermWeights` says of what."""

    position: NotNegative = 1.0
    orientation: NotNegative = 0.3
    singularity: NotNegative = 1.0
    collision: NotNegative = 3.0
    speed: NotNegative = 3.0
    workspace: NotNegative = 1.0
    height: NotNegative = 0.3
    scale: NotNegative = 0.5


class MapConfig(Stage):
    """Place all demonstrations in the workspace of an arm and solve for its joints.

    Attributes
    ----------
    weights : PlacementWeights
        What a good placement is.
    orientation_weight_m_rad : float
        One radian of orientation error weighs as much as this many metres, where the arm cannot
        have both.
    free_axis_spin : bool
        The rotation about the tool's axis does not matter, e.g. for a stick.
    optimizer : "cma_es" or "differential_evolution"
        What searches for the placement.
    evaluations : int
        Placements to try.
    yaw : bool
        Demonstrations may be turned about the vertical.
    scale : pair of float, optional
        Least and greatest factor by which movements may be made smaller or larger; null: none.
    placement_demonstrations : int
        Of more demonstrations than this, as many are looked at in the search.
    correct : bool
        A demonstration that the common placement does not serve gets one of its own.
    seed : int
        Of the search.
    knot_spacing_s : float
        Of the joint splines: shorter follows closer, longer is smoother.
    minimum_duration_s : float
        Shorter movements are slowed down to this duration.
    greatest_change_m, greatest_change_deg : float
        How far the tool may leave its path, by the smallest change that is enough, so that the
        arm's limits slow the movement down less; 0 for the path alone.
    greatest_error_m : float
        Beyond this position error a demonstration is not transferred.
    """

    method: Literal["embodiment"] = "embodiment"
    weights: PlacementWeights = PlacementWeights()
    orientation_weight_m_rad: Positive = 0.1
    free_axis_spin: bool = False
    optimizer: Literal["cma_es", "differential_evolution"] = "cma_es"
    evaluations: Annotated[int, Field(ge=1)] = 200
    yaw: bool = True
    scale: tuple[Positive, Positive] | None = None
    placement_demonstrations: Annotated[int, Field(ge=1)] = 64
    correct: bool = True
    seed: Annotated[int, Field(ge=0)] = 0
    knot_spacing_s: Positive = 0.05
    minimum_duration_s: NotNegative = 0.0
    greatest_change_m: NotNegative = 0.005
    greatest_change_deg: NotNegative = 5.0
    greatest_error_m: Positive = 0.05

    @field_validator("scale")
    @classmethod
    def _check_scale(cls, scale: tuple[float, float] | None) -> tuple[float, float] | None:
        if scale is not None and not scale[0] <= scale[1]:
            raise ValueError(f"got {list(scale)}, expected the least factor before the greatest")
        return scale

    def run(
        self, demonstrations: tuple[HandTrajectory, ...], robot: Robot, work: Work = Work()
    ) -> Any:
        """Return a `besman.mapping.embodiment.Mapping`."""
        from besman.mapping.embodiment import map_embodiment

        return map_embodiment(demonstrations, robot, self._settings(), work)

    def run_both(
        self,
        demonstrations: tuple[HandTrajectory, ...],
        others: tuple[HandTrajectory, ...],
        robot: Robot,
        other_robot: Robot,
        work: Work = Work(),
    ) -> Any:
        """Return a pair of `besman.mapping.embodiment.Mapping`, one for each arm."""
        from besman.mapping.two_arms import map_two_arms

        robots = (robot, other_robot)
        return map_two_arms((demonstrations, others), robots, self._settings(), work)

    def _settings(self) -> Any:
        from besman.mapping.demonstration import MappingSettings
        from besman.mapping.terms import TermWeights
        from besman.robot.inverse_kinematics import IkWeights

        return MappingSettings(
            terms=TermWeights(**self.weights.model_dump()),
            ik=IkWeights(orientation=self.orientation_weight_m_rad),
            free_spin=self.free_axis_spin,
            optimizer=self.optimizer,
            evaluations=self.evaluations,
            yaw=self.yaw,
            scale=self.scale,
            placement_demonstrations=self.placement_demonstrations,
            correct=self.correct,
            seed=self.seed,
            knot_spacing_s=self.knot_spacing_s,
            least_duration_s=self.minimum_duration_s,
            greatest_change_m=self.greatest_change_m,
            greatest_change_rad=float(np.radians(self.greatest_change_deg)),
            greatest_error_m=self.greatest_error_m,
        )


def map_results(mapping: Any) -> dict[str, Any]:
    """Return the figures of a mapping by the names of ``results.json``.

    Parameters
    ----------
    mapping : Mapping
        What `MapConfig.run` returned.

    Returns
    -------
    dict
        n_demonstrations, n_transferred, failed, corrected (placements of their own), scale,
        position_error_m and orientation_error_deg (mean, p95 and max over all samples),
        time_stretch (median, max), limit_violations and self_collisions (samples at 1 kHz),
        torque_ratio (the greatest share of a joint's torque limit).
    """
    trajectories = mapping.trajectories
    position = np.concatenate([one.position_error for one in trajectories])
    orientation = np.degrees(np.concatenate([one.orientation_error for one in trajectories]))
    stretch = np.array([one.time_stretch for one in trajectories])
    return {
        "n_demonstrations": len(trajectories) + len(mapping.failed),
        "n_transferred": len(trajectories),
        "failed": [asdict(one) for one in mapping.failed],
        "corrected": [asdict(one) for one in mapping.corrected],
        "scale": mapping.scale,
        "position_error_m": _spread(position),
        "orientation_error_deg": _spread(orientation),
        "time_stretch": {"median": float(np.median(stretch)), "max": float(stretch.max())},
        "limit_violations": mapping.limit_violations,
        "self_collisions": mapping.self_collisions,
        "torque_ratio": mapping.torque_ratio,
    }


def _spread(values: np.ndarray) -> dict[str, float]:
    """Return mean, 95th percentile and maximum."""
    return {
        "mean": float(values.mean()),
        "p95": float(np.percentile(values, 95)),
        "max": float(values.max()),
    }
