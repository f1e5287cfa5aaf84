"""What trials tell a search: how far off, in how many worlds, with how much room to spare."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.search.residual_points import rms
from besman.simulation.task import Task
from besman.simulation.trial import Trial

FloatArray = npt.NDArray[np.float64]

# Root mean square of the distances to the target, in radii, within which 24 of 25 are in it; and
# how many times the distances from each other's mean must fit between that and the radius.
_NEAR_IN_ALL, _ROOM = 0.55, 1.8


def residual_of(trial: Trial) -> FloatArray:
    """Return the residual of a trial, shape (R,); NaN where it failed."""
    return np.full(len(trial.residual), np.nan) if trial.failure else trial.residual


def cost_of(trials: Sequence[Trial]) -> float:
    """Return how far off the outcomes in several worlds are, in radii of success."""
    return rms(np.stack([residual_of(one) for one in trials]))


def holds(trials: Sequence[Trial]) -> bool:
    """Tell whether the outcomes in several worlds say that a motion succeeds in nearly all.

    Were they normal, in two dimensions, 24 of 25 would be within the radius: where all are off
    alike less room is needed than where they are apart.
    """
    residuals = np.stack([residual_of(one) for one in trials])
    if not np.isfinite(residuals).all():
        return False
    middle = residuals.mean(axis=0)
    room = 1.0 - float(np.linalg.norm(middle))
    return rms(residuals) <= _NEAR_IN_ALL or room >= _ROOM * rms(residuals - middle)


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
