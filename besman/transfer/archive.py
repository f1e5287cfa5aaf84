"""What was simulated so far: points of a space of motion plans, and what came of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.motion.rollout import sample_plan
from besman.records import Record, freeze
from besman.robot.limits import check_limits
from besman.robot.model import Robot
from besman.simulation.perturbation import Perturbation
from besman.simulation.perturbed_trials import lenient_task
from besman.simulation.task import Task
from besman.simulation.trial import try_plans
from besman.stages.refine.plan_space import Space

FloatArray = npt.NDArray[np.float64]

# Differences of release position and velocity that matter as much as each other.
_RELEASE_UNITS = np.array([0.1, 0.1, 0.1, 0.3, 0.3, 0.3])


@dataclass(frozen=True, eq=False)
class Archive(
    Record,
    stored_as="besman.transfer.archive:Archive",
    finite=("points",),
):
    """N simulated motion plans.

    Attributes
    ----------
    points : array, shape (N, D)
        In the space of motion plans.
    outcomes : array, shape (N, 2)
        Where what was thrown came down, metres ahead and to the left; NaN if it did not.
    releases : array, shape (N, 6)
        Position (m) and velocity (m/s) with which it left.
    costs : array, shape (N,)
        Terms of the reward beside the miss: limits, collisions, failures.
    """

    points: FloatArray
    outcomes: FloatArray
    releases: FloatArray
    costs: FloatArray

    def __post_init__(self) -> None:
        """Copy the arrays, make them read-only and check their shapes."""
        freeze(
            self,
            {"points": ("N", "D"), "outcomes": ("N", 2), "releases": ("N", 6), "costs": ("N",)},
        )

    @property
    def behaviours(self) -> FloatArray:
        """What tells throws apart, shape (N, 6), in units in which one matters; NaN if failed."""
        scaled: FloatArray = self.releases / _RELEASE_UNITS
        return scaled

    @property
    def thrown(self) -> npt.NDArray[np.bool_]:
        """Which came down somewhere, shape (N,)."""
        return np.asarray(np.isfinite(self.outcomes).all(axis=1))

    def first(self, n: int) -> Archive:
        """Return the first n plans."""
        names = ("points", "outcomes", "releases", "costs")
        return Archive(*(getattr(self, name)[:n] for name in names))

    def joined(self, other: Archive) -> Archive:
        """Return these plans and others after them."""
        return Archive(
            *(
                np.concatenate([getattr(self, name), getattr(other, name)])
                for name in ("points", "outcomes", "releases", "costs")
            )
        )


def no_plans(dimension: int) -> Archive:
    """Return an archive without plans."""
    return Archive(np.empty((0, dimension)), np.empty((0, 2)), np.empty((0, 6)), np.empty(0))


@dataclass(frozen=True)
class Simulator:
    """Simulates points of a space of motion plans.

    Attributes
    ----------
    space : Space
    robot : Robot
    task : Task
        A throw.
    world : Perturbation, optional
        The model, if it is not that of robot and task.
    """

    space: Space
    robot: Robot
    task: Task
    world: Perturbation | None = None

    def simulate(self, points: FloatArray, jobs: int = 1) -> Archive:
        """Return what comes of points (P, D); threads change nothing."""
        plans = [self.space.plan_at(point) for point in points]
        # An arm that is late has not failed for that.
        task = self.task if self.world is None else lenient_task(self.task)
        trials = try_plans(self.robot, task, plans, jobs, world=self.world)
        return Archive(
            points=np.array(points, dtype=np.float64),
            outcomes=np.array([trial.outcome[:2] for trial in trials]),
            releases=np.array([trial.release for trial in trials]),
            costs=np.array(
                [
                    sum(cost for name, cost in trial.costs.items() if name != "miss_per_m")
                    for trial in trials
                ]
            ),
        )

    def keeps_limits(self, point: FloatArray) -> bool:
        """Tell whether the arm may move like a point (D,): within its limits, touching nothing."""
        plan = self.space.plan_at(point)
        report = check_limits(self.robot, *sample_plan(plan, self.robot)[1:])
        return report.violations == 0 and report.self_collisions == 0


def add_simulated(
    simulator: Simulator, archive: Archive, points: FloatArray, jobs: int = 1
) -> tuple[Archive, npt.NDArray[np.int64]]:
    """Simulate those of some points that nobody has simulated yet.

    Parameters
    ----------
    simulator : Simulator
    archive : Archive
        What was simulated.
    points : array, shape (P, D)
    jobs : int
        Threads; they change nothing.

    Returns
    -------
    archive : Archive
        With the new ones.
    rows : int array, shape (P,)
        Of the points.
    """
    rows = {point.tobytes(): row for row, point in enumerate(archive.points)}
    new = {point.tobytes(): point for point in points if point.tobytes() not in rows}
    if new:
        archive = archive.joined(simulator.simulate(np.array(list(new.values())), jobs))
        rows |= {key: len(rows) + place for place, key in enumerate(new)}
    return archive, np.array([rows[point.tobytes()] for point in points], dtype=np.int64)
