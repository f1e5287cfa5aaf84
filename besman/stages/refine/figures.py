"""What `results.json` tells of refined motions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from besman.records import RefinedMotion
from besman.simulation.task import Task


def refine_results(motions: tuple[RefinedMotion, ...], task: Task) -> dict[str, Any]:
    """Give the stage's figures for ``results.json``.

    Parameters
    ----------
    motions : tuple of RefinedMotion
        What refinement gave.
    task : Task
        With the success criterion.

    Returns
    -------
    dict
        n_motions, n_success, n_failed_before (imitations without a valid outcome),
        success_radius_m, miss_before_m, miss_m and episodes, each {median, max}; null where no
        motion has a value; episodes_shared (of what all motions share), handed_over (motions that
        CMA-ES went on with, and why), second_round (of the motions that began again where another's
        search had ended: n_motions, n_success, and the episodes since then).
    """
    again = [motion for motion in motions if motion.begins_again]
    return {
        "n_motions": len(motions),
        "n_success": sum(motion.success for motion in motions),
        "n_failed_before": sum(bool(motion.failure) for motion in motions),
        "success_radius_m": task.success_radius_m,
        "miss_before_m": _summary([motion.miss_before for motion in motions]),
        "miss_m": _summary([motion.miss for motion in motions]),
        "episodes": _summary([motion.simulations.sum() for motion in motions]),
        "episodes_shared": sum(motion.shared_simulations for motion in motions),
        "handed_over": {
            motion.plan.name: motion.handed_over for motion in motions if motion.handed_over
        },
        "second_round": {
            "n_motions": len(again),
            "n_success": sum(motion.success for motion in again),
            "episodes": _summary([one.simulations[one.begins_again :].sum() for one in again]),
        },
    }


def _summary(values: Sequence[float]) -> dict[str, float | None]:
    """Return median and maximum of what is finite."""
    finite = np.array([value for value in values if np.isfinite(value)])
    if not len(finite):
        return {"median": None, "max": None}
    return {"median": float(np.median(finite)), "max": float(np.max(finite))}
