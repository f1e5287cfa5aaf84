"""Refinement by Gauss-Newton steps with one Jacobian for all motions, robustly by default."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from besman.config.stage import Work
from besman.records import AnyPlan, RefinedMotion
from besman.records.files import digest
from besman.robot.model import Robot
from besman.search.protocol import Part
from besman.simulation.perturbation import Perturbation
from besman.simulation.task import Task
from besman.stages.refine.begin_plan import begin_plan
from besman.stages.refine.robustness import RobustConfig
from besman.stages.refine.stage import RefinementConfig

if TYPE_CHECKING:
    from besman.stages.refine.class_model import ClassModel


class GaussNewtonConfig(RefinementConfig):
    """Refine motion plans by Gauss-Newton steps; see `besman.search.gauss_newton`.

    The Jacobian is that of the outcome of the motion in the middle of those in one posture of the
    arm, measured once and carried to other postures by what the tool does there; of more than three
    motions in perturbed models it is measured for each posture. In the model as it is alone the
    others begin where the middle motion has ended, if that is nearer than their imitation.
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

        The posture that most are in comes first: what is measured there is carried to the others.
        It depends on the plans alone, neither on their order nor on threads.
        """
        from besman.stages.refine.class_lesson import ALONE, ClassLesson, Slopes
        from besman.stages.refine.postures import group_by_posture
        from besman.stages.refine.search_loop import order_from_middle

        rows = sorted(range(len(plans)), key=lambda row: digest(plans[row]))
        placed = [begin_plan(plans[row], robot, task) for row in rows]
        found: list[ClassModel | None] = [None] * len(plans)
        known: Slopes | None = None
        for group in sorted(group_by_posture(placed), key=len, reverse=True):
            order = order_from_middle([placed[at] for at in group], placed, task)
            some = tuple(placed[group[at]] for at in order)
            carried = known if self.robust is None or len(group) <= ALONE else None
            lesson = ClassLesson(self, some, robot, task, work.checkpoints, carried)
            measured = lesson.measure(work)
            model = measured if measured.useless else lesson.aim(measured, work)
            for at in group:
                found[rows[at]] = model
            if known is None and not measured.useless:
                known = Slopes(some[0], measured)
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
