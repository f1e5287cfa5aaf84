"""Refinement in two rounds: what does not get on begins again where its neighbours have ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from besman.records import AnyPlan, RefinedMotion
from besman.robot.model import Robot
from besman.simulation.task import Task
from besman.stages.refine.begin_plan import begin_plan
from besman.stages.refine.checkpoint import Generation
from besman.stages.refine.class_model import ClassModel
from besman.stages.refine.stage import RefinementConfig
from besman.work.work import Work

FloatArray = npt.NDArray[np.float64]

# Of the progress: few motions are searched twice.
_FIRST = 0.8


@dataclass(frozen=True, eq=False)
class End:
    """Where the search for a motion has ended that holds.

    Attributes
    ----------
    plan : MotionPlan or CartesianPlan
    jacobian : array, shape (W, R, D)
        As far as the search has corrected it.
    """

    plan: AnyPlan
    jacobian: FloatArray


@dataclass(frozen=True, eq=False)
class Searched:
    """What has come of a motion in the first round.

    Attributes
    ----------
    at : int
        Its place among all.
    plan : MotionPlan or CartesianPlan
        As it was imitated.
    shared : ClassModel or None
        What it was told.
    motion : RefinedMotion or None
        None if it waits for the second round.
    end : End or None
        None unless it holds.
    generations : tuple of Generation
        What was tried; of those that wait.
    """

    at: int
    plan: AnyPlan
    shared: ClassModel | None
    motion: RefinedMotion | None
    end: End | None
    generations: tuple[Generation, ...]

    @property
    def name(self) -> str:
        """Of the motion."""
        return self.plan.name


def refine_in_two_rounds(
    config: RefinementConfig,
    pairs: Sequence[tuple[AnyPlan, ClassModel | None]],
    robot: Robot,
    task: Task,
    n_neighbours: int,
    work: Work,
) -> list[RefinedMotion]:
    """Search motions; those that stall again from where their neighbours have succeeded.

    Which neighbours these are is settled when all have been searched once, so that it depends
    neither on threads nor on the order.

    Parameters
    ----------
    config : RefinementConfig
    pairs : sequence of (MotionPlan or CartesianPlan, ClassModel or None)
        Each motion with what it shares.
    robot : Robot
    task : Task
    n_neighbours : int
        At the ends of how many a motion begins again.
    work : Work
        Threads, processes, progress, and where checkpoints are kept.

    Returns
    -------
    list of RefinedMotion
    """
    todo = [(at, *pair) for at, pair in enumerate(pairs)]
    folder = work.checkpoints
    once = partial(_search_once, config=config, robot=robot, task=task, folder=folder)
    again = partial(_search_again, config=config, robot=robot, task=task, folder=folder)
    first = work.part(0.0, _FIRST).map(
        once,
        todo,
        name=lambda one: one[1].name,
        processes=config.processes,
    )
    waiting = [one for one in first if one.motion is None]
    ends = [one for one in first if one.end is not None]
    wanted = {one.at: task.wanted(begin_plan(one.plan, robot, task)) for one in (*ends, *waiting)}
    starts = [nearest_ends(one, ends, wanted)[:n_neighbours] for one in waiting]
    second = work.part(_FIRST, 1.0).map(
        again,
        list(zip(waiting, starts, strict=True)),
        name=lambda one: one[0].name,
        processes=config.processes,
        some=False,
    )
    found = dict(second) | {one.at: one.motion for one in first if one.motion is not None}
    work.progress(1.0)
    return [found[at] for at in sorted(found)]


def nearest_ends(
    one: Searched, others: Sequence[Searched], wanted: dict[int, FloatArray]
) -> list[End]:
    """Return where those of a motion's class have ended that hold, the nearest target's first.

    `wanted` is the target (3,) of each by its place.
    """
    alike = [other for other in others if other.end is not None and _alike(one, other)]
    alike.sort(key=lambda other: float(np.linalg.norm(wanted[other.at] - wanted[one.at])))
    return [other.end for other in alike if other.end is not None]


def _alike(one: Searched, other: Searched) -> bool:
    mine, its = one.shared, other.shared
    return mine is not None and its is not None and mine.name == its.name


def _search_once(
    item: tuple[int, AnyPlan, ClassModel | None],
    config: RefinementConfig,
    robot: Robot,
    task: Task,
    folder: Path | None,
) -> Searched:
    """Search until it succeeds or stalls."""
    at, plan, shared = item
    waits = shared is not None and not shared.useless
    running = config.running_search(plan, robot, task, folder, shared, waits=waits)
    search = running.search
    while not search.done:
        running.advance()
    if search.waiting:
        return Searched(at, plan, shared, None, None, tuple(running.tried))
    motion, end = running.result(), None
    if search.won and shared is not None and search.newton_jacobian is not None:
        end = End(motion.plan, search.newton_jacobian)
    return Searched(at, plan, shared, motion, end, ())


def _search_again(
    item: tuple[Searched, Sequence[End]],
    config: RefinementConfig,
    robot: Robot,
    task: Task,
    folder: Path | None,
) -> tuple[int, RefinedMotion]:
    """Go on with one that has stalled, from where others have ended."""
    one, ends = item
    space, shared = config.space(begin_plan(one.plan, robot, task), robot), one.shared
    assert shared is not None
    starts = [replace(shared, point=space.project(end.plan), jacobian=end.jacobian) for end in ends]
    running = config.running_search(
        one.plan, robot, task, folder, shared, starts=starts, tried=one.generations
    )
    while not running.search.done:
        running.advance()
    return one.at, running.result()
