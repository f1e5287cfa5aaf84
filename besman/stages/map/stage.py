"""The stage that maps demonstrations to an arm, or to two."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from besman.config.stage import Config, Items, NotNegative, Positive, Stage, Truth, Work
from besman.records import HandTrajectory
from besman.robot.model import Robot

if TYPE_CHECKING:
    from besman.stages.map.demonstration import MappingSettings
    from besman.stages.map.mapping import Mapping


class PlacementWeights(Config):
    """Weights of the cost of a placement; `besman.stages.map.terms.TermWeights` says of what."""

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
    ) -> Mapping:
        """Return a `besman.stages.map.map_demonstrations.Mapping`."""
        from besman.stages.map.map_demonstrations import map_embodiment

        return map_embodiment(demonstrations, robot, self.settings, work)

    def items(self, demonstrations: tuple[HandTrajectory, ...], robot: Robot) -> Items:
        """Count the demonstrations."""
        return Items(len(demonstrations), "demos")

    def figures(self, mapping: Mapping, truth: Truth, *records: Any) -> dict[str, Any]:
        """Return how well the arm can follow; see `map_results`."""
        return map_results(mapping)

    @property
    def settings(self) -> MappingSettings:
        """The settings as the algorithms take them."""
        from besman.robot.inverse_kinematics import IkWeights
        from besman.stages.map.demonstration import MappingSettings
        from besman.stages.map.terms import TermWeights

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


@dataclass(frozen=True)
class MapBothArms:
    """The same for a robot with two arms and a person's two hands.

    Attributes
    ----------
    config : MapConfig
    """

    config: MapConfig

    def run(
        self,
        demonstrations: tuple[HandTrajectory, ...],
        others: tuple[HandTrajectory, ...],
        robot: Robot,
        other_robot: Robot,
        work: Work = Work(),
    ) -> tuple[Mapping, Mapping]:
        """Return a `besman.stages.map.map_demonstrations.Mapping` for each arm."""
        from besman.stages.map.two_arms import map_two_arms

        hands, robots = (demonstrations, others), (robot, other_robot)
        return map_two_arms(hands, robots, self.config.settings, work)

    def items(
        self,
        demonstrations: tuple[HandTrajectory, ...],
        others: tuple[HandTrajectory, ...],
        *robots: Robot,
    ) -> Items:
        """Count the demonstrations of both hands."""
        return Items(len(demonstrations) + len(others), "demos")

    def figures(
        self, mappings: tuple[Mapping, Mapping], truth: Truth, *records: Any
    ) -> tuple[dict[str, Any], ...]:
        """Return how well each arm can follow; see `map_results`."""
        return tuple(map_results(mapping) for mapping in mappings)


def map_results(mapping: Mapping) -> dict[str, Any]:
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
