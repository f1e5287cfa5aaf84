"""The transferability approach: which simulated motion the real arm tries next.

References
----------
.. [1] S. Koos, J.-B. Mouret, S. Doncieux: The transferability approach: crossing the reality gap
   in evolutionary robotics, IEEE Transactions on Evolutionary Computation 17(1), 2013, section
   III, DOI 10.1109/TEVC.2012.2185849.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.config.stage import Config
from besman.exceptions import TransferError
from besman.transfer.archive import Archive, Simulator, add_simulated
from besman.transfer.nsga2 import nsga2
from besman.transfer.surrogate import GaussianShift, InverseDistance, Surrogate

FloatArray = npt.NDArray[np.float64]

# Points in a generation of CMA-ES, its first standard deviation, and which share of the radius of
# success ends it.
_STEPPED, _STEP = 8, 0.3
_ENOUGH = 0.3
FAILED_M = 1.2
"""A throw that lands this far from where the simulation says has failed, metres."""
# What is open of the landing of a motion that does not throw.
_UNKNOWN_M = 10.0


class TransferConfig(Config):
    """How the next try is found.

    Attributes
    ----------
    surrogate : "jacobian", "gaussian_process" or "inverse_distance"
        What is made of tries: Newton steps with the simulation's slopes, see
        `besman.transfer.newton`; else the transferability approach with what expects where the
        real arm's throws land and how sure that is, or, as in [1], how much they differ from the
        simulated ones.
    population, generations : int
        Of NSGA-II before each try; the first time twice as many generations.
    steps : int
        Greatest number of generations of CMA-ES before NSGA-II, after the first try.
    first_sigma, bound : float
        Standard deviation of the first points about the refined motion, and how far points may be
        from it, in units of refinement's search.
    n_shapes : int
        How many changes of the weights per joint, the smoothest first.
    seed : int
        Of the search.
    """

    surrogate: Literal["jacobian", "gaussian_process", "inverse_distance"] = "jacobian"
    population: Annotated[int, Field(ge=4)] = 24
    generations: Annotated[int, Field(ge=0)] = 4
    steps: Annotated[int, Field(ge=0)] = 15
    first_sigma: Annotated[float, Field(gt=0)] = 0.4
    bound: Annotated[float, Field(gt=0)] = 2.0
    n_shapes: Annotated[int, Field(ge=1)] = 4
    seed: Annotated[int, Field(ge=0)] = 0


@dataclass(frozen=True)
class RealTry:
    """What came of a simulated motion on the real arm.

    Attributes
    ----------
    row : int
        Of the archive.
    outcome : array, shape (2,)
        Where it came down, metres ahead and to the left; NaN if the try failed.
    """

    row: int
    outcome: FloatArray


@dataclass(frozen=True)
class Choice:
    """What to try next.

    Attributes
    ----------
    archive : Archive
        With what was simulated for it.
    row : int
        Of the motion to try.
    landing : array, shape (2,)
        Where the surrogate expects it to come down, metres.
    """

    archive: Archive
    row: int
    landing: FloatArray


def suggest(
    simulator: Simulator,
    archive: Archive,
    tries: Sequence[RealTry],
    target: npt.ArrayLike,
    config: TransferConfig,
    accept: Callable[[FloatArray], bool] = lambda point: True,
    jobs: int = 1,
) -> Choice:
    """Simulate more motions and choose the one to try next.

    NSGA-II makes three costs small: that of the reward where the surrogate expects the real
    outcome, what is open of it (transferability), and minus the distance to what was tried
    (diversity). Before that, CMA-ES looks for a motion that is expected to hit. Of all that was
    simulated, the next try is the one that may come down nearest to the target and is known best.

    Parameters
    ----------
    simulator : Simulator
        Its space has the refined motion at the origin.
    archive : Archive
        What was simulated before; empty at first.
    tries : sequence of RealTry
        What was tried before.
    target : array, shape (2,)
        On the floor, metres ahead and to the left.
    config : TransferConfig
        How to search.
    accept : callable
        Tells of a point (D,) whether its motion may be tried at all.
    jobs : int
        Threads; they change nothing.

    Returns
    -------
    Choice

    Raises
    ------
    TransferError
        If no simulated motion may be tried.
    """
    search = _Search(simulator, archive, tries, np.asarray(target, dtype=np.float64), config, jobs)
    # Another seed for every try, or the same changes are made to other points.
    seed = int(np.random.SeedSequence((config.seed, len(tries))).generate_state(1)[0])
    first, generations = _first_points(simulator, config), 2 * config.generations
    if len(archive.points):
        search.pursue(config, seed)
        first, generations = search.archive.points, config.generations
    bounds = (-config.bound, config.bound)
    nsga2(search.costs, first, bounds, config.population, generations, seed)
    tried = {one.row for one in tries}
    for row in search.ranking():
        if int(row) not in tried and accept(search.archive.points[row]):
            landing = search.landings(np.array([row]))[0]
            return Choice(search.archive, int(row), landing)
    n = len(search.archive.points)
    raise TransferError(f"none of {n} simulated motions may be tried on the arm")


def _first_points(simulator: Simulator, config: TransferConfig) -> FloatArray:
    """Draw points about the refined motion, itself among them."""
    random = np.random.default_rng((config.seed, 0))
    drawn = random.standard_normal((config.population, simulator.space.dimension))
    drawn[0] = 0.0
    return np.asarray(np.clip(config.first_sigma * drawn, -config.bound, config.bound))


class _Search:
    """The costs of points, each simulated once."""

    def __init__(
        self,
        simulator: Simulator,
        archive: Archive,
        tries: Sequence[RealTry],
        target: FloatArray,
        config: TransferConfig,
        jobs: int,
    ) -> None:
        self._simulator, self.archive, self._target, self._jobs = simulator, archive, target, jobs
        rows = np.array([one.row for one in tries], dtype=np.int64)
        real = np.array([one.outcome for one in tries], dtype=np.float64).reshape(-1, 2)
        self._tried = archive.behaviours[rows]
        self._directed = config.surrogate != "inverse_distance"
        shifts = real - archive.outcomes[rows]
        # What goes that far wrong fell out of the tool, or hit something.
        self._failed = ~(np.linalg.norm(shifts, axis=1) <= FAILED_M)
        good = ~self._failed
        kinds: dict[str, type[GaussianShift] | type[InverseDistance]] = {
            "gaussian_process": GaussianShift,
            "inverse_distance": InverseDistance,
            "jacobian": GaussianShift,
        }
        self._surrogate: Surrogate = kinds[config.surrogate](self._tried[good], shifts[good])

    def costs(self, points: FloatArray) -> FloatArray:
        """Return expected cost, what is open of the outcome, and minus the diversity: (P, 3)."""
        rows = self._simulate(points)
        expected, open_m, _ = self._expect(rows)
        nearest = np.nan_to_num(self._distances(rows, self._tried)) if len(self._tried) else 0.0
        return np.column_stack([expected, open_m, np.broadcast_to(-nearest, len(rows))])

    def _distances(self, rows: npt.NDArray[np.int64], known: FloatArray) -> FloatArray:
        """Return how far motions' behaviours (P,) are from the nearest of known ones (K, B)."""
        behaviours = self.archive.behaviours[rows]
        return np.asarray(np.linalg.norm(behaviours[:, None] - known[None], axis=2).min(axis=1))

    def ranking(self) -> npt.NDArray[np.int64]:
        """Return the rows of everything simulated, the one to try first.

        That is the one that may come down nearest to the target and is known best. A surrogate
        without direction does not say where: there it is the one of the least cost and disparity,
        and every other time, because more of the same teaches nothing, the simulated success that
        is most unlike what was tried.
        """
        rows, task = np.arange(len(self.archive.points)), self._simulator.task
        costs, open_m, landings = self._expect(rows)
        if self._directed:
            misses = np.linalg.norm(landings - self._target, axis=1)
            others = np.where(np.isfinite(misses), costs - task.reward.miss_per_m * misses, costs)
            hoped = np.hypot(np.maximum(misses - open_m, 0.0), 0.5 * open_m)
            return np.argsort(np.nan_to_num(hoped, nan=_UNKNOWN_M) + others, kind="stable")
        feared = costs + task.reward.miss_per_m * open_m
        if len(self._tried) % 2 == 1:
            hits = costs <= task.reward.miss_per_m * task.success_radius_m
            feared[hits] = -np.nan_to_num(self._distances(rows[hits], self._tried))
        return np.argsort(feared, kind="stable")

    def landings(self, rows: npt.NDArray[np.int64]) -> FloatArray:
        """Return where the surrogate expects motions to come down, shape (P, 2), metres."""
        return self._expect(rows)[2]

    def pursue(self, config: TransferConfig, seed: int) -> None:
        """Search by CMA-ES around the most promising point for one that is expected to hit.

        Crossing and mutating points takes long to move a landing by a given amount.
        """
        from besman.search.cma_es import CmaEs

        thrown = np.flatnonzero(self.archive.thrown)
        if not len(thrown):
            return
        costs, radius = self._expect(thrown)[0], self._simulator.task.success_radius_m
        enough = _ENOUGH * radius * self._simulator.task.reward.miss_per_m
        best = thrown[np.argmin(costs)]
        bounds = np.full(self.archive.points.shape[1], config.bound)
        search = CmaEs(
            self.archive.points[best], _STEP, _STEPPED, (seed,), bounds=(-bounds, bounds)
        )
        least = float(costs.min())
        for _ in range(config.steps):
            if least <= enough:
                return
            points = search.ask()
            found = self._expect(self._simulate(points))[0]
            search.tell(points, -found)
            least = min(least, float(found.min()))

    def _expect(self, rows: npt.NDArray[np.int64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return what motions will cost on the real arm, what is open of it, where they land."""
        archive, reward = self.archive, self._simulator.task.reward
        costs = archive.costs[rows].copy()
        open_m, landings = np.full(len(rows), _UNKNOWN_M), np.full((len(rows), 2), np.nan)
        thrown = archive.thrown[rows]
        at = rows[thrown]
        if not len(at):
            return costs, open_m, landings
        shifts, open_m[thrown] = self._surrogate.expect(archive.behaviours[at])
        landings[thrown] = archive.outcomes[at] + shifts
        costs[thrown] += reward.miss_per_m * np.linalg.norm(landings[thrown] - self._target, axis=1)
        if self._failed.any():
            # What behaves like a try that failed is expected to fail.
            nearest = self._distances(at, self._tried[self._failed])
            costs[thrown] += reward.failure * np.exp(-0.5 * nearest**2)
        return costs, open_m, landings

    def _simulate(self, points: FloatArray) -> npt.NDArray[np.int64]:
        """Return the rows of points in the archive, after simulating those that are new."""
        self.archive, rows = add_simulated(self._simulator, self.archive, points, self._jobs)
        return rows
