"""The stages that select demonstrations and map them to an arm."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from besman.manual_segments import Side
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
            )

        # Sending recordings would take longer than reading a movement out of them.
        here = replace(work, jobs=1, workers=None)
        return tuple(
            here.map(
                take, chosen, name=lambda one: f"{recordings[one.recording].source}:{one.segment}"
            )
        )


class PlacementWeights(Config):
    """Weights of the cost of a placement; `besman.mapping.placement.TermWeights` says of what."""

    position: NotNegative = 1.0
    orientation: NotNegative = 0.3
    singularity: NotNegative = 1.0
    collision: NotNegative = 3.0
    speed: NotNegative = 3.0
    workspace: NotNegative = 1.0
    height: NotNegative = 0.3


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
    evaluations : int
        Placements to try.
    seed : int
        Of the search.
    knot_spacing_s : float
        Of the joint splines: shorter follows closer, longer is smoother.
    minimum_duration_s : float
        Shorter movements are slowed down to this duration.
    greatest_error_m : float
        Beyond this position error a demonstration is not transferred.
    """

    method: Literal["embodiment"] = "embodiment"
    weights: PlacementWeights = PlacementWeights()
    orientation_weight_m_rad: Positive = 0.1
    free_axis_spin: bool = False
    evaluations: Annotated[int, Field(ge=1)] = 200
    seed: Annotated[int, Field(ge=0)] = 0
    knot_spacing_s: Positive = 0.05
    minimum_duration_s: NotNegative = 0.0
    greatest_error_m: Positive = 0.05

    def run(
        self, demonstrations: tuple[HandTrajectory, ...], robot: Robot, work: Work = Work()
    ) -> Any:
        """Return a `besman.mapping.embodiment.Mapping`."""
        from besman.mapping.embodiment import MappingSettings, map_embodiment
        from besman.mapping.placement import TermWeights
        from besman.robot.inverse_kinematics import IkWeights

        settings = MappingSettings(
            terms=TermWeights(**self.weights.model_dump()),
            ik=IkWeights(orientation=self.orientation_weight_m_rad),
            free_spin=self.free_axis_spin,
            evaluations=self.evaluations,
            seed=self.seed,
            knot_spacing_s=self.knot_spacing_s,
            least_duration_s=self.minimum_duration_s,
            greatest_error_m=self.greatest_error_m,
        )
        return map_embodiment(demonstrations, robot, settings, work)


def map_results(mapping: Any) -> dict[str, Any]:
    """Return the figures of a mapping by the names of ``results.json``.

    Parameters
    ----------
    mapping : Mapping
        What `MapConfig.run` returned.

    Returns
    -------
    dict
        n_demonstrations, n_transferred, failed, position_error_m and orientation_error_deg (mean,
        p95 and max over all samples), time_stretch (median, max), limit_violations and
        self_collisions (samples at 1 kHz).
    """
    trajectories = mapping.trajectories
    position = np.concatenate([one.position_error for one in trajectories])
    orientation = np.degrees(np.concatenate([one.orientation_error for one in trajectories]))
    stretch = np.array([one.time_stretch for one in trajectories])
    return {
        "n_demonstrations": len(trajectories) + len(mapping.failed),
        "n_transferred": len(trajectories),
        "failed": [asdict(one) for one in mapping.failed],
        "position_error_m": _spread(position),
        "orientation_error_deg": _spread(orientation),
        "time_stretch": {"median": float(np.median(stretch)), "max": float(stretch.max())},
        "limit_violations": mapping.limit_violations,
        "self_collisions": mapping.self_collisions,
    }


def _spread(values: np.ndarray) -> dict[str, float]:
    """Return mean, 95th percentile and maximum."""
    return {
        "mean": float(values.mean()),
        "p95": float(np.percentile(values, 95)),
        "max": float(values.max()),
    }
