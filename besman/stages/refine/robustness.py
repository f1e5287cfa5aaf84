"""How refined motions stand a wrong model, and a finer time step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.config.stage import Config, Items, Stage, Truth, Work
from besman.records import AnyPlan, Record, RefinedMotion, freeze
from besman.robot.model import Robot
from besman.simulation.perturbation import (
    Perturbation,
    Spreads,
    draw_perturbation,
    draw_two_level,
)
from besman.simulation.task import Task

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# Sets the models of the search apart from all that judge, whatever their seed.
_OF_THE_SEARCH = 1_000_000
# Processes begin in the time of so many episodes; see `besman.stages.refine.stage`.
_EPISODES_FOR_PROCESSES = 200


def _name_of_plan(tried: tuple[AnyPlan, float]) -> str:
    return tried[0].name


class RobustConfig(Config):
    """In which perturbed models a motion is searched, all motions in the same.

    Attributes
    ----------
    models : int
        How many, besides the model as it is.
    seed : int
        Of their draw; they are never those that judge (`RobustnessConfig`).
    spreads : Spreads
        How far off they are.
    """

    models: Annotated[int, Field(ge=2, le=64)] = 8
    seed: Annotated[int, Field(ge=0)] = 0
    spreads: Spreads = Spreads()

    def draw(self, robot: Robot) -> tuple[Perturbation, ...]:
        """Draw the models."""
        return draw_two_level(self.spreads, robot, (self.seed, _OF_THE_SEARCH), self.models)


@dataclass(frozen=True, eq=False)
class Robustness(Record, stored_as="besman.refinement.robustness:Robustness"):
    """What comes of one motion where the model is wrong.

    Attributes
    ----------
    name : str
        Of the motion.
    success : bool array, shape (R,)
        Whether it succeeds in each of R perturbed models.
    misses : array, shape (R,)
        Distance to the target there, metres; NaN where the episode failed.
    shift : float
        Distance between the outcomes at the task's time step and at a quarter of it, metres; NaN
        without an outcome.
    """

    name: str
    success: BoolArray
    misses: FloatArray
    shift: float

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        freeze(self, {"success": ("R",), "misses": ("R",)}, success=bool)


class RobustnessConfig(Stage):
    """Try every refined motion in perturbed models and at a quarter of the time step.

    Attributes
    ----------
    models : int
        How many perturbed models, the same for every motion; 0 for the finer time step alone.
    seed : int
        Of the perturbations.
    spreads : Spreads
        How far off the models are.
    """

    models: Annotated[int, Field(ge=0)] = 20
    seed: Annotated[int, Field(ge=0)] = 0
    spreads: Spreads = Spreads()

    leaves_out: ClassVar[bool] = True

    def items(self, motions: tuple[RefinedMotion, ...], *others: Any) -> Items:
        """Count the motions."""
        return Items(len(motions), "motions")

    def figures(self, found: tuple[Robustness, ...], truth: Truth, *records: Any) -> dict[str, Any]:
        """Return the figures of all motions together; see `robustness_results`."""
        return robustness_results(found)

    def run(
        self,
        motions: tuple[RefinedMotion, ...],
        robot: Robot,
        task: Task,
        work: Work = Work(),
    ) -> tuple[Robustness, ...]:
        """Try refined motions.

        Parameters
        ----------
        motions : tuple of RefinedMotion
            What refinement gave.
        robot : Robot
            With the task's tool.
        task : Task
            What they are refined for.
        work : Work
            Threads, processes and progress.

        Returns
        -------
        tuple of Robustness
            In the order of the motions.
        """
        tried = [
            (motion.plan, float(np.linalg.norm(motion.finer_outcome - motion.outcome)))
            for motion in motions
        ]
        examine = partial(self._examine, robot=robot, task=task)
        processes = max(2, _EPISODES_FOR_PROCESSES // (self.models + 5))
        return tuple(work.map(examine, tried, name=_name_of_plan, processes=processes, some=False))

    def _examine(self, tried: tuple[AnyPlan, float], robot: Robot, task: Task) -> Robustness:
        """Try one motion's plan, whose shift the search may know: NaN if it does not."""
        from besman.simulation.perturbed_trials import quarter_step_shift, try_perturbed

        plan, shift = tried
        worlds = [
            draw_perturbation(self.spreads, robot, (self.seed, index))
            for index in range(self.models)
        ]
        trials = try_perturbed(robot, task, plan, worlds)
        misses = [np.nan if trial.failure else trial.miss for trial in trials]
        return Robustness(
            name=plan.name,
            success=np.array([trial.success for trial in trials], dtype=np.bool_),
            misses=np.array(misses, dtype=np.float64),
            shift=quarter_step_shift(robot, task, plan) if np.isnan(shift) else shift,
        )


def robustness_results(found: Sequence[Robustness]) -> dict[str, Any]:
    """Give the figures of all motions together for ``results.json``.

    Parameters
    ----------
    found : sequence of Robustness

    Returns
    -------
    dict
        models, success_share (of all motions in all models), miss_m {median, p95} of the episodes
        that did not fail, failed_share, shift_at_quarter_step_m {median, max}; null where nothing
        has a value.
    """
    misses = np.concatenate([[], *(one.misses for one in found)])
    success = np.concatenate([[], *(one.success for one in found)])
    shifts = np.array([one.shift for one in found])
    finite, moved = misses[np.isfinite(misses)], shifts[np.isfinite(shifts)]
    return {
        "models": len(found[0].success) if found else 0,
        "success_share": float(success.mean()) if len(success) else None,
        "failed_share": float(np.isnan(misses).mean()) if len(misses) else None,
        "miss_m": {
            "median": float(np.median(finite)) if len(finite) else None,
            "p95": float(np.quantile(finite, 0.95)) if len(finite) else None,
        },
        "shift_at_quarter_step_m": {
            "median": float(np.median(moved)) if len(moved) else None,
            "max": float(moved.max()) if len(moved) else None,
        },
    }
