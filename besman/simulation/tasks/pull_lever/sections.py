"""The sections of a lever task's YAML."""

from __future__ import annotations

from besman.config.stage import NotNegative, Positive
from besman.simulation.task import ContactSimulationConfig, RewardConfig, SuccessConfig


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
