"""A finished run's motions in a second physics engine, beside what they do in MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from besman.exceptions import VerificationError
from besman.io.atomic_files import write_json
from besman.pipeline.derived_files import note_file
from besman.pipeline.finished_run import read_run
from besman.pipeline.verification_file import VERIFIED
from besman.records import RefinedMotion
from besman.records.frozen import FloatArray
from besman.robot.model import Robot
from besman.simulation.second_engine.engines import check_engine, try_in_second_engine
from besman.simulation.task import Task
from besman.work.work import Work

RADII_M = (0.05, 0.10)
"""Distances to the target within which motions are counted, metres."""

_PROCESSES_FROM = 2


@dataclass(frozen=True, eq=False)
class VerifiedMotion:
    """What comes of one refined motion in a second engine.

    Attributes
    ----------
    motion : RefinedMotion
        With what it does in MuJoCo.
    outcome : array, shape (3,)
        Touchdown, or the handle's place, metres in the robot's world; NaN if there is none.
    miss : float
        Distance to the target, metres; NaN if nothing came of it.
    success : bool
        The task's criterion is met and nothing failed.
    failure : str
        "" if nothing failed.
    """

    motion: RefinedMotion
    outcome: FloatArray
    miss: float
    success: bool
    failure: str


def verify_run(
    folder: Path, engine: str = "drake", work: Work = Work()
) -> tuple[tuple[VerifiedMotion, ...], dict[str, Any]]:
    """Try the refined motions of a run in a second engine, and write ``verify.json`` there.

    Parameters
    ----------
    folder : Path
        A finished run.
    engine : str
        One of `besman.simulation.second_engine.engines.ENGINES`.
    work : Work
        Processes and progress.

    Returns
    -------
    found : tuple of VerifiedMotion
    results : dict
        What was written.

    Raises
    ------
    RunError
        If the folder is no finished run.
    VerificationError
        If the engine is not there, or does not know the run's task.
    """
    run = read_run(folder)
    check_engine(engine, run.task)
    verify = partial(_verify, robot=run.robot, task=run.task)
    # Drake keeps Python's lock, and ends a process where it finds a fault of its own.
    found = tuple(
        work.map(verify, run.motions, name=lambda m: m.plan.name, processes=_PROCESSES_FROM)
    )
    results = verification_results(found, run.task, engine, version(engine))
    write_json(folder / VERIFIED, results)
    note_file(folder, folder / VERIFIED)
    return found, results


def _verify(motion: RefinedMotion, robot: Robot, task: Task) -> VerifiedMotion:
    """Try one motion."""
    try:
        trial = try_in_second_engine(robot, task, motion.plan)
    except VerificationError as error:
        return VerifiedMotion(motion, np.full(3, np.nan), float("nan"), False, str(error))
    return VerifiedMotion(motion, trial.outcome, trial.miss, trial.success, trial.failure)


def verification_results(
    found: Sequence[VerifiedMotion], task: Task, engine: str, release: str
) -> dict[str, Any]:
    """Give the figures of all motions together, and of each.

    Parameters
    ----------
    found : sequence of VerifiedMotion
    task : Task
    engine, release : str
        Which engine, in which version.

    Returns
    -------
    dict
        engine, version, task, n_motions; for mujoco and for the engine n_success, within (counts
        by centimetres), miss_m {median, max}; apart_m {median, max}, between the two outcomes;
        motions. What has no value is null.
    """
    first = [(one.motion.success, one.motion.miss) for one in found]
    second = [(one.success, one.miss) for one in found]
    apart = np.array([np.linalg.norm(one.outcome - one.motion.outcome) for one in found])
    return {
        "engine": engine,
        "version": release,
        "task": task.kind,
        "n_motions": len(found),
        "mujoco": _figures(first),
        engine: _figures(second),
        "apart_m": _median_and_max(apart),
        "motions": [
            {
                "motion": one.motion.plan.name,
                "mujoco": _one(one.motion.outcome, one.motion.miss, one.motion.success, ""),
                engine: _one(one.outcome, one.miss, one.success, one.failure),
                "apart_m": _number(far),
            }
            for one, far in zip(found, apart, strict=True)
        ],
    }


def _figures(motions: Sequence[tuple[bool, float]]) -> dict[str, Any]:
    """Count what succeeds, and what is near the target."""
    misses = np.array([miss for _, miss in motions])
    return {
        "n_success": sum(success for success, _ in motions),
        "within": {f"{100 * one:.0f} cm": int((misses <= one).sum()) for one in RADII_M},
        "miss_m": _median_and_max(misses),
    }


def _median_and_max(values: FloatArray) -> dict[str, float | None]:
    known = values[np.isfinite(values)]
    if not len(known):
        return {"median": None, "max": None}
    return {"median": float(np.median(known)), "max": float(known.max())}


def _one(outcome: FloatArray, miss: float, success: bool, failure: str) -> dict[str, Any]:
    """Say what came of a motion in one engine."""
    return {
        "outcome_m": [_number(value) for value in outcome],
        "miss_m": _number(miss),
        "success": bool(success),
        "failure": failure,
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
