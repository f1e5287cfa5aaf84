"""What the motions of one posture learn from the one in their middle, before any is searched."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np
import numpy.typing as npt

from besman.config.stage import Work
from besman.records import AnyPlan
from besman.records.files import digest
from besman.robot.model import Robot
from besman.search.protocol import Part
from besman.search.residual_points import rms
from besman.search.rough_steps import BESIDE, FAR
from besman.search.two_level import two_level_design
from besman.simulation.perturbation import Perturbation
from besman.simulation.task import Task
from besman.simulation.trial import Trial
from besman.stages.refine.carried_slopes import carry_slopes, tool_slopes
from besman.stages.refine.class_model import (
    ClassModel,
    keep_class,
    load_class,
    measure_all_at_once,
    measure_jacobian,
    moves_too_little,
    nothing_shared,
)
from besman.stages.refine.outcomes import residual_of
from besman.stages.refine.plan_space import Space
from besman.stages.refine.search_loop import RunningSearch, TriedPart, try_in_worlds, try_part

FloatArray = npt.NDArray[np.float64]

ALONE = 3
"""So few motions do not pay for what models are apart by."""
# What is measured of a motion that is searched in the model as it is alone.
_FEW: tuple[Part, ...] = ("goal", "duration")
_DIFFERENCE, _DIFFERENCE_IN_WORLDS = 0.8, 1.5
# A Jacobian in all models may cost so many episodes for each motion that it serves.
_MOST_EACH = 50
# The middle motion is worth more and bolder steps: what it finds is where all others begin.
_STEPS_OF_MIDDLE, _BOLDER, _DETOURS_OF_MIDDLE = 2, 0.3, 4
# So far from where it began, in units, its Jacobian is measured anew.
_ELSEWHERE = 6.0
# So many motions, from the middle on, are searched until steps stall.
_MOST_AIMED = 3


class StepsConfig(Protocol):
    """What `besman.stages.refine.gauss_newton.GaussNewtonConfig` says of steps and searches."""

    steps: int
    difference: float | None
    damping: float
    detours: int
    measure: tuple[Part, ...] | None
    episodes: int

    def perturbations(self, robot: Robot) -> tuple[Perturbation, ...]:
        """Draw the models of the search."""
        ...

    def space(self, plan: AnyPlan, robot: Robot) -> Space:
        """Set up the space of the plans around one."""
        ...

    def running_search(
        self,
        plan: AnyPlan,
        robot: Robot,
        task: Task,
        folder: Path | None = None,
        shared: ClassModel | None = None,
    ) -> RunningSearch:
        """Set up the search for one plan."""
        ...

    def model_copy(self, *, update: dict[str, Any]) -> Self:
        """Return a copy with other values."""
        ...


@dataclass(frozen=True, eq=False)
class Slopes:
    """A Jacobian and the motion that it was measured of, placed."""

    plan: AnyPlan
    model: ClassModel


@dataclass(frozen=True, eq=False)
class ClassLesson:
    """What is to be learnt from the motion in the middle of a class.

    Attributes
    ----------
    config : StepsConfig
    plans : sequence of MotionPlan or CartesianPlan
        Of the class, placed; the first is the middle one.
    robot : Robot
    task : Task
    folder : Path or None
        For checkpoints.
    carried : Slopes, optional
        Of another posture, to be carried to this one in place of a Jacobian of its own.
    """

    config: StepsConfig
    plans: Sequence[AnyPlan]
    robot: Robot
    task: Task
    folder: Path | None
    carried: Slopes | None = None

    @property
    def plan(self) -> AnyPlan:
        """The motion in the middle."""
        return self.plans[0]

    def measure(self, work: Work) -> ClassModel:
        """Find a point with an outcome, and the Jacobian there; see `aim` for what follows."""
        return self._kept("slopes", partial(self._measure, work=work))

    def aim(self, measured: ClassModel, work: Work) -> ClassModel:
        """Search the motion with what was measured of it: where it ends the others begin.

        In perturbed models so few motions as are measured in none do not pay for it, and one alone
        has no others.
        """
        worlds = self.config.perturbations(self.robot)
        if len(self.plans) <= (ALONE if worlds else 1):
            return measured
        search = self._aim_in_worlds if worlds else self._aim_alone
        return self._kept("class", partial(search, measured, work))

    def _kept(self, what: str, learn: Callable[[], ClassModel]) -> ClassModel:
        """Take what was learnt before from the checkpoints."""
        of = self.plans if self.carried is None else (*self.plans, self.carried.plan)
        name = f"{what}_{digest(tuple(map(digest, of)))[:16]}"
        model = load_class(self.folder, name)
        if model is None:
            model = learn()
            keep_class(self.folder, name, model)
        return model

    def _measure(self, work: Work) -> ClassModel:
        config, n_plans = self.config, len(self.plans)
        space = config.space(self.plan, self.robot)
        nothing = partial(nothing_shared, self.plan.name, space.dimension)
        measured = self._measured(space)
        cost = self._cost(len(measured)) if self.carried is None else 0
        budget = config.episodes * n_plans
        point, spent = np.zeros(space.dimension), 1
        first = self._try(space, point, work)
        if not len(first.residual):
            return nothing(1, f"{self.task.kind} has no outcome to take steps on")
        if cost >= budget:
            why = f"a Jacobian takes {cost} episodes, all motions may take {budget}"
            return nothing(1, why)
        if first.failure:
            # Beside it a movement is brought back within its limits.
            point, spent = point + BESIDE, 2
            first = self._try(space, point, work)
        if self.carried is not None:
            jacobian, trust = self._carry(space, point, self.carried)
        else:
            if not np.isfinite(residual_of(first)).all():
                found, needed = self._find_outcome(work)
                spent += needed
                if found is None:
                    return nothing(spent, f"nothing comes of {self.plan.name}")
                point = found
            elif not self._in_one_world and rms(first.residual[None]) > FAR:
                point, needed = self._come_near(point, work)
                spent += needed
            jacobian, trust = self._slopes(space, point, measured, work)
            spent += cost
        if why := moves_too_little(jacobian):
            return nothing(spent, why)
        return ClassModel(self.plan.name, point, jacobian, trust, spent)

    def _try(self, space: Space, point: FloatArray, work: Work) -> Trial:
        """Try a point (D,) in the model as it is.

        Where processes are to measure a Jacobian in all models they have at hand what that takes.
        """
        there = work.has_processes and (self.carried is not None or not self._in_one_world)
        one = partial(try_part, robot=self.robot, task=self.task)
        plan = space.plan_at(point)
        ((trial,),) = work.map(
            one,
            [TriedPart(plan)],
            name=lambda part: part.plan.name,
            processes=int(there),
            local=True,
        )
        return trial

    def _find_outcome(self, work: Work) -> tuple[FloatArray | None, int]:
        """Search without slopes: a point (D,) that succeeds, if any, and how many episodes."""
        search = self._search(self.plan, None, work, to_its_end=True).search
        return search.best_point if search.best_trial.success else None, search.n_episodes

    def _come_near(self, point: FloatArray, work: Work) -> tuple[FloatArray, int]:
        """Search in the model alone from a point (D,): where it ends, and how many episodes.

        So far off all models are off alike: what they are apart by is worth its price near the end.
        """
        alone = self.config.model_copy(update={"robust": None})
        lesson = replace(self, config=alone, plans=(self.plan,), folder=None)
        measured = lesson.measure(work)
        if measured.useless:
            return point, measured.simulations
        search = lesson._search(self.plan, measured, work, to_its_end=True).search
        found = search.best_point if search.best_trial.success else point
        return found, measured.simulations + search.n_episodes

    def _carry(
        self, space: Space, point: FloatArray, source: Slopes
    ) -> tuple[FloatArray, FloatArray]:
        """Carry a Jacobian (W, R, D) from another posture, and what it is trusted with (D,)."""
        model, trust = source.model, np.ones(space.dimension)
        known = np.flatnonzero(model.jacobian.any(axis=(0, 1))).tolist()
        its_space = self.config.space(source.plan, self.robot)
        there = tool_slopes(its_space, model.point, self.robot, known)
        here = tool_slopes(space, point, self.robot, known)
        return carry_slopes(model.jacobian, there, here), trust

    def _aim_in_worlds(self, measured: ClassModel, work: Work) -> ClassModel:
        """Go on beyond what is enough for itself, in all models."""
        config = self.config
        bold = {
            "steps": _STEPS_OF_MIDDLE * config.steps,
            "damping": _BOLDER * config.damping,
            "detours": max(_DETOURS_OF_MIDDLE, config.detours),
        }
        running = config.model_copy(update=bold).running_search(
            self.plan, self.robot, self.task, None, measured
        )
        running.work = work
        search = running.search
        search.look_at_all_worlds(measured.point)
        while search.may_go_on and not search.handed_over:
            running.advance()
        search.settle()
        moved = search.newton_jacobian
        return replace(
            measured,
            point=search.best_point if search.best_trial.success else measured.point,
            jacobian=measured.jacobian if moved is None else moved,
            simulations=measured.simulations + search.n_episodes,
        )

    def _aim_alone(self, measured: ClassModel, work: Work) -> ClassModel:
        """Take steps until it succeeds, in the model alone; where they stall, with the next."""
        spent = measured.simulations
        for plan in self.plans[:_MOST_AIMED]:
            running = self._search(plan, measured, work, to_its_end=False)
            search, moved = running.search, running.search.newton_jacobian
            spent += search.n_episodes
            if search.best_trial.success and moved is not None:
                point = search.best_point
                if np.linalg.norm(point - measured.point) > _ELSEWHERE:
                    # What was measured at the start says little of this place.
                    space = self.config.space(plan, self.robot)
                    coordinates = self._measured(space)
                    moved, _ = self._slopes(space, point, coordinates, work)
                    spent += self._cost(len(coordinates))
                before, after = running.tried[0].trials[0], search.best_trial
                return replace(
                    measured,
                    name=plan.name,
                    point=point,
                    jacobian=moved,
                    simulations=spent,
                    gained=residual_of(after) - residual_of(before),
                )
        return replace(measured, simulations=spent)

    def _search(
        self, plan: AnyPlan, shared: ClassModel | None, work: Work, to_its_end: bool
    ) -> RunningSearch:
        """Search a motion as if it were alone, without checkpoint; or until steps have stalled."""
        running = self.config.running_search(plan, self.robot, self.task, None, shared)
        running.work, search = work, running.search
        while not search.done and (to_its_end or not search.handed_over):
            running.advance()
        if search.done:
            search.settle()
        return running

    def _slopes(
        self, space: Space, point: FloatArray, measured: Sequence[int], work: Work
    ) -> tuple[FloatArray, FloatArray]:
        """Measure the Jacobian (W, R, D) at a point, and how far it can be relied on (D,)."""
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
        alone = len(self.plans) <= ALONE and self.config.measure is None
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
        dear = self._in_one_world or self._cost(len(every)) > _MOST_EACH * len(self.plans)
        return space.coordinates(_FEW) or every if dear else every


def _residuals_at(
    point: FloatArray,
    in_worlds: bool,
    space: Space,
    robot: Robot,
    task: Task,
    worlds: Sequence[Perturbation],
) -> FloatArray:
    """Return the residuals (W, R) at a point (D,), in the task's model alone or in all."""
    found = try_in_worlds(robot, task, [space.plan_at(point)], worlds if in_worlds else ())[1]
    return np.asarray(found[0])
