"""The sections of a rearranging task's YAML."""

from __future__ import annotations

from itertools import product
from typing import Annotated, Literal

from pydantic import Field

from besman.config.stage import Config, NotNegative, Positive
from besman.simulation.task import SuccessConfig, TrackingFailureConfig
from besman.simulation.tasks.grasp_box.sections import GraspSimulationConfig, GripperConfig


class CarriedBoxConfig(Config):
    """The boxes that are carried: one size for all.

    Attributes
    ----------
    size_m : triple of float
        Depth (ahead of the gripper), width (between its fingers), height.
    mass_kg : float
        Spread evenly.
    centre_m : triple of float, optional
        Its middle in the frame of its markers: origin in their centroid, x from the first to the
        last of them, level, z up, metres. null: where the gripper closes, in the median over all
        demonstrations.
    turn_deg : float, optional
        How its depth is turned against that frame, to the left. null: square to the fingers, in the
        median over all demonstrations.
    """

    size_m: tuple[Positive, Positive, Positive] = (0.08, 0.10, 0.18)
    mass_kg: Positive = 0.4
    centre_m: tuple[float, float, float] | None = None
    turn_deg: Annotated[float, Field(ge=-180, le=180)] | None = None


class BoardConfig(Config):
    """A board below each place of a box, its front edge where the gripper comes from.

    A recording shows neither shelf nor table: no more is there than what a box stands on.

    Attributes
    ----------
    depth_m, width_m, thickness_m : float
        Of the board.
    front_m : float
        From the middle of the box to the front edge.
    friction : float
        Coefficient of sliding friction between box and board.
    """

    depth_m: Positive = 0.1
    width_m: Positive = 0.12
    thickness_m: Positive = 0.02
    front_m: Positive = 0.05
    friction: NotNegative = 0.4


class GraspConfig(Config):
    """How the gripper comes to a box and leaves it; see `besman.motion.grasp_goals.GraspWay`.

    Attributes
    ----------
    pitch_deg : float
        How far the gripper points down.
    before_m, after_m : float
        How long the straight ways along the gripper's own axis are.
    up_m : float
        How long those straight up and down are.
    straight_s : float
        How long each takes.
    higher_m : float
        How much higher the arm goes in the middle of all other ways.
    posture : int
        0: the arm's postures at box and place follow from those that were shown; k: the k-th of
        all there are, those first that change the blocks least.
    """

    pitch_deg: Annotated[float, Field(ge=-45, le=45)] = 10.0
    before_m: Positive = 0.1
    after_m: Positive = 0.15
    up_m: Positive = 0.05
    straight_s: Positive = 1.0
    higher_m: NotNegative = 0.0
    posture: Annotated[int, Field(ge=0)] = 0


class WaysConfig(Config):
    """Which other ways there are, where a task does not succeed as it is.

    All combinations, the first values first, the last key fastest; see `GraspConfig`.

    Attributes
    ----------
    pitch_deg, after_m, higher_m : tuple of float
    posture : tuple of int
    before_m : tuple of float
        Values of these keys.
    """

    pitch_deg: Annotated[tuple[float, ...], Field(min_length=1)] = (10.0, 20.0, 0.0)
    after_m: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.15, 0.2)
    higher_m: Annotated[tuple[NotNegative, ...], Field(min_length=1)] = (0.0, 0.08, 0.16)
    posture: Annotated[tuple[Annotated[int, Field(ge=0)], ...], Field(min_length=1)] = (0, 1, 2, 3)
    before_m: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.1, 0.2)

    def list(self, shown: GraspConfig) -> list[GraspConfig]:
        """Return all but the one that is shown."""
        keys = tuple(type(self).model_fields)
        found = [
            shown.model_copy(update=dict(zip(keys, values, strict=True)))
            for values in product(*(getattr(self, key) for key in keys))
        ]
        return [one for one in found if one != shown]


class TaskSearchConfig(Config):
    """How a task is refined that does not succeed as it was brought to its boxes.

    Attributes
    ----------
    by : "ways" or "blocks"
        What comes first; the other follows where that does not succeed. ways: other `ways` of the
        whole task are simulated; blocks: taking the box, putting it, leaving it are searched one
        after the other, each from the state of the simulation in which the one before has ended.
    episodes : int
        Of each part at most.
    sigma : float
        First standard deviation; 1: 2 cm, 9 degrees.
    seed : int
    """

    by: Literal["ways", "blocks"] = "ways"
    episodes: Annotated[int, Field(ge=1)] = 60
    sigma: Positive = 0.5
    seed: Annotated[int, Field(ge=0)] = 0


class WaitConfig(Config):
    """What the gripper's commands take: the arm stands still meanwhile.

    Attributes
    ----------
    closing_s, opening_s : float
        How long it waits after each command.
    settle_s : float
        After the end of the movement.
    """

    closing_s: Positive = 0.7
    opening_s: Positive = 0.8
    settle_s: NotNegative = 0.5


class RearrangeFailureConfig(TrackingFailureConfig):
    """What counts as a failed episode besides.

    Attributes
    ----------
    greatest_tracking_error_rad : float
        Greatest deviation of any joint from the movement.
    greatest_fall_m : float
        How far a box sinks after it is let go of; more is dropped.
    """

    greatest_fall_m: Positive = 0.03


class RearrangeSuccessConfig(SuccessConfig):
    """Every box stands so near to where the person put it, so little turned or tilted."""

    success_radius_m: Positive = 0.02
    success_angle_deg: Positive = 10.0


class RearrangeFields(Config):
    """What a task file says of boxes that are carried from place to place.

    Attributes
    ----------
    kind : "rearrange"
    tool : str
        Tool of the robot that is the gripper: as of `grasp_box`.
    box, board, gripper, grasp, ways, search, wait, simulation, failure, success
        See the classes.
    """

    kind: Literal["rearrange"]
    tool: str = "gripper3"
    box: CarriedBoxConfig = CarriedBoxConfig()
    board: BoardConfig = BoardConfig()
    gripper: GripperConfig = GripperConfig()
    grasp: GraspConfig = GraspConfig()
    ways: WaysConfig = WaysConfig()
    search: TaskSearchConfig = TaskSearchConfig()
    wait: WaitConfig = WaitConfig()
    simulation: GraspSimulationConfig = GraspSimulationConfig()
    failure: RearrangeFailureConfig = RearrangeFailureConfig()
    success: RearrangeSuccessConfig = RearrangeSuccessConfig()
