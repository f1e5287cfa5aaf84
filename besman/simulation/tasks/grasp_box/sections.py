"""The sections of a grasping task's YAML."""

from __future__ import annotations

from besman.config.stage import Config, NotNegative, Positive
from besman.simulation.task import ContactSimulationConfig, RewardConfig, SuccessConfig, TimeStep


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
