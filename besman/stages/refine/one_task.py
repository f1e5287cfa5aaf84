"""One whole task refined: in other ways, and block by block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from besman.exceptions import PlanError, RunError
from besman.io.atomic_files import write_record
from besman.records import RefinedTask, TaskPlan, TaskTrial
from besman.records.files import digest, load_record
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.block_trials import BlockTrials
from besman.simulation.tasks.rearrange.boxes import BoxFrame
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.simulation.tasks.rearrange.sections import GraspConfig
from besman.stages.refine.block_parts import split_aimed
from besman.stages.refine.block_search import Found, search_blocks


def refine_task(
    plan: TaskPlan,
    best: RefinedTask | None,
    robot: Robot,
    task: RearrangeConfig,
    frame: BoxFrame,
    folder: Path | None = None,
) -> RefinedTask:
    """Search until a task succeeds, or there is no other way.

    Parameters
    ----------
    plan : TaskPlan
        As it was imitated.
    best : RefinedTask or None
        What has come of the first way, if it was tried.
    robot : Robot
    task : RearrangeConfig
        Its `search` says how.
    frame : BoxFrame
    folder : Path, optional
        Where what has come of a task is kept, so that a killed run goes on with the next.

    Returns
    -------
    RefinedTask
        That which succeeds, or misses least.

    Raises
    ------
    PlanError
        If no way is within the arm's reach and limits.
    """
    if best is not None and best.trial.success:
        return best
    file = None
    if folder is not None and folder.is_dir():
        file = folder / f"{digest(plan)[:16]}.npz"
        known = _load(file)
        if known is not None:
            return known
    found = _search(plan, best, robot, task, frame)
    if file is not None:
        write_record(file, found, durable=False)
    return found


def _load(file: Path) -> RefinedTask | None:
    """Return what was kept; nothing if there is nothing, or it is damaged."""
    if not file.is_file():
        return None
    try:
        known = load_record(file)
    except RunError:
        return None
    return known if isinstance(known, RefinedTask) else None


def _search(
    plan: TaskPlan,
    best: RefinedTask | None,
    robot: Robot,
    task: RearrangeConfig,
    frame: BoxFrame,
) -> RefinedTask:
    """Try one thing after the other."""
    faults: list[PlanError] = []
    tries, by_blocks = int(best is not None), task.search.by == "blocks"
    ways = task.aim(plan, robot, frame, lambda _, error: faults.append(error))
    for moved, n in _candidates(ways, best, robot, task, frame, by_blocks):
        tries += n
        if moved is None:
            continue
        (trial,) = task.try_tasks([moved], robot, frame)
        if best is None or is_better(trial, best.trial):
            best = RefinedTask(moved, trial, tries)
        if trial.success:
            return replace(best, tries=tries)
    if best is None:
        raise faults[0]
    return replace(best, tries=tries)


def _candidates(
    ways: Iterator[tuple[GraspConfig, TaskPlan]],
    best: RefinedTask | None,
    robot: Robot,
    task: RearrangeConfig,
    frame: BoxFrame,
    by_blocks: bool,
) -> Iterator[tuple[TaskPlan | None, int]]:
    """Return what is worth simulating, and what each has cost, in simulations.

    Each way that was not simulated yet, and before or after them what a search of the blocks of the
    first one comes to.
    """
    first: tuple[GraspConfig, TaskPlan] | None = None
    for grasp, moved in ways:
        if best is None or not is_same(moved, best.plan):
            yield moved, 1
        if first is None:
            first = grasp, moved
            if by_blocks:
                yield _by_blocks(first, robot, task, frame)
    if first is not None and not by_blocks:
        yield _by_blocks(first, robot, task, frame)


def _by_blocks(
    first: tuple[GraspConfig, TaskPlan], robot: Robot, task: RearrangeConfig, frame: BoxFrame
) -> tuple[TaskPlan | None, int]:
    """Return the task that a search of blocks has come to, if it succeeds, and what that cost."""
    grasp, moved = first
    found = search_task_blocks(moved, grasp, robot, task, frame)
    if found is None:
        return None, 0
    # The whole of it is simulated once more, to be judged as any other.
    return (found.plan if found.success else None), sum(found.episodes.values()) + found.success


def search_task_blocks(
    aimed: TaskPlan, grasp: GraspConfig, robot: Robot, task: RearrangeConfig, frame: BoxFrame
) -> Found | None:
    """Search the parts of a task one after the other, from the way in which it was brought.

    Parameters
    ----------
    aimed : TaskPlan
    grasp : GraspConfig
        The way.
    robot : Robot
    task : RearrangeConfig
    frame : BoxFrame

    Returns
    -------
    Found
        None if it is no task that takes and puts one thing.
    """
    way = task.grasp_way(frame, grasp)
    try:
        parts = split_aimed(aimed, way)
    except PlanError:
        return None
    # Posture and height are in the blocks.
    way = replace(way, posture=0, higher_m=0.0)
    taken = next(block.thing for block in aimed.blocks if block.frame == "object")
    trials = BlockTrials.of(aimed, robot, task, frame, aimed.objects.index(taken))
    search = task.search
    return search_blocks(parts, way, trials, search.episodes, search.seed, search.sigma)


def is_better(trial: TaskTrial, other: TaskTrial) -> bool:
    """Tell whether one that succeeds, or fails in nothing, or misses less."""

    def rank(one: TaskTrial) -> tuple[bool, bool, float]:
        return (not one.success, bool(one.failure), float(np.nan_to_num(one.miss, nan=np.inf)))

    return rank(trial) < rank(other)


def is_same(plan: TaskPlan, other: TaskPlan) -> bool:
    """Tell whether two tasks have the same movement."""
    same = len(plan.blocks) == len(other.blocks) and plan.duration == other.duration
    return same and all(
        np.array_equal(getattr(one, part), getattr(two, part))
        for one, two in zip(plan.blocks, other.blocks, strict=True)
        for part in ("goal", "weights")
    )
