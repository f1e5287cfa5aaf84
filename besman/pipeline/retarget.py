"""New demonstrations for one or several robots: a run folder each, and no end if one fails."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from besman.config.resources import robot_title
from besman.config.settings import own_file
from besman.exceptions import ConfigError, RunError
from besman.pipeline.config import PipelineConfig
from besman.pipeline.finished_run import read_recipe, trained_model
from besman.pipeline.pipeline import run_pipeline
from besman.work.display import Display
from besman.work.outcome import describe_error


@dataclass(frozen=True)
class RetargetPlan:
    """What is to be done for one robot.

    Attributes
    ----------
    name : str
        Of the robot.
    config : PipelineConfig
        The recipe.
    folder : Path
        The run folder.
    """

    name: str
    config: PipelineConfig
    folder: Path


@dataclass(frozen=True)
class Retargeted:
    """What came of it.

    Attributes
    ----------
    plan : RetargetPlan
    error : Exception, optional
        Why there is no result.
    """

    plan: RetargetPlan
    error: Exception | None = None


def plan_retargeting(
    run: Path,
    recordings: list[Path],
    robots: tuple[str, ...],
    out: Path | None,
    tool: str | None = None,
) -> tuple[RetargetPlan, ...]:
    """Return what is to be done for each robot.

    Parameters
    ----------
    run : Path
        A finished run.
    recordings : list of Path
        Files or folders.
    robots : tuple of str
        Names or paths of robot.yaml; none: the run's own robot.
    out : Path, optional
        The run folder of one robot, the folder of the run folders of several.
    tool : str, optional
        Another tool than the run's.

    Raises
    ------
    RunError, ConfigError
        If the folder is not a run, or two robots have one name.
    """
    plans = []
    for robot in robots or (None,):
        config = retarget_pipeline(run, recordings, robot, tool)
        name = robot_title(config.robot)
        folder = out or run.with_name(f"{run.name}_{name}_{recordings[0].stem}")
        if out is not None and len(robots) > 1:
            folder = out / name
        plans.append(RetargetPlan(name, config, folder))
    twice = [name for name, n in Counter(plan.name for plan in plans).items() if n > 1]
    if twice:
        raise ConfigError(f"--robot: got {twice[0]!r} twice; expected each robot once")
    return tuple(plans)


def retarget_pipeline(
    folder: Path, recordings: list[Path], robot: str | None = None, tool: str | None = None
) -> PipelineConfig:
    """Return a finished run's recipe for other recordings, and maybe another robot.

    Parameters
    ----------
    folder : Path
        The run.
    recordings : list of Path
        Files or folders.
    robot : str, optional
        A robot's name or the path of a robot.yaml.
    tool : str, optional
        One of its tools.

    Raises
    ------
    RunError, ConfigError
        If the folder is not a run or the robot is not there.
    """
    config = read_recipe(folder)
    if config.recognize.learns:
        trained_model(folder)
    changes: dict[str, Any] = {
        "recordings": tuple(str(path.resolve()) for path in recordings),
        "training": (),
    }
    if robot is not None:
        changes["robot"] = own_file(robot, Path.cwd())
    if tool is not None:
        changes["tool"] = tool
    return config.model_copy(update=changes)


def retarget_robots(
    plans: tuple[RetargetPlan, ...],
    run: Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    display: Display | None = None,
) -> tuple[Retargeted, ...]:
    """Run the pipeline for each robot; what fails for one does not stop the others.

    Parameters
    ----------
    plans : tuple of RetargetPlan
    run : Path
        The run whose trained models are used.
    jobs, cluster, display
        As in `besman.pipeline.pipeline.run_pipeline`.

    Returns
    -------
    tuple of Retargeted
        In the order of the plans.
    """
    done = []
    for plan in plans:
        try:
            run_pipeline(
                plan.config,
                plan.folder,
                jobs=jobs,
                cluster=cluster,
                display=_named(display, plan.name) if len(plans) > 1 else display,
                trained_in=run,
            )
        except Exception as error:
            done.append(Retargeted(plan, error))
        else:
            done.append(Retargeted(plan))
    return tuple(done)


def _named(display: Display | None, robot: str) -> Display | None:
    """Show the robot's name beside a stage's."""
    return None if display is None else lambda stage: display(f"{robot} {stage}")


def raise_failures(done: tuple[Retargeted, ...]) -> None:
    """Raise what failed.

    Parameters
    ----------
    done : tuple of Retargeted

    Raises
    ------
    Exception
        The error itself, if there was one robot.
    RunError
        Which robots failed and why, if there were several.
    """
    failed = [one for one in done if one.error is not None]
    if len(done) == 1 and failed:
        error = failed[0].error
        assert error is not None
        raise error
    if failed:
        reasons = "; ".join(
            f"{one.plan.name}: {describe_error(one.error)}" for one in failed if one.error
        )
        raise RunError(f"retarget: {len(failed)} of {len(done)} robots failed: {reasons}")
