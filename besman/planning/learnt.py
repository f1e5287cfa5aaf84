"""What a finished run of whole tasks has learnt: blocks, what they do, and places."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from besman.exceptions import RunError
from besman.pipeline.finished_run import read_recipe
from besman.pipeline.stored_run import StoredRun, open_run
from besman.planning.attempts import Bench
from besman.planning.block_effects import (
    HandState,
    LearntBlock,
    find_uses,
    learn_blocks,
    shown_ends,
    shown_successions,
    standing_poses,
)
from besman.planning.places import Place, describe_places, find_places
from besman.records import TaskPlan
from besman.robot.model import Robot, load_robot
from besman.simulation.tasks.kinds import is_whole_task, load_whole_task
from besman.simulation.tasks.rearrange.boxes import BoxFrame, box_poses
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig


@dataclass(frozen=True, eq=False)
class Learnt:
    """What there is to plan with.

    Attributes
    ----------
    blocks : tuple of LearntBlock
    places : tuple of Place
    first : tuple of (str, int)
        Kind of an object, and the place at which the first demonstration has it before.
    shown : frozenset of pair of str
        Which block was shown to follow which.
    ends : frozenset of HandState
        How the hand was when tasks were over.
    bench : Bench
    """

    blocks: tuple[LearntBlock, ...]
    places: tuple[Place, ...]
    first: tuple[str, int]
    shown: frozenset[tuple[str, str]]
    ends: frozenset[HandState]
    bench: Bench

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of objects that blocks take."""
        return tuple(sorted({block.thing for block in self.blocks if block.frame == "object"}))


def read_learnt(folder: Path) -> tuple[StoredRun, Learnt]:
    """Learn from the whole tasks of a run.

    Parameters
    ----------
    folder : Path
        A finished run with `task: rearrange`.

    Raises
    ------
    RunError, ConfigError
        If it is no such run.
    PlanError
        If nothing can be learnt from its tasks.
    """
    config, run = read_recipe(folder), open_run(folder)
    if not is_whole_task(config.task):
        raise RunError(
            f"{folder}: task {config.task!r} is one of single movements; expected a run of whole "
            "tasks (task: rearrange, select.as: blocks)"
        )
    if run.status != "done":
        raise RunError(f"{folder}: the run is not done (status {run.status!r}); finish it first")
    plans = run.record("task_plans")
    won = {trial.name for trial in run.record("simulate") if trial.success}
    robot, task = load_robot(config.robot, config.tool), load_whole_task(config.task)
    return run, learn_tasks(plans, won, robot, task)


def learn_tasks(
    plans: tuple[TaskPlan, ...], won: set[str], robot: Robot, task: RearrangeConfig
) -> Learnt:
    """Learn from whole tasks.

    Parameters
    ----------
    plans : tuple of TaskPlan
        As imitated.
    won : set of str
        Names of those that succeed in simulation as they are.
    robot : Robot
    task : RearrangeConfig

    Raises
    ------
    PlanError
        If no block takes something, or puts it down.
    """
    frame = task.box_frame(plans, robot)
    uses = find_uses(plans)
    poses = _middles(standing_poses(uses, plans), frame)
    places = find_places(uses, poses[:, :3], task.box.size_m)
    blocks = learn_blocks(uses, places.tolist())
    first = next(k for k, use in enumerate(uses) if use.frame == "object")
    good = frozenset(k for k, plan in enumerate(plans) if plan.name in won)
    return Learnt(
        blocks,
        describe_places(uses, poses, places),
        (uses[first].thing, int(places[first])),
        shown_successions(uses),
        shown_ends(uses) - {"full"},
        Bench(plans, good, robot, task, frame),
    )


def _middles(poses: np.ndarray, frame: BoxFrame) -> np.ndarray:
    """Return where the middles of objects are, shape (U, 7), NaN where there is none."""
    found = np.full_like(poses, np.nan)
    known = np.isfinite(poses).all(axis=1)
    found[known] = box_poses(poses[known], frame)
    return found
