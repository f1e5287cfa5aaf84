"""Whole tasks refined block by block, as one, and without what a person has shown."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

from besman.evaluation.names import WHOLE_TASK_SEARCHES
from besman.evaluation.refinement_functions import Attempt, Note, take_no_note
from besman.exceptions import ConfigError
from besman.records import TaskPlan
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.block_trials import (
    BlockGoal,
    BlockOutcome,
    BlockState,
    BlockTrials,
)
from besman.simulation.tasks.rearrange.boxes import BoxFrame
from besman.simulation.tasks.rearrange.rearrange import RearrangeConfig
from besman.stages.refine.block_detours import lead_parts_around
from besman.stages.refine.block_parts import Part, split_task
from besman.stages.refine.block_search import Found, search_blocks, search_whole

# First standard deviations: what was shown is near, without it the box is anywhere in the hand.
_SIGMA, _SCRATCH_SIGMA = 1.0, 5.0


@dataclass(frozen=True, eq=False)
class WholeTaskProblem:
    """The imitations of a pipeline of whole tasks; attempts take turns with them.

    Each begins as the person has shown it: the gripper is where the hand was in the frame of the
    box and of its place, with the task's own straight ways, and what touches something on the way
    by capsules is led around it. What a search may change are these two poses, how much higher the
    arm goes, how far it leaves, and how slow the last part is.

    - block_by_block: `besman.stages.refine.block_search.search_blocks`, each part from the state in
      which the one before has ended, which tells how the box hangs in the hand.
    - as_one: `search_whole`, on all numbers at once; an episode's are chosen before it begins.
    - from_scratch: the same on blocks without a shape and a gripper that is square to the frame of
      the markers, in its origin, with a first step that is five times as large.

    Attributes
    ----------
    name, episodes
        See `besman.evaluation.refinement_functions.Problem`; the budget is shared by the parts.
    plans : tuple of TaskPlan
        That take and put one thing.
    robot : Robot
    task : RearrangeConfig
    frame : BoxFrame
    note : callable
        Told of every episode.
    """

    name: str
    plans: tuple[TaskPlan, ...]
    robot: Robot
    task: RearrangeConfig
    frame: BoxFrame
    episodes: int = 300
    marks: tuple[int, ...] = ()
    public: dict[str, Any] = field(default_factory=dict)
    methods: tuple[str, ...] = WHOLE_TASK_SEARCHES
    note: Note = take_no_note

    @property
    def success(self) -> str:
        """What counts as success, in words."""
        success = self.task.success
        return (
            f"{self.task.kind}: within {100 * success.success_radius_m:g} cm and "
            f"{success.success_angle_deg:g} degrees, simulated at once"
        )

    def attempt(self, method: str, seed: int, note: Note = take_no_note) -> Attempt:
        """Search for the task whose turn it is; the whole that was found is then judged."""
        plan = self.plans[seed % len(self.plans)]
        started = time.thread_time()
        found = replace(self, note=note).search(plan, method, seed)
        spent = time.thread_time() - started
        won = False
        if found.success and found.plan is not None:
            (trial,) = self.task.try_tasks([found.plan], self.robot, self.frame)
            won = trial.success
        rewards = found.rewards[: self.episodes]
        return Attempt(
            rewards=rewards,
            final=float(rewards.max()),
            episodes_to_success=sum(found.episodes.values()) if won else None,
            cpu_s=spent,
            cpu_s_to_success=spent if won else None,
        )

    def search(self, plan: TaskPlan, method: str, seed: int) -> Found:
        """Return what a search has come to.

        Parameters
        ----------
        plan : TaskPlan
        method : str
            Of `WHOLE_TASK_SEARCHES`.
        seed : int
        """
        return self.search_parts(*self.divide(plan, method), method, seed)

    def divide(self, plan: TaskPlan, method: str) -> tuple[tuple[Part, ...], BlockTrials]:
        """Return the parts of a task as a search begins with them, and the scene of it."""
        thing = next(block.thing for block in plan.blocks if block.thing)
        row = plan.objects.index(thing)
        trials = BlockTrials.of(plan, self.robot, self.task, self.frame, row)
        trials = NotedTrials.noting(trials, self.note)
        parts = split_task(plan, scratch=method == "from_scratch")
        if method == "as_one":
            parts = lead_parts_around(parts, self.task.grasp_way(self.frame), trials)
        return parts, trials

    def search_parts(
        self, parts: tuple[Part, ...], trials: BlockTrials, method: str, seed: int
    ) -> Found:
        """Return what a search of a task that has been divided has come to."""
        way = self.task.grasp_way(self.frame)
        if method == "block_by_block":
            return search_blocks(parts, way, trials, self.episodes // len(parts), seed, _SIGMA)
        sigma = _SCRATCH_SIGMA if method == "from_scratch" else _SIGMA
        return search_whole(parts, way, trials, self.episodes, seed, sigma)


@dataclass(frozen=True, eq=False)
class NotedTrials(BlockTrials):
    """Trials of which each is noted; see `BlockTrials`.

    Attributes
    ----------
    note : callable
        Called with the number of episodes after each.
    """

    note: Note = take_no_note

    @classmethod
    def noting(cls, trials: BlockTrials, note: Note) -> NotedTrials:
        """Return the same trials, noted."""
        return cls(**{one.name: getattr(trials, one.name) for one in fields(trials)}, note=note)

    def attempt(self, part: TaskPlan, state: BlockState, goal: BlockGoal) -> BlockOutcome:
        """Simulate a part from a state."""
        self.note(1)
        return super().attempt(part, state, goal)

    def attempt_whole(
        self, whole: TaskPlan, parts: Sequence[TaskPlan], goals: Sequence[BlockGoal]
    ) -> tuple[BlockOutcome, ...]:
        """Simulate all parts at once."""
        self.note(1)
        return super().attempt_whole(whole, parts, goals)


def whole_task_problem(
    name: str,
    plans: tuple[TaskPlan, ...],
    robot: Robot,
    task: RearrangeConfig,
    episodes: int | None = None,
) -> WholeTaskProblem:
    """Set up the problem of a pipeline's tasks, those that take and put one thing.

    Raises
    ------
    ConfigError
        If none does.
    """
    usable = tuple(plan for plan in plans if _takes_one(plan))
    if not usable:
        raise ConfigError(
            f"--problem {name}: none of {len(plans)} tasks takes one object and puts it, once"
        )
    frame, most = task.box_frame(plans, robot), episodes or WholeTaskProblem.episodes
    return WholeTaskProblem(name, usable, robot, task, frame, most)


def _takes_one(plan: TaskPlan) -> bool:
    """Tell whether a task can be split into parts."""
    frames = [block.frame for block in plan.blocks if block.frame != "world"]
    return frames == sorted(frames) and set(frames) == {"object", "target"}
