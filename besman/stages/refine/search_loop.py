"""Searches on their way: one alone, or several side by side of which the best wins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from besman.records import AnyPlan, RefinedMotion
from besman.robot.model import Robot
from besman.simulation.task import Task
from besman.simulation.trial import try_plans
from besman.stages.refine.checkpoint import Checkpoint
from besman.stages.refine.motion_search import MotionSearch
from besman.work.work import Work


@dataclass(eq=False)
class RunningSearch:
    """A search together with where its episodes are tried and kept.

    Attributes
    ----------
    search : MotionSearch
    robot : Robot
    task : Task
    checkpoint : Checkpoint
    """

    search: MotionSearch
    robot: Robot
    task: Task
    checkpoint: Checkpoint

    def advance(self) -> None:
        """Try one generation, and keep it."""
        trials = try_plans(self.robot, self.task, self.search.propose())
        generation = self.search.learn(trials)
        self.checkpoint.save(self.search.n_generations - 1, generation)

    def result(self) -> RefinedMotion:
        """Sum up the search."""
        # Once more, because paths of all episodes would be too much to keep.
        (best,) = try_plans(self.robot, self.task, [self.search.best_plan], paths=True)
        return self.search.result(best)


def search_side_by_side(
    searches: Sequence[RunningSearch], episodes: int, work: Work
) -> RunningSearch:
    """Let searches go on side by side, generation by generation, until one has succeeded.

    Parameters
    ----------
    searches : sequence of RunningSearch
        New, or as far as they were when they were ended.
    episodes : int
        Greatest number of episodes of each, for the progress.
    work : Work
        Threads and progress.

    Returns
    -------
    RunningSearch
        The one with the best trial, the earliest of equals.
    """
    while alive := [one for one in searches if not one.search.done]:
        behind = min(one.search.n_generations for one in alive)
        # Those that were ended in the middle of a generation finish it first.
        if any(one.search.won and one.search.n_generations <= behind for one in searches):
            break
        todo = [one for one in alive if one.search.n_generations == behind]
        threads = Work(jobs=work.jobs)
        threads.map(RunningSearch.advance, todo, name=lambda one: "search")
        work.progress(min(max(one.search.n_episodes for one in searches) / episodes, 1.0))
    work.progress(1.0)
    return max(
        searches, key=lambda one: (one.search.best_trial.success, one.search.best_trial.reward)
    )


def share_target(plans: Sequence[AnyPlan], task: Task) -> list[AnyPlan]:
    """Give plans the target and the scene of the one in the middle of all targets.

    Parameters
    ----------
    plans : sequence of MotionPlan or CartesianPlan
    task : Task
        Says what a target is.

    Returns
    -------
    list of MotionPlan or CartesianPlan
    """
    wanted = np.stack([task.wanted(plan) for plan in plans])
    apart = np.linalg.norm(wanted[:, None] - wanted, axis=2).sum(axis=1)
    middle = plans[int(np.argmin(apart))]
    names = [name for name in ("target", "goal_pose", "start_pose") if hasattr(middle, name)]
    return [replace(plan, **{name: getattr(middle, name) for name in names}) for plan in plans]
