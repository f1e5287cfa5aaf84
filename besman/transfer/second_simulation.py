"""A second simulation in place of the real arm: its dynamics are not those that motions know."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.perturbation import Spreads, draw_perturbation
from besman.simulation.perturbed_trials import try_perturbed
from besman.simulation.task import Task

FloatArray = npt.NDArray[np.float64]

# Most of the gap comes from smoothed set-points: URScript's servoj looks 0.03 to 0.2 s ahead.
REAL_SPREADS = Spreads(
    friction_share=0.6,
    object_mass_share=0.3,
    link_mass_share=0.2,
    joint_friction_share=0.1,
    joint_damping_share=0.1,
    servo_gain_share=0.5,
    delay_s=0.02,
    lag_s=0.2,
    backlash_rad=0.005,
    offset_rad=0.02,
    noise_rad=0.0005,
)


class SecondSimulation:
    """An arm whose dynamics nobody was told; its noise is another one at every try.

    Parameters
    ----------
    robot : Robot
        The arm as it is known.
    task : Task
        What it does.
    seed : int
        Of the differences.
    spreads : Spreads
        How far it is off.
    """

    def __init__(
        self, robot: Robot, task: Task, seed: int, spreads: Spreads = REAL_SPREADS
    ) -> None:
        self._robot, self._task, self._seed = robot, task, seed
        self._world = draw_perturbation(spreads, robot, (seed,))
        self.n_tries = 0

    def execute(self, plan: AnyPlan) -> FloatArray:
        """Try a motion; return where it came down (2,), metres, NaN if it did not."""
        noise = (self._seed, self.n_tries)
        self.n_tries += 1
        world = replace(self._world, noise_seed=noise)
        (trial,) = try_perturbed(self._robot, self._task, plan, [world])
        return np.where(trial.failure == "", trial.outcome[:2], np.nan)
