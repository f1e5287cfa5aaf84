"""The stage that refines motion plans in simulation."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, cast

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.config.stage import Config, Items, Stage, Truth, Work
from besman.exceptions import RefinementError
from besman.records import AnyPlan, RefinedMotion
from besman.records.files import digest
from besman.robot.model import Robot
from besman.search.kinds import search_kind
from besman.search.protocol import Part, ResidualSearch, Search
from besman.simulation.task import Task
from besman.stages.refine.begin_plan import begin_plan
from besman.stages.refine.figures import refine_results
from besman.stages.refine.robustness import RobustConfig, RobustnessConfig

if TYPE_CHECKING:
    from besman.simulation.perturbation import Perturbation
    from besman.stages.refine.checkpoint import Generation
    from besman.stages.refine.class_model import ClassModel
    from besman.stages.refine.motion_search import MotionSearch
    from besman.stages.refine.plan_space import Space
    from besman.stages.refine.search_loop import RunningSearch


# A fifth of the work holds Python's lock; processes begin in the time of so many episodes.
_EPISODES_FOR_PROCESSES = 400


def _name_of_first(pair: tuple[AnyPlan, ClassModel | None]) -> str:
    return pair[0].name


def _ignore(done: float) -> None:
    """Take no notice of progress."""


class UnitsConfig(Config):
    """What one unit of the search changes; see `besman.stages.refine.plan_space.Units`."""

    start_rad: Annotated[float, Field(gt=0)] = 0.1
    goal_rad: Annotated[float, Field(gt=0)] = 0.1
    log_duration: Annotated[float, Field(gt=0)] = 0.1
    shape_rad: Annotated[float, Field(gt=0)] = 0.1
    start_m: Annotated[float, Field(gt=0)] = 0.03
    goal_m: Annotated[float, Field(gt=0)] = 0.03
    shape_m: Annotated[float, Field(gt=0)] = 0.03


class RefinementConfig(Stage):
    """Refine every motion plan by a search; `besman.stages.refine.methods` has one class for each.

    Attributes
    ----------
    method : str
    episodes : int
        Greatest number of episodes per motion, the imitation's own among them.
    sigma : float
        Initial standard deviation, in units of the search.
    seed : int
        Of the search.
    search : list of "start", "goal", "duration", "weights"
        What may change.
    n_shapes : int
        How many changes of the weights per joint, the smoothest first.
    units : UnitsConfig
        What one unit of the search changes.
    bound : float or None
        Greatest change of every coordinate, in units of the search; null for any.
    pool : bool
        All motions search side by side for the same target, that of the demonstration in the
        middle; the first that succeeds ends it, and the best alone is the result.
    motions : int or None
        Only so many are refined, those whose imitation comes nearest to the target; null for all.
    robustness : RobustnessConfig or None
        In which perturbed models the refined motions are tried; null for none. No part of the
        search.
    """

    method: str
    episodes: Annotated[int, Field(ge=1)] = 300
    sigma: Annotated[float, Field(gt=0)] = 0.5
    seed: Annotated[int, Field(ge=0)] = 0
    search: Annotated[tuple[Part, ...], Field(min_length=1)] = ("goal", "duration", "weights")
    n_shapes: Annotated[int, Field(ge=1)] = 4
    units: UnitsConfig = UnitsConfig()
    bound: Annotated[float, Field(gt=0)] | None = None
    pool: bool = False
    motions: Annotated[int, Field(ge=1)] | None = None
    robustness: RobustnessConfig | None = RobustnessConfig()

    keeps_checkpoints: ClassVar[bool] = True
    leaves_out: ClassVar[bool] = True
    not_of_search: ClassVar[frozenset[str]] = frozenset()
    """Keys of a method that are no arguments of its search."""

    def make_search(
        self,
        dimension: int,
        seed: tuple[int, ...],
        shared: ClassModel | None = None,
        floor: npt.ArrayLike | None = None,
    ) -> Search:
        """Set up the search over a space of so many coordinates, around zero.

        `floor` (D,) tells below which coordinates nothing changes, to a search that knows slopes.
        """
        own = type(self).model_fields.keys() - RefinementConfig.model_fields.keys()
        learnt = {}
        if shared is not None and not shared.useless:
            learnt = {
                "jacobian": shared.jacobian,
                "trust": shared.trust,
                "first": shared.point,
                "floor": floor,
                "gained": shared.gained,
            }
        search: Search = search_kind(self.method).load()(
            np.zeros(dimension),
            sigma=self.sigma,
            seed=seed,
            bounds=self.bounds,
            **{name: getattr(self, name) for name in own - self.not_of_search},
            **learnt,
        )
        return search

    @property
    def bounds(self) -> tuple[float, float] | None:
        """Least and greatest value of every coordinate."""
        return None if self.bound is None else (-self.bound, self.bound)

    def perturbations(self, robot: Robot) -> tuple[Perturbation, ...]:
        """Draw the models that motions are searched in besides the task's own."""
        return ()

    def share(
        self, plans: Sequence[AnyPlan], robot: Robot, task: Task, work: Work = Work()
    ) -> list[ClassModel | None]:
        """Learn what motions share, before any is searched: for each of them; None for nothing."""
        return [None] * len(plans)

    def space(self, plan: AnyPlan, robot: Robot) -> Space:
        """Set up the space of the plans around one."""
        from besman.stages.refine.plan_space import Units, plan_space

        units = Units(**self.units.model_dump())
        return plan_space(plan, robot, self.search, self.n_shapes, units)

    @property
    def without_robustness(self) -> Self:
        """The search alone: a change of what comes after it does not search again."""
        return self.model_copy(update={"robustness": None})

    def items(self, plans: tuple[AnyPlan, ...], *others: Any) -> Items:
        """Count the motions."""
        return Items(len(plans), "motions")

    def figures(
        self,
        motions: tuple[RefinedMotion, ...],
        truth: Truth,
        plans: tuple[AnyPlan, ...],
        robot: Robot,
        task: Task,
    ) -> dict[str, Any]:
        """Return how many motions succeed, and what it took; see `refine_results`."""
        return refine_results(motions, task)

    def run(
        self,
        plans: tuple[AnyPlan, ...],
        robot: Robot,
        task: Task,
        work: Work = Work(),
    ) -> tuple[RefinedMotion, ...]:
        """Refine motion plans until each succeeds with a margin or its episodes are used up.

        Parameters
        ----------
        plans : tuple of MotionPlan or CartesianPlan
            What imitation gave. Slowed down, where their own movement exceeds a limit.
        robot : Robot
            With the task's tool.
        task : Task
            What is to be done.
        work : Work
            Threads, processes, progress, and where checkpoints are kept.

        Returns
        -------
        tuple of RefinedMotion
            In the order of the plans. Each is what it would be if it were refined alone, but for
            what a method lets all of them share. Of a pool the best alone; of `motions` those that
            were chosen.

        Raises
        ------
        RefinementError
            If a plan and the task or the robot do not belong together.
        """
        check_tool(robot, task)
        if self.motions is not None:
            from besman.stages.refine.choice import nearest_plans

            placed = [begin_plan(plan, robot, task) for plan in plans]
            plans = nearest_plans(placed, robot, task, self.motions, work.jobs)
        if self.pool:
            return (self._refine_side_by_side(plans, robot, task, work),)
        shared = self.share(plans, robot, task, replace(work, strict=True, progress=_ignore))
        return tuple(self.refine_all(list(zip(plans, shared, strict=True)), robot, task, work))

    def refine_all(
        self,
        pairs: Sequence[tuple[AnyPlan, ClassModel | None]],
        robot: Robot,
        task: Task,
        work: Work,
    ) -> list[RefinedMotion]:
        """Refine motion plans, each with what it shares."""
        refine = partial(self._refine, robot=robot, task=task, folder=work.checkpoints)
        return work.map(refine, pairs, name=_name_of_first, processes=self.processes)

    @property
    def processes(self) -> int:
        """From how many motions on processes are sooner done than threads."""
        return max(2, _EPISODES_FOR_PROCESSES // self.episodes)

    def _refine(
        self,
        pair: tuple[AnyPlan, ClassModel | None],
        robot: Robot,
        task: Task,
        folder: Path | None,
    ) -> RefinedMotion:
        """Refine one motion plan, with what it shares."""
        plan, shared = pair
        running = self.running_search(plan, robot, task, folder, shared)
        while not running.search.done:
            running.advance()
        return running.result()

    def _refine_side_by_side(
        self, plans: tuple[AnyPlan, ...], robot: Robot, task: Task, work: Work
    ) -> RefinedMotion:
        """Refine motion plans side by side, for one target."""
        from besman.stages.refine.search_loop import search_side_by_side, share_target

        placed = share_target([begin_plan(plan, robot, task) for plan in plans], task)
        shared = self.share(placed, robot, task, replace(work, strict=True, progress=_ignore))
        pool = [
            self.running_search(plan, robot, task, work.checkpoints, one)
            for plan, one in zip(placed, shared, strict=True)
        ]
        return search_side_by_side(pool, self.episodes, work).result()

    def running_search(
        self,
        plan: AnyPlan,
        robot: Robot,
        task: Task,
        folder: Path | None = None,
        shared: ClassModel | None = None,
        starts: Sequence[ClassModel] = (),
        waits: bool = False,
        tried: Sequence[Generation] = (),
    ) -> RunningSearch:
        """Set up the search for one plan, where it was if it was ended before its end.

        `starts` are other places to begin at where it stalls, see `set_up`; `tried` is how far it
        is, if there is no checkpoint.
        """
        from besman.stages.refine.checkpoint import Checkpoint
        from besman.stages.refine.search_loop import RunningSearch

        # By content, because two plans may have one name.
        checkpoint = Checkpoint(folder, digest(plan)[:16])
        done = 0
        for generations in (checkpoint.load(), tried):
            search = self.set_up(plan, robot, task, shared, starts, waits)
            if generations and search.repeat(generations):
                done = search.n_generations
                break
        else:
            search = self.set_up(plan, robot, task, shared, starts, waits)
            generations = ()
        worlds = self.perturbations(robot)
        running = RunningSearch(search, robot, task, checkpoint, worlds)
        running.tried += generations[:done]
        return running

    def set_up(
        self,
        plan: AnyPlan,
        robot: Robot,
        task: Task,
        shared: ClassModel | None = None,
        starts: Sequence[ClassModel] = (),
        waits: bool = False,
    ) -> MotionSearch:
        """Set up the search for one plan.

        `starts` are other places, with what is known there, to begin at where it stalls; a search
        that `waits` ends as soon as it does.

        Raises
        ------
        RefinementError
            If the plan and the task or the robot do not belong together.
        """
        from besman.stages.refine.motion_search import MotionSearch

        plan = begin_plan(plan, robot, task)
        space = self.space(plan, robot)
        seed = self.seed, _seed_of(plan)
        search, *others = (
            self.make_search(space.dimension, seed, one, space.floor) for one in (shared, *starts)
        )
        if others or waits:
            from besman.search.relay import Relay

            search = Relay(cast("list[ResidualSearch]", [search, *others]), waits)
        n_models = len(self.perturbations(robot))
        return MotionSearch(space, search, robot, task, self.episodes, shared, n_models)


class CmaEsConfig(RefinementConfig):
    """Refine every motion plan by CMA-ES.

    Attributes
    ----------
    method : "cma_es"
    population : int or None
        Episodes per generation; null for 4 + 3 ln(dimension). Fewer learn faster here, because
        nothing is random in an episode.
    restarts : "none", "ipop" or "bipop"
        What follows when the search has converged without success; see
        `besman.search.cma_es.CmaEs`.
    robust : RobustConfig or None
        Perturbed models in which those that succeed race each other; the search ends with one that
        succeeds in all. For tasks that succeed or not. null to look at the model as it is alone.
    """

    method: Literal["cma_es"] = "cma_es"
    population: Annotated[int, Field(ge=4)] | None = 8
    restarts: Literal["none", "ipop", "bipop"] = "none"
    robust: RobustConfig | None = None

    not_of_search: ClassVar[frozenset[str]] = frozenset({"robust"})

    def perturbations(self, robot: Robot) -> tuple[Perturbation, ...]:
        """Draw the models of the races."""
        return () if self.robust is None else self.robust.draw(robot)


def _seed_of(plan: AnyPlan) -> int:
    """Return a seed that depends on what a plan does, not on its name or on which others there are.

    To a millisecond, millimetre and milliradian: the last digits of another machine's arithmetic
    draw the same search.
    """
    numbers = np.concatenate([[plan.duration], plan.start, plan.goal, plan.target])
    whole = np.round(np.nan_to_num(numbers, nan=-1e6) * 1e3).astype("<i8")
    return zlib.crc32(whole.tobytes())


def check_tool(robot: Robot, task: Task) -> None:
    """Refuse a robot and a task that do not belong together: a RefinementError."""
    check_tool_name(robot.name, robot.tool.name, task)


def check_tool_name(robot: str, tool: str, task: Task) -> None:
    """Refuse a tool, by its name, that is not the task's: a RefinementError."""
    if tool != task.tool:
        raise RefinementError(
            f"task {task.kind}: robot {robot} carries tool {tool!r}, expected {task.tool!r}"
        )
