"""What an arm makes of the embedded throws: the usual recipe, with one motion refined."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from besman.config.resources import find_resource
from besman.exceptions import BesmanError, MappingError
from besman.pipeline.config import PipelineConfig, load_pipeline
from besman.pipeline.pipeline import run_pipeline
from besman.pipeline.stored_run import open_run
from besman.robot.model import Robot
from besman.work.display import Display

RECIPE = "ur5_stick_throw"
"""Its recordings, stages and task are what an arm is tried at."""

SHORT_M = 0.6
"""Reach below which a person's movements are made smaller from the start."""

SMALLEST = 0.2
_EPISODES = 200


@dataclass(frozen=True)
class ArmTrial:
    """What came of it.

    Attributes
    ----------
    folder : Path
        The run folder.
    config : PipelineConfig
        The recipe that was run last.
    scaled : bool
        Whether movements might be made smaller.
    error : str
        Why the run ended early, "" if it did not.
    """

    folder: Path
    config: PipelineConfig
    scaled: bool
    error: str = ""


def try_arm(
    robot: Robot, reach_m: float, folder: Path, jobs: int = 1, display: Display | None = None
) -> ArmTrial:
    """Take the embedded throws through all stages with an arm.

    Where the arm is short, or less than half can be mapped as they are, movements may be made
    smaller.

    Parameters
    ----------
    robot : Robot
        With the tool that it is to carry.
    reach_m : float
        Of the arm with its tool.
    folder : Path
        The run folder.
    jobs, display
        As in `besman.pipeline.pipeline.run_pipeline`.

    Returns
    -------
    ArmTrial

    Raises
    ------
    BesmanError
        If the run folder cannot be used; what a stage finds wrong is in the result.
    """
    short = reach_m < SHORT_M
    for scaled in (True,) if short else (False, True):
        config = trial_recipe(robot, scaled)
        try:
            run_pipeline(config, folder, jobs=jobs, display=display)
        except MappingError as error:
            if not scaled:
                continue
            return ArmTrial(folder, config, scaled, str(error))
        except BesmanError as error:
            if not (folder / "results.json").is_file():
                raise
            return ArmTrial(folder, config, scaled, str(error))
        if scaled or enough_mapped(folder):
            break
    return ArmTrial(folder, config, scaled)


def enough_mapped(folder: Path) -> bool:
    """Tell whether at least half of a run's demonstrations were mapped."""
    mapped = open_run(folder).read("results.json")["map"]
    return bool(2 * mapped["n_transferred"] >= mapped["n_demonstrations"])


def trial_recipe(robot: Robot, scaled: bool) -> PipelineConfig:
    """Return the recipe for an arm: one motion is refined, and not tried in perturbed models.

    Parameters
    ----------
    robot : Robot
    scaled : bool
        Whether movements may be made smaller.
    """
    recipe = load_pipeline(find_resource("pipelines", RECIPE))
    refine: dict[str, Any] = {"motions": 1, "episodes": _EPISODES, "robustness": None}
    scale = (SMALLEST, 1.0) if scaled else None
    return recipe.model_copy(
        update={
            "name": f"try_{robot.name}",
            "robot": robot.source,
            "tool": robot.tool.name,
            "map": recipe.map.model_copy(update={"scale": scale}),
            "refine": recipe.refine.model_copy(update=refine),
        }
    )
