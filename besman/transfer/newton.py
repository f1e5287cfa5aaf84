"""The next try by a Newton step: the simulation's slopes, corrected by what real tries said.

A real outcome is the simulated one and an error that changes slowly from motion to motion: what it
is at the best try, and how it changes from there, tries tell. So the simulation need not be right,
only wrong in nearly the same way for motions that are nearly the same [1]_. It is the less wrong
the more is known of the arm, see `besman.transfer.calibration`.

References
----------
.. [1] J. W. Bandler, R. M. Biernacki, S. H. Chen, R. H. Hemmers, K. Madsen: Electromagnetic
   optimization exploiting aggressive space mapping, IEEE Transactions on Microwave Theory and
   Techniques 43(12), 1995, DOI 10.1109/22.475649.
.. [2] C. G. Broyden: A class of methods for solving nonlinear simultaneous equations, Mathematics
   of Computation 19, 1965, equation 4.5, DOI 10.1090/S0025-5718-1965-0198670-6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from besman.transfer.approach import FAILED_M, Choice, RealTry, TransferConfig, suggest
from besman.transfer.archive import Archive, Simulator, add_simulated

FloatArray = npt.NDArray[np.float64]
Accept = Callable[[FloatArray], bool]

# Half the length of differences, in units of the space; contacts make shorter ones rough.
_STEP = 0.2
# Longest step, in units, how it is damped, in squared metres a squared unit, and how many there
# are; how far points may be from the refined motion; what is near enough, metres.
_REACH, _DAMPING, _STEPS = 1.5, 1e-4, 15
_BOUND = 3.0
_ENOUGH_M = 0.01
# What a unit of costs beside the miss, limits that are exceeded above all, weighs.
_METRES_A_COST, _BLOCKED_M = 0.1, 0.05
# How often a step is shortened for the arm's limits, and to what share.
_SHORTENINGS, _SHORTER = 9, 0.7
# After so many failures since the best try it is not the length of the step.
_MOST_FAILURES = 2


def suggest_next(
    simulator: Simulator,
    archive: Archive,
    tries: Sequence[RealTry],
    target: npt.ArrayLike,
    config: TransferConfig,
    accept: Accept = lambda point: True,
    jobs: int = 1,
    model: Simulator | None = None,
) -> Choice:
    """Choose the motion to try next, as the config says.

    By the simulation's Jacobian, the first try is the refined motion itself, or where an arm that
    is known already hits; the next ones are Newton steps; after a failure half as long ones. Where
    that leads nowhere, because every try failed or no such motion may be tried, the
    transferability approach goes on, with its Gaussian process.

    Parameters
    ----------
    simulator, archive, tries, target, config, accept, jobs
        As of `besman.transfer.approach.suggest`.
    model : Simulator, optional
        Of the arm as landings have told it, to step with in place of the simulator.

    Raises
    ------
    TransferError
        If no simulated motion may be tried.
    """
    target = np.asarray(target, dtype=np.float64)
    if config.surrogate != "jacobian":
        return suggest(simulator, archive, tries, target, config, accept, jobs)
    if model is not None:
        found = _by_model(model, archive, tries, target, accept, jobs)
        if found is not None:
            # What is kept is what the simulation as it is says.
            point = found.archive.points[[found.row]]
            archive, rows = add_simulated(simulator, archive, point, jobs)
            return Choice(archive, int(rows[0]), found.landing)
    steps = _Steps(simulator, archive, tries, target, jobs)
    found = steps.choose(accept)
    if found is not None:
        return found
    config = config.model_copy(update={"surrogate": "gaussian_process"})
    return suggest(simulator, steps.archive, tries, target, config, accept, jobs)


def _by_model(
    model: Simulator,
    archive: Archive,
    tries: Sequence[RealTry],
    target: FloatArray,
    accept: Accept,
    jobs: int,
) -> Choice | None:
    """Step in another simulation than that of the archive; return its archive and a row of it."""
    origin = np.zeros((1, model.space.dimension))
    if tries:
        points = archive.points[[one.row for one in tries]]
        again = [RealTry(row, one.outcome) for row, one in enumerate(tries)]
        return _Steps(model, model.simulate(points, jobs), again, target, jobs).choose(accept)
    there = model.simulate(origin, jobs)
    steps = _Steps(model, there, (), target, jobs)
    return steps.choose_from(RealTry(0, there.outcomes[0]), accept) if there.thrown.all() else None


class _Steps:
    """Newton steps from the best real try."""

    def __init__(
        self,
        simulator: Simulator,
        archive: Archive,
        tries: Sequence[RealTry],
        target: FloatArray,
        jobs: int,
    ) -> None:
        self._simulator, self.archive, self._jobs = simulator, archive, jobs
        self._tries, self._target = tries, target

    def choose(self, accept: Accept) -> Choice | None:
        """Return the next try; None if there is none of this kind."""
        if not self._tries:
            origin = np.zeros(self._simulator.space.dimension)
            row = int(self._simulate(origin[None])[0])
            outcome = self.archive.outcomes[row]
            usable = np.isfinite(outcome).all() and accept(origin)
            return Choice(self.archive, row, outcome) if usable else None
        good = [one for one in self._tries if self._is_good(one)]
        if not good:
            return None
        misses = [float(np.linalg.norm(one.outcome - self._target)) for one in good]
        best = good[int(np.argmin(misses))]
        # Outcomes are arrays, which do not compare as a whole.
        at = next(k for k, one in enumerate(self._tries) if one is best)
        since = self._tries[at + 1 :]
        failures = sum(not self._is_good(one) for one in since)
        if failures > _MOST_FAILURES:
            return None
        error, change = self._learn(good, best)
        return self._step(best, error, change, 0.5**failures, accept)

    def choose_from(self, start: RealTry, accept: Accept) -> Choice | None:
        """Return where the simulation hits, as near as may be to a try that it knows rightly."""
        return self._step(start, *self._learn([start], start), 1.0, accept)

    def _is_good(self, one: RealTry) -> bool:
        """Tell whether something was learnt of a try: it came down, about where it was to."""
        shift = one.outcome - self.archive.outcomes[one.row]
        return bool(np.linalg.norm(shift) <= FAILED_M)

    def _learn(self, good: Sequence[RealTry], best: RealTry) -> tuple[FloatArray, FloatArray]:
        """Return the simulation's error at the best try (2,), and how it changes (2, D) [2]_."""
        points, outcomes = self.archive.points, self.archive.outcomes
        errors = [one.outcome - outcomes[one.row] for one in good]
        change = np.zeros((2, points.shape[1]))
        for at in range(1, len(good)):
            step = points[good[at].row] - points[good[at - 1].row]
            length = float(step @ step)
            if length > 0:
                off = errors[at] - errors[at - 1] - change @ step
                change += np.outer(off, step) / length
        return best.outcome - outcomes[best.row], change

    def _step(
        self, best: RealTry, error: FloatArray, change: FloatArray, share: float, accept: Accept
    ) -> Choice | None:
        """Go from the best try to where the corrected simulation hits, or a share of the way."""
        start = self.archive.points[best.row]

        def expect(point: FloatArray) -> FloatArray:
            row = self._simulate(point[None])[0]
            return np.asarray(self.archive.outcomes[row] + error + change @ (point - start))

        def judge(point: FloatArray) -> FloatArray:
            """Return by how much a landing misses, and what the motion costs beside that (3,)."""
            cost = self._costs(self._simulate(point[None]), start)
            return np.append(expect(point) - self._target, cost)

        point, off, reach = start, judge(start), _REACH
        for _ in range(_STEPS):
            slopes = self._slopes(point)
            if slopes is None:
                break
            step = _free_step(slopes + change, off[:2], self._blocked(point), reach)
            moved = np.clip(point + step, -_BOUND, _BOUND)
            there = judge(moved)
            # What is no outcome is no nearer.
            if np.linalg.norm(there) < np.linalg.norm(off):
                point, off, reach = moved, there, min(2.0 * reach, _REACH)
            else:
                reach *= 0.3
            if np.linalg.norm(off) <= _ENOUGH_M:
                break
        point = start + share * (point - start)
        tried = {one.row for one in self._tries}
        for _ in range(_SHORTENINGS):
            landing, row = expect(point), int(self._simulate(point[None])[0])
            if np.isfinite(landing).all() and row not in tried and accept(point):
                return Choice(self.archive, row, landing)
            point = start + _SHORTER * (point - start)
        return None

    def _slopes(self, point: FloatArray) -> FloatArray | None:
        """Return how the simulated outcome changes a unit (2, D); None without any outcome."""
        rows = self._around(point)
        ahead, back = self.archive.outcomes[rows]
        slopes = ((ahead - back) / (2.0 * _STEP)).T
        # A motion that no longer throws says nothing.
        known = np.isfinite(slopes).all(axis=0)
        return np.where(known, slopes, 0.0) if known.any() else None

    def _blocked(self, point: FloatArray) -> npt.NDArray[np.bool_]:
        """Return along which coordinates limits are exceeded soon, ahead and back: (2, D)."""
        return np.asarray(self._costs(self._around(point), point) > _BLOCKED_M)

    def _around(self, point: FloatArray) -> npt.NDArray[np.int64]:
        """Return the rows of points a difference ahead of one and behind it, (2, D)."""
        moves = _STEP * np.eye(len(point))
        rows = self._simulate(np.concatenate([point + moves, point - moves]))
        return rows.reshape(2, len(point))

    def _costs(self, rows: npt.NDArray[np.int64], start: FloatArray) -> FloatArray:
        """Return what motions cost more than that at a point (D,), as metres of a miss."""
        row = int(self._simulate(start[None])[0])
        usual = self.archive.costs[row]
        return np.asarray(_METRES_A_COST * np.maximum(self.archive.costs[rows] - usual, 0.0))

    def _simulate(self, points: FloatArray) -> npt.NDArray[np.int64]:
        """Return the rows of points in the archive, after simulating those that are new."""
        self.archive, rows = add_simulated(self._simulator, self.archive, points, self._jobs)
        return rows


def _free_step(
    slopes: FloatArray, off: FloatArray, blocked: npt.NDArray[np.bool_], reach: float
) -> FloatArray:
    """Return the damped step of least norm (D,) along coordinates that are free in its direction.

    `slopes` (2, D) are of what is `off` (2,); `blocked` (2, D) are coordinates ahead and back.
    """
    free = np.ones(slopes.shape[1], dtype=np.bool_)
    while True:
        used = np.where(free, slopes, 0.0)
        step = -used.T @ np.linalg.solve(used @ used.T + _DAMPING * np.eye(2), off)
        shut = free & np.where(step > 0, blocked[0], blocked[1]) & (step != 0)
        if not shut.any():
            return np.asarray(step * min(1.0, reach / max(float(np.linalg.norm(step)), 1e-12)))
        free &= ~shut
