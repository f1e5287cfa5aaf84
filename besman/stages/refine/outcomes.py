"""What trials tell a search: how far off, in how many worlds, with how much room to spare."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.search.gauss_newton import rms
from besman.simulation.task import Task
from besman.simulation.trial import Trial

FloatArray = npt.NDArray[np.float64]


def residual_of(trial: Trial) -> FloatArray:
    """Return the residual of a trial, shape (R,); NaN where it failed."""
    return np.full(len(trial.residual), np.nan) if trial.failure else trial.residual


def cost_of(trials: Sequence[Trial]) -> float:
    """Return how far off the outcomes in several worlds are, in radii of success."""
    return rms(np.stack([residual_of(one) for one in trials]))


def count_failures(trials: Sequence[Trial]) -> int:
    """Count the trials that did not succeed."""
    return sum(not trial.success for trial in trials)


def succeeds(trial: Trial, task: Task, share: float) -> bool:
    """Tell whether a trial meets the task's criterion with room to spare.

    Parameters
    ----------
    trial : Trial
        What came of a plan.
    task : Task
        With the criterion.
    share : float
        Share of the greatest permitted errors that may be used up.

    Returns
    -------
    bool
    """
    return trial.success and task.succeeds(trial.miss, trial.measures, share)
