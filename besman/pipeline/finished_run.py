"""What a run that is done holds: its recipe, trained models; robot, task and refined motions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from besman.config.yaml_file import load_config
from besman.exceptions import RunError
from besman.pipeline.config import PipelineConfig
from besman.pipeline.stored_run import open_run
from besman.records import RefinedMotion
from besman.robot.model import Robot, load_robot
from besman.simulation.task import Task
from besman.simulation.tasks.kinds import load_task


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """What templates need of a run.

    Attributes
    ----------
    labels : three str
        Robot, tool and task as in its pipeline.
    robot : Robot
    task : Task
    motions : tuple of RefinedMotion
    """

    labels: tuple[str, str, str]
    robot: Robot
    task: Task
    motions: tuple[RefinedMotion, ...]


def read_recipe(folder: Path) -> PipelineConfig:
    """Read the recipe of a run.

    Raises
    ------
    RunError, ConfigError
        If the folder is not a run, or its ``pipeline.yaml`` was changed.
    """
    path = folder / "pipeline.yaml"
    if not path.is_file():
        raise RunError(f"{folder}: not a run: pipeline.yaml is missing")
    return load_config(path, PipelineConfig)


def read_run(folder: Path) -> FinishedRun:
    """Read robot, task and refined motions of a run.

    Raises
    ------
    RunError
        If the folder is not a run, or holds no refined motions.
    """
    config, run = read_recipe(folder), open_run(folder, needs_state=False)
    if "refine" not in run.stages:
        raise RunError(f"{folder}: no refined motions here: expected a finished run, NN_refine")
    robot, task = load_robot(config.robot, config.tool), load_task(config.task)
    labels = (config.robot, config.tool, config.task)
    return FinishedRun(labels, robot, task, run.record("refine"))


def trained_model(folder: Path, stage: str = "train") -> Any:
    """Load the trained model of a run.

    Parameters
    ----------
    folder : Path
        The run.
    stage : str
        ``train``, or ``train_actions`` for the actions of ``compose``.

    Raises
    ------
    RunError
        If the folder is not a run, or its training has not been done.
    """
    run = open_run(folder, needs_state=False)
    if stage not in run.stages:
        raise RunError(f"{folder}: no trained model here: expected a run folder with NN_{stage}")
    return run.record(stage)
