"""The sections of a grasping task's YAML."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from besman.config.stage import Config, NotNegative, Positive
from besman.simulation.task import (
    ContactSimulationConfig,
    RewardConfig,
    SuccessConfig,
    Task,
    TimeStep,
    Triple,
)


class GraspSimulationConfig(ContactSimulationConfig):
    """How grasping is computed; a quarter of the step moves the lifted box by a millimetre."""

    time_step_s: TimeStep = 0.004
    contact_time_s: Positive = 0.008


class LiftConfig(Config):
    """What comes after the approach.

    Attributes
    ----------
    pause_s : float
        Between the end of the approach and the closing of the fingers.
    closing_s : float
        Between the start of the closing and the lift.
    height_m : float
        How high the box is lifted.
    lift_s : float
        Duration of the lift; longer if the arm's limits require it.
    hold_s : float
        How long it must be held then.
    """

    pause_s: NotNegative = 0.1
    closing_s: Positive = 0.7
    height_m: Positive = 0.12
    lift_s: Positive = 0.8
    hold_s: NotNegative = 0.3


class GraspRewardConfig(RewardConfig):
    """Reward of grasping: minus the sum of these terms and those of `RewardConfig`.

    Attributes
    ----------
    miss_per_m : float
        Times how much lower than wanted the box is held.
    distance_per_m : float
        Times the distance between the fingers' middle and the box's when the approach ends.
    tilt_per_rad : float
        Times the angle by which the box is tilted at the end.
    contact_per_finger : float
        Times the fingers that do not touch the box when the lift begins.
    """

    miss_per_m: NotNegative = 5.0
    distance_per_m: NotNegative = 2.0
    tilt_per_rad: NotNegative = 0.5
    contact_per_finger: NotNegative = 0.3


class GraspSuccessConfig(SuccessConfig):
    """Grasping succeeds if the box is held this close below its height, tilted at most so far."""

    success_radius_m: Positive = 0.03
    success_tilt_deg: Positive = 20.0


class BoxConfig(Config):
    """The box and where it stands.

    Attributes
    ----------
    size_m : triple of float
        Depth (ahead), width, height.
    mass_kg : float
        Spread evenly.
    place_m : triple of float or None
        Its middle in the robot's world, metres; null: where the demonstrated approach ends.
    shift_m : pair of float
        Where it is put on the shelf off that place: ahead and to the left, metres.
    turn_deg : float
        How far it is turned there about the vertical, to the left.
    spread_m : float
        Every motion plan is tried with the box there and this far ahead, behind, to the left and to
        the right of it, and must succeed everywhere; 0: there alone.
    """

    size_m: tuple[Positive, Positive, Positive] = (0.08, 0.10, 0.18)
    mass_kg: Positive = 0.4
    place_m: Triple | None = None
    shift_m: tuple[float, float] = (0.0, 0.0)
    turn_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    spread_m: Annotated[float, Field(ge=0, le=0.1)] = 0.025


class ApproachConfig(Config):
    """How a gripper comes to the box: its search begins with such a way, in place of the hand's.

    Attributes
    ----------
    square : bool
        Level, straight ahead and opposite the box's middle; false: as the hand was shown to come.
    straight_m : float
        Length of the straight way.
    back_m : float
        By how much the TCP stays in front of the box's middle.
    """

    square: bool = True
    straight_m: NotNegative = 0.08
    back_m: float = 0.02


class ShelfConfig(Config):
    """The board that the box stands on.

    Attributes
    ----------
    depth_m, width_m, thickness_m : float
        Of the board.
    overhang_m : float
        How far a box at its place reaches out over the board's front edge.
    friction : float
        Coefficient of sliding friction between box and board.
    """

    depth_m: Positive = 0.3
    width_m: Positive = 0.5
    thickness_m: Positive = 0.02
    overhang_m: NotNegative = 0.0
    friction: NotNegative = 0.4


class GripperConfig(Config):
    """The gripper; by default of the size and strength of a Robotiq 3-Finger.

    Attributes
    ----------
    opening_m : float
        Between thumb and fingers when open.
    speed_m_s : float
        At which each side closes.
    force_n : float
        Of the thumb, and of both fingers together.
    drag_n : float
        Dry friction of each drive, which holds a finger where it is.
    reach_m : pair of float
        From the TCP back to the palm and ahead to the fingertips.
    spacing_m : float
        Between the two fingers, along TCP y.
    finger_radius_m, finger_mass_kg : float
        Of each finger.
    friction : float
        Coefficient of sliding friction between finger and box.
    """

    opening_m: Positive = 0.155
    speed_m_s: Positive = 0.11
    force_n: Positive = 60.0
    drag_n: NotNegative = 10.0
    reach_m: tuple[Positive, Positive] = (0.07, 0.035)
    spacing_m: Positive = 0.06
    finger_radius_m: Positive = 0.01
    finger_mass_kg: Positive = 0.1
    friction: NotNegative = 0.8


class GraspBoxFields(Task):
    """What a task file says of a box that is taken from a shelf.

    Attributes
    ----------
    kind : "grasp_box"
    tool : str
        Tool of the robot that is the gripper: its TCP is the middle between the fingers, TCP z
        points ahead, and they close along TCP x.
    box, approach, shelf, gripper, lift, simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["grasp_box"]
    tool: str = "gripper3"
    box: BoxConfig = BoxConfig()
    approach: ApproachConfig = ApproachConfig()
    shelf: ShelfConfig = ShelfConfig()
    gripper: GripperConfig = GripperConfig()
    lift: LiftConfig = LiftConfig()
    simulation: GraspSimulationConfig = GraspSimulationConfig()
    reward: GraspRewardConfig = GraspRewardConfig()
    success: GraspSuccessConfig = GraspSuccessConfig()
