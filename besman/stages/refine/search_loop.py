"""Searches on their way: one alone, or several side by side of which the best wins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from besman.records import AnyPlan, RefinedMotion
from besman.robot.model import Robot
from besman.simulation.perturbation import Perturbation
from besman.simulation.perturbed_trials import try_finely, try_perturbed
from besman.simulation.task import Task
from besman.simulation.trial import Trial, try_plans
from besman.stages.refine.checkpoint import Checkpoint, Generation
from besman.stages.refine.motion_search import MotionSearch
from besman.stages.refine.outcomes import residual_of
from besman.work.work import Work

FloatArray = npt.NDArray[np.float64]


@dataclass(eq=False)
class RunningSearch:
    """A search together with where its episodes are tried and kept.

    Attributes
    ----------
    search : MotionSearch
    robot : Robot
    task : Task
    checkpoint : Checkpoint
    perturbations : tuple of Perturbation
        Models that a search may look at besides the task's own.
    work : Work
        Threads or processes that one motion may use in them; never changes a result.
    tried : list of Generation
        How far it is.
    """

    search: MotionSearch
    robot: Robot
    task: Task
    checkpoint: Checkpoint
    perturbations: tuple[Perturbation, ...] = ()
    work: Work = field(default_factory=Work)
    tried: list[Generation] = field(default_factory=list)

    def advance(self) -> None:
        """Try one generation, and keep it."""
        plans = self.search.propose()
        worlds = self.perturbations if self.search.in_worlds else ()
        if self.perturbations and self.work.has_processes:
            trials, others, finer = try_in_processes(
                self.robot, self.task, plans, worlds, self.work
            )
        else:
            trials, _, others = try_in_worlds(self.robot, self.task, plans, worlds, self.work.jobs)
            finer = []
        generation = self.search.learn(trials, others, self._attempt, finer)
        self.checkpoint.save(self.search.n_generations - 1, generation)
        self.tried.append(generation)

    def _attempt(self, plan: AnyPlan, model: int) -> Trial:
        """Try a plan in one of the perturbed models."""
        return try_perturbed(self.robot, self.task, plan, [self.perturbations[model]])[0]

    def result(self) -> RefinedMotion:
        """Sum up the search."""
        self.search.settle()
        # Once more, because paths of all episodes would be too much to keep.
        (best,) = try_plans(self.robot, self.task, [self.search.best_plan], paths=True)
        return self.search.result(best)


def try_in_worlds(
    robot: Robot,
    task: Task,
    plans: Sequence[AnyPlan],
    worlds: Sequence[Perturbation],
    jobs: int = 1,
) -> tuple[list[Trial], FloatArray, list[tuple[Trial, ...]]]:
    """Try plans in the model as it is, and in perturbed ones.

    Parameters
    ----------
    robot : Robot
    task : Task
    plans : sequence of MotionPlan or CartesianPlan
    worlds : sequence of Perturbation
    jobs : int
        Threads; results do not depend on it.

    Returns
    -------
    trials : list of Trial
        Of every plan in the model as it is.
    residuals : array, shape (P, W, R)
        In that and in all others; NaN where a trial failed.
    others : list of tuple of Trial
        Of every plan in each perturbed model; empty without any.
    """
    trials = try_plans(robot, task, plans)
    others = []
    if worlds:
        others = [tuple(try_perturbed(robot, task, plan, worlds, jobs)) for plan in plans]
    found = [
        np.stack([residual_of(one) for one in (trial, *more)])
        for trial, more in zip(trials, others or [()] * len(trials), strict=True)
    ]
    return trials, np.stack(found), others


@dataclass(frozen=True, eq=False)
class TriedPart:
    """What one process is given of a plan: the model as it is, perturbed ones, or a finer step."""

    plan: AnyPlan
    worlds: tuple[Perturbation, ...] = ()
    finely: bool = False


def try_part(part: TriedPart, robot: Robot, task: Task) -> list[Trial]:
    """Try a plan in some of its models."""
    if part.finely:
        return try_finely(robot, task, [part.plan])
    if part.worlds:
        return try_perturbed(robot, task, part.plan, part.worlds)
    return try_plans(robot, task, [part.plan])


def try_in_processes(
    robot: Robot,
    task: Task,
    plans: Sequence[AnyPlan],
    worlds: Sequence[Perturbation],
    work: Work,
) -> tuple[list[Trial], list[tuple[Trial, ...]], list[Trial]]:
    """Try few plans in all models, each model in some process, and at the finer time step.

    That step is needed for what succeeds alone, which is known when the others are done: to wait
    for it would leave the other processes without work.

    Returns
    -------
    trials : list of Trial
        Of every plan in the model as it is.
    others : list of tuple of Trial
        Of every plan in each perturbed model.
    finer : list of Trial
        Of every plan at the finer step, if there are perturbed models.
    """
    # One more than a share each: who looks at the finer step has less time for others.
    size = -(-len(worlds) // work.jobs) + 1
    blocks = [tuple(worlds[at : at + size]) for at in range(0, len(worlds), size)]
    some = [TriedPart(plan, block) for plan in plans for block in blocks]
    finely = [TriedPart(plan, finely=True) for plan in plans] if worlds else []
    # The longest first.
    parts = [*some[:1], *finely, *some[1:], *map(TriedPart, plans)]
    one = partial(try_part, robot=robot, task=task)
    found = work.map(one, parts, name=lambda part: part.plan.name, processes=1, local=True)
    trials: list[Trial] = []
    others: list[Trial] = []
    finer: list[Trial] = []
    for part, tried in zip(parts, found, strict=True):
        (others if part.worlds else finer if part.finely else trials).extend(tried)
    n = len(worlds)
    rows = [tuple(others[at : at + n]) for at in range(0, len(others), n)] if n else []
    return trials, rows, finer


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
    over = False
    while not over:
        _go_on_until_one_wins(searches, episodes, work)
        for one in searches:
            one.search.settle()
        over = any(one.search.won for one in searches) or all(one.search.done for one in searches)
    work.progress(1.0)
    return max(
        searches, key=lambda one: (one.search.best_trial.success, one.search.best_trial.reward)
    )


def _go_on_until_one_wins(searches: Sequence[RunningSearch], episodes: int, work: Work) -> None:
    """Let searches go on, generation by generation, until one has won or all are over."""
    while alive := [one for one in searches if not one.search.done]:
        behind = min(one.search.n_generations for one in alive)
        # Those that were ended in the middle of a generation finish it first.
        if any(one.search.won and one.search.n_generations <= behind for one in searches):
            break
        todo = [one for one in alive if one.search.n_generations == behind]
        threads = Work(jobs=work.jobs)
        threads.map(RunningSearch.advance, todo, name=lambda one: "search")
        work.progress(min(max(one.search.n_episodes for one in searches) / episodes, 1.0))


def index_of_middle(plans: Sequence[AnyPlan], task: Task) -> int:
    """Return which plan is in the middle of what all want, the first of equals."""
    return order_from_middle(plans, plans, task)[0]


def order_from_middle(plans: Sequence[AnyPlan], others: Sequence[AnyPlan], task: Task) -> list[int]:
    """Return the places of plans, those in the middle of what all others want first."""
    wanted, all_wanted = (np.stack([task.wanted(one) for one in some]) for some in (plans, others))
    apart = np.linalg.norm(wanted[:, None] - all_wanted, axis=2).sum(axis=1)
    return [int(at) for at in np.argsort(apart, kind="stable")]


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
    middle = plans[index_of_middle(plans, task)]
    names = [name for name in ("target", "goal_pose", "start_pose") if hasattr(middle, name)]
    return [replace(plan, **{name: getattr(middle, name) for name in names}) for plan in plans]
