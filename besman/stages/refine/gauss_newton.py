"""Refinement by Gauss-Newton steps with one Jacobian for all motions, robustly by default."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from besman.config.stage import Work
from besman.records import AnyPlan, RefinedMotion
from besman.records.files import digest
from besman.robot.model import Robot
from besman.search.gauss_newton import BESIDE
from besman.search.protocol import Part
from besman.search.two_level import two_level_design
from besman.simulation.perturbation import Perturbation
from besman.simulation.task import Task
from besman.stages.refine.begin_plan import begin_plan
from besman.stages.refine.robustness import RobustConfig
from besman.stages.refine.stage import RefinementConfig

if TYPE_CHECKING:
    from besman.stages.refine.class_model import ClassModel, FloatArray
    from besman.stages.refine.plan_space import Space
    from besman.stages.refine.search_loop import RunningSearch

# What is measured of a motion that is searched in the model as it is alone.
_FEW: tuple[Part, ...] = ("goal", "duration")
_DIFFERENCE, _DIFFERENCE_IN_WORLDS = 0.8, 1.5
# A Jacobian in all models may cost so many episodes for each motion that it serves.
_MOST_EACH = 50
# So few motions do not pay for what models are apart by.
_ALONE = 3
# The middle motion is worth more and bolder steps: what it finds is where all others begin.
_STEPS_OF_MIDDLE, _BOLDER, _DETOURS_OF_MIDDLE = 2, 0.3, 4


class GaussNewtonConfig(RefinementConfig):
    """Refine motion plans by Gauss-Newton steps; see `besman.search.gauss_newton`.

    The Jacobian is that of the outcome of the motion in the middle of those in one posture of the
    arm, measured once; of up to three motions in the model as it is alone.
    Where a task has no outcome to take steps on, where nothing comes of a motion, or where steps
    stall without success, CMA-ES goes on.

    Attributes
    ----------
    method : "gauss_newton"
    steps : int
        Greatest number of steps in a row that gain less than a tenth.
    difference : float or None
        Finite difference, in units of the search; contacts blur what is much smaller. null for 1.5
        where the search is robust, because how far models are apart changes little, else 0.8, of
        all coordinates at once. Where a robust search aims is told by differences of 0.8 to both
        sides, whatever this is.
    damping : float
        Of steps at first, in squared radii of success per squared unit: the less, the farther they
        go along what changes the outcome little.
    detours : int
        How many steps in a row may make the models agree more though all miss by more.
    measure : list of "start", "goal", "duration", "weights" or None
        What of `search` the Jacobian is measured of, and steps move; null for all of it where the
        search is robust and so many motions share it that it takes 50 episodes of each at most,
        else for goal and duration. CMA-ES moves all.
    robust : RobustConfig or None
        The perturbed models; null to look at the model as it is alone.
    neighbours : int
        Of a robust search: at the ends of how many others a motion whose steps stall begins again,
        those with the nearest targets first, before its own steps go on; 0 for none.
    population, restarts
        Of CMA-ES, as in `CmaEsConfig`.
    """

    method: Literal["gauss_newton"]
    steps: Annotated[int, Field(ge=1)] = 6
    difference: Annotated[float, Field(gt=0)] | None = None
    damping: Annotated[float, Field(gt=0)] = 0.1
    detours: Annotated[int, Field(ge=0)] = 2
    measure: Annotated[tuple[Part, ...], Field(min_length=1)] | None = None
    robust: RobustConfig | None = RobustConfig()
    neighbours: Annotated[int, Field(ge=0)] = 2
    population: Annotated[int, Field(ge=4)] | None = 8
    restarts: Literal["none", "ipop", "bipop"] = "none"

    not_of_search: ClassVar[frozenset[str]] = frozenset(
        {"difference", "measure", "neighbours", "robust"}
    )

    def perturbations(self, robot: Robot) -> tuple[Perturbation, ...]:
        """Draw the models of the search."""
        return () if self.robust is None else self.robust.draw(robot)

    def share(
        self, plans: Sequence[AnyPlan], robot: Robot, task: Task, work: Work = Work()
    ) -> list[ClassModel | None]:
        """Learn what the motions of each posture share from the one in their middle.

        It depends on the plans alone, neither on their order nor on threads.
        """
        from besman.stages.refine.postures import group_by_posture
        from besman.stages.refine.search_loop import order_from_middle

        rows = sorted(range(len(plans)), key=lambda row: digest(plans[row]))
        placed = [begin_plan(plans[row], robot, task) for row in rows]
        found: list[ClassModel | None] = [None] * len(plans)
        for group in group_by_posture(placed):
            some = [placed[at] for at in group]
            order = order_from_middle(some, placed, task)
            model = self._share([some[at] for at in order], robot, task, work)
            for at in group:
                found[rows[at]] = model
        return found

    def refine_all(
        self,
        pairs: Sequence[tuple[AnyPlan, ClassModel | None]],
        robot: Robot,
        task: Task,
        work: Work,
    ) -> list[RefinedMotion]:
        """Refine motion plans, those that stall in a second round."""
        from besman.stages.refine.second_round import refine_in_two_rounds

        if self.robust is None or not self.neighbours:
            return super().refine_all(pairs, robot, task, work)
        return refine_in_two_rounds(self, pairs, robot, task, self.neighbours, work)

    def _share(self, plans: Sequence[AnyPlan], robot: Robot, task: Task, work: Work) -> ClassModel:
        """Learn what the motions of one posture share, the first of them the middle one's.

        What was learnt before is taken from the checkpoints.
        """
        from besman.stages.refine.class_model import keep_class, load_class

        folder = work.checkpoints
        name = f"class_{digest(tuple(map(digest, plans)))[:16]}"
        model = load_class(folder, name)
        if model is None:
            lesson = _Lesson(self, plans[0], robot, task, folder, len(plans))
            model = lesson.learn(work)
            keep_class(folder, name, model)
        return model


@dataclass(frozen=True, eq=False)
class _Lesson:
    """What is to be learnt from the motion in the middle of a class.

    Attributes
    ----------
    config : GaussNewtonConfig
    plan : MotionPlan or CartesianPlan
        Placed.
    robot : Robot
    task : Task
    folder : Path or None
        For checkpoints.
    n_plans : int
        Of the class.
    """

    config: GaussNewtonConfig
    plan: AnyPlan
    robot: Robot
    task: Task
    folder: Path | None
    n_plans: int

    def learn(self, work: Work) -> ClassModel:
        """Find a point with an outcome, measure the Jacobian there, take its own steps."""
        from besman.stages.refine.class_model import (
            ClassModel,
            moves_too_little,
            nothing_shared,
        )
        from besman.stages.refine.search_loop import try_in_worlds

        config = self.config
        space = config.space(self.plan, self.robot)
        worlds = config.perturbations(self.robot)
        nothing = partial(nothing_shared, self.plan.name, space.dimension)
        measured = self._measured(space)
        cost, budget = self._cost(len(measured)), config.episodes * self.n_plans
        (first,), _, _ = try_in_worlds(self.robot, self.task, [space.plan_at(_zero(space))], ())
        if not len(first.residual):
            return nothing(1, f"{self.task.kind} has no outcome to take steps on")
        if cost >= budget:
            why = f"a Jacobian takes {cost} episodes, all motions may take {budget}"
            return nothing(1, why)
        point, spent = _zero(space), 1
        if first.failure:
            # Beside it a movement is brought back within its limits.
            point, spent = point + BESIDE, 2
            (first,), _, _ = try_in_worlds(self.robot, self.task, [space.plan_at(point)], ())
        if first.failure or not np.isfinite(first.residual).all():
            search = self._search(None, work.jobs)
            while not search.search.done:
                search.advance()
            search.search.settle()
            spent += search.search.n_episodes
            if not search.search.best_trial.success:
                return nothing(spent, f"nothing comes of {self.plan.name}")
            point = search.search.best_point

        jacobian, trust = self._measure(space, point, measured, work)
        spent += cost
        if why := moves_too_little(jacobian):
            return nothing(spent, why)
        if not worlds or self.n_plans <= _ALONE:
            return ClassModel(self.plan.name, point, jacobian, trust, spent)
        shared = ClassModel(self.plan.name, point, jacobian, trust, spent)
        search = self._search(shared, work.jobs)
        # Beyond what is enough for itself: all others begin there.
        while search.search.may_go_on and not search.search.handed_over:
            search.advance()
        search.search.settle()
        spent += search.search.n_episodes
        moved = search.search.newton_jacobian
        best = search.search.best_point if search.search.best_trial.success else point
        jacobian = jacobian if moved is None else moved
        return ClassModel(self.plan.name, best, jacobian, trust, spent)

    def _measure(
        self, space: Space, point: FloatArray, measured: Sequence[int], work: Work
    ) -> tuple[FloatArray, FloatArray]:
        """Measure the Jacobian (W, R, D) at a point, and how far it can be relied on (D,)."""
        from besman.stages.refine.class_model import measure_all_at_once, measure_jacobian

        worlds = self.config.perturbations(self.robot)
        evaluate = partial(
            _residuals_at, space=space, robot=self.robot, task=self.task, worlds=worlds
        )
        if self._in_one_world:
            step = self.config.difference or _DIFFERENCE
            jacobian = measure_all_at_once(evaluate, point, measured, step, space.floor, work)
            return np.repeat(jacobian, 1 + len(worlds), axis=0), np.ones(space.dimension)
        step = self.config.difference or _DIFFERENCE_IN_WORLDS
        # Where to aim is told by short differences to both sides, how far models are apart is not.
        return measure_jacobian(evaluate, point, measured, step, _DIFFERENCE, space.floor, work)

    @property
    def _in_one_world(self) -> bool:
        """Whether the model as it is tells of all, as it must to motions that are nearly alone."""
        alone = self.n_plans <= _ALONE and self.config.measure is None
        return alone or not self.config.perturbations(self.robot)

    def _cost(self, n_measured: int) -> int:
        """Return how many episodes a Jacobian takes."""
        if self._in_one_world:
            return len(two_level_design(n_measured))
        n_worlds = len(self.config.perturbations(self.robot))
        return n_measured * (n_worlds + 3) + n_worlds + 1

    def _measured(self, space: Space) -> list[int]:
        """Return the coordinates that are measured."""
        every = list(range(space.dimension))
        if self.config.measure is not None:
            return space.coordinates(self.config.measure) or every
        dear = self._in_one_world or self._cost(len(every)) > _MOST_EACH * self.n_plans
        return space.coordinates(_FEW) or every if dear else every

    def _search(self, shared: ClassModel | None, jobs: int) -> RunningSearch:
        """Set up a search for the middle motion, without checkpoint."""
        config = self.config
        if shared is not None:
            bold = {
                "steps": _STEPS_OF_MIDDLE * config.steps,
                "damping": _BOLDER * config.damping,
                "detours": max(_DETOURS_OF_MIDDLE, config.detours),
            }
            config = config.model_copy(update=bold)
        running = config.running_search(self.plan, self.robot, self.task, None, shared)
        running.jobs = jobs
        if shared is not None:
            running.search.look_at_all_worlds(shared.point)
        return running


def _residuals_at(
    point: FloatArray,
    in_worlds: bool,
    space: Space,
    robot: Robot,
    task: Task,
    worlds: Sequence[Perturbation],
) -> FloatArray:
    """Return the residuals (W, R) at a point (D,), in the task's model alone or in all."""
    from besman.stages.refine.search_loop import try_in_worlds

    found = try_in_worlds(robot, task, [space.plan_at(point)], worlds if in_worlds else ())[1]
    return np.asarray(found[0])


def _zero(space: Space) -> FloatArray:
    return np.zeros(space.dimension)
