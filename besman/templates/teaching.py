"""Teach a template from the refined motions of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.config.stage import Work
from besman.exceptions import RefinementError
from besman.records import AnyPlan, RefinedMotion
from besman.robot.model import Robot
from besman.search.protocol import Part
from besman.simulation.task import Task
from besman.simulation.trial import Trial, try_plans
from besman.stages.refine.plan_space import Units
from besman.templates.contexts import ContextKind, context_kind
from besman.templates.learning import TemplateConfig, Tries, learn_policy
from besman.templates.template import PlanFamily, Template

FloatArray = npt.NDArray[np.float64]

Region = dict[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Lesson:
    """What is to be learnt.

    Attributes
    ----------
    robot : Robot
        With the task's tool.
    task : Task
    kind : ContextKind
        Of the task.
    family : PlanFamily
        Around the refined motion that succeeded nearest to the middle of the region.
    region : array, shape (2, S)
        Least and greatest context.
    """

    robot: Robot
    task: Task
    kind: ContextKind
    family: PlanFamily
    region: FloatArray

    def plans(self, points: FloatArray, contexts: FloatArray) -> list[AnyPlan]:
        """Return the plans of points (P, D) for contexts (P, S)."""
        plans = self.family.plans(self.robot, self.kind, points, contexts)
        return [self.task.place(plan, self.robot) for plan in plans]

    def try_points(self, points: FloatArray, contexts: FloatArray, jobs: int = 1) -> Tries:
        """Try points (P, D) in contexts (P, S)."""
        trials = try_plans(self.robot, self.task, self.plans(points, contexts), jobs)
        return tries_of(trials, points, contexts)


def prepare_lesson(
    motions: tuple[RefinedMotion, ...],
    robot: Robot,
    task: Task,
    names: tuple[str, ...],
    region: Region,
    config: TemplateConfig,
) -> Lesson:
    """Choose the region and the plan to start from.

    Parameters
    ----------
    motions : tuple of RefinedMotion
        Of one robot and task.
    robot : Robot
    task : Task
    names : tuple of str
        Coordinates of the context; empty for the usual ones.
    region : dict of (float, float)
        Least and greatest value of coordinates; the others reach a margin beyond the contexts of
        the motions that succeeded.
    config : TemplateConfig

    Raises
    ------
    RefinementError
        If no motion succeeded, names do not belong to the task, or it is the same to the task
        where a motion is placed.
    """
    task = task.aimed_by_plan()
    kind = context_kind(task)
    names = kind.choose(names)
    good = [motion.plan for motion in motions if motion.success]
    if not good:
        raise RefinementError(
            f"template: none of the run's {len(motions)} refined motions succeeds; expected one "
            "to start from"
        )
    contexts = np.array([kind.of(plan, names) for plan in good])
    if not np.isfinite(contexts).all():
        raise RefinementError(
            f"template: task {task.kind} is placed by {' and '.join(task.placed_by)} of a motion; "
            f"{good[0].name} has none"
        )
    margins = np.array([kind.margins[name] for name in names])
    ends = np.array([contexts.min(axis=0) - margins, contexts.max(axis=0) + margins])
    for at, name in enumerate(names):
        ends[:, at] = region.get(name, ends[:, at])
    apart = (contexts - ends.mean(axis=0)) / (ends[1] - ends[0])
    base = good[int(np.argmin(np.linalg.norm(apart, axis=1)))]
    _check_effect(base, robot, task, kind, names, ends)
    units = Units(**config.units.model_dump())
    search = config.search or usual_search(task)
    family = PlanFamily(base, names, search, config.n_shapes, units)
    return Lesson(robot, task, kind, family, ends)


def usual_search(task: Task) -> tuple[Part, ...]:
    """Return what of a motion plan depends on the context of a task, if nothing else is said."""
    start: tuple[Part, ...] = ("start",) if "start_pose" in task.placed_by else ()
    return (*start, "goal", "duration")


def _check_effect(
    base: AnyPlan,
    robot: Robot,
    task: Task,
    kind: ContextKind,
    names: tuple[str, ...],
    ends: FloatArray,
) -> None:
    """Refuse a task to which every context is the same."""
    one, two = (task.place(kind.place(base, names, context), robot) for context in ends)
    same_scene = task.scene(one, robot) == task.scene(two, robot)
    if same_scene and np.array_equal(task.target(one), task.target(two)):
        raise RefinementError(
            f"template: task {task.kind}: neither its target nor its scene depends on "
            f"{', '.join(names)} of a motion's {task.placed_by[0]}; expected one that does"
        )


def teach(
    lesson: Lesson,
    config: TemplateConfig,
    labels: tuple[str, str, str],
    work: Work = Work(),
    known: Tries | None = None,
    keep: Callable[[Tries], None] | None = None,
) -> Template:
    """Learn a template in simulation.

    Parameters
    ----------
    lesson : Lesson
    config : TemplateConfig
    labels : three str
        Robot, tool and task as in the run's pipeline.
    work, known, keep
        As in `besman.templates.learning.learn_policy`; the number of threads changes nothing.

    Returns
    -------
    Template
    """
    policy, tries, checks = learn_policy(
        config,
        lesson.family.space(lesson.robot).dimension,
        lesson.region,
        lambda points, contexts: lesson.try_points(points, contexts, work.jobs),
        work,
        known,
        keep,
    )
    return Template(config.method, *labels, lesson.family, lesson.region, policy, tries, checks)


def tries_of(trials: list[Trial], points: FloatArray, contexts: FloatArray) -> Tries:
    """Take what counts out of trials (P) of points (P, D) in contexts (P, S)."""
    return Tries(
        np.array(contexts),
        np.array(points),
        np.array([trial.reward for trial in trials]),
        np.array([np.nan if trial.failure else trial.miss for trial in trials]),
        np.array([trial.success for trial in trials], dtype=bool),
    )
