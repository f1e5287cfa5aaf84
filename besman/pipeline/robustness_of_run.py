"""Robustness of a finished run's motions, in as many perturbed models as wanted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from besman.pipeline.finished_run import read_run
from besman.stages.refine.robustness import Robustness, RobustnessConfig, robustness_results
from besman.work.work import Work


def check_robustness(
    run: Path, config: RobustnessConfig, work: Work = Work()
) -> tuple[tuple[Robustness, ...], dict[str, Any]]:
    """Try the refined motions of a run in perturbed models and at a quarter of the time step.

    Parameters
    ----------
    run : Path
        A finished run.
    config : RobustnessConfig
    work : Work
        Threads and progress.

    Returns
    -------
    found : tuple of Robustness
    results : dict
        Figures of all together, and of every motion, for a JSON file.

    Raises
    ------
    RunError
        If the folder is no finished run.
    """
    finished = read_run(run)
    found = config.run(finished.motions, finished.robot, finished.task, work)
    motions = [{"motion": one.name} | robustness_results([one]) for one in found]
    return found, {
        "run": run.name,
        "config": config.model_dump(mode="json"),
        **robustness_results(found),
        "motions": motions,
    }
