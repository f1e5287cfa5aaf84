"""The sections of a lever task's YAML."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from besman.config.stage import Config, NotNegative, Positive
from besman.simulation.task import (
    ContactSimulationConfig,
    RewardConfig,
    SuccessConfig,
    Task,
    Triple,
)


class LeverSimulationConfig(ContactSimulationConfig):
    """How pulling is computed.

    Attributes
    ----------
    time_step_s, contact_time_s
        See `ContactSimulationConfig`.
    settling_s : float
        The lever is looked at this long after the end of the movement.
    """

    settling_s: NotNegative = 0.2


class LeverRewardConfig(RewardConfig):
    """Reward of pulling: minus the sum of these terms and those of `RewardConfig`.

    Attributes
    ----------
    miss_per_m : float
        Times the arc that the handle's way is short of `pull_deg`.
    slip_per_m : float
        Times the distance between hook and handle at the end.
    """

    miss_per_m: NotNegative = 5.0
    slip_per_m: NotNegative = 1.0


class LeverSuccessConfig(SuccessConfig):
    """Pulling succeeds if the handle's way is at most this much short of `pull_deg`."""

    success_radius_m: Positive = 0.02


class LeverConfig(Config):
    """The lever: a bar with a handle across its end, on a horizontal hinge.

    Attributes
    ----------
    length_m : float
        From the hinge's axis to the handle's.
    handle_length_m, handle_radius_m : float
        Of the handle.
    bar_side : "left" or "right"
        End of the handle that the bar is at, seen by who pulls; the other leaves room for the arm.
    mass_kg : float
        Spread evenly along the bar.
    friction_nm : float
        Torque of the hinge's dry friction; enough to hold the lever where it is.
    damping_nms : float
        Torque per rad/s of its viscous friction.
    pull_deg : float
        How far it is to be pulled.
    stop_deg : float
        Where it comes to a stop.
    offset_m : triple of float
        Where it stands off the demonstrated place, metres in the robot's world.
    """

    length_m: Positive = 0.28
    handle_length_m: Positive = 0.2
    handle_radius_m: Positive = 0.012
    bar_side: Literal["left", "right"] = "left"
    mass_kg: Positive = 1.0
    friction_nm: NotNegative = 8.0
    damping_nms: NotNegative = 0.5
    pull_deg: Annotated[float, Field(gt=0, lt=170)] = 50.0
    stop_deg: Annotated[float, Field(gt=0, lt=180)] = 100.0
    offset_m: Triple = (0.0, 0.0, 0.0)


class HookConfig(Config):
    """The hook: rods behind, over and in front of the handle, open towards TCP x.

    Attributes
    ----------
    rod_radius_m : float
        Of each rod.
    clearance_m : float
        Between rods and a handle whose axis is at the TCP.
    tip_m : float
        How far the rod in front reaches beyond the handle's axis.
    friction : float
        Coefficient of sliding friction between hook and handle.
    """

    rod_radius_m: Positive = 0.008
    clearance_m: NotNegative = 0.008
    tip_m: NotNegative = 0.01
    friction: NotNegative = 0.3


class PullLeverFields(Task):
    """What a task file says of a lever that is pulled beyond an angle.

    Attributes
    ----------
    kind : "pull_lever"
    tool : str
        Tool of the robot that is the hook: its TCP is the handle's axis, TCP z points ahead and
        TCP x where the hook is open.
    lever, hook, simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["pull_lever"]
    tool: str = "hook"
    lever: LeverConfig = LeverConfig()
    hook: HookConfig = HookConfig()
    simulation: LeverSimulationConfig = LeverSimulationConfig()
    reward: LeverRewardConfig = LeverRewardConfig()
    success: LeverSuccessConfig = LeverSuccessConfig()
