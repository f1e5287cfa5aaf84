"""Damped Gauss-Newton steps on the residuals of outcomes; where they stall, CMA-ES goes on.

The Jacobian comes from outside, measured once for many searches alike; every search corrects its
own copy: in one world by the slopes that make all its outcomes most likely (see
`besman.search.linear_model`), in all of them by what each step did. Steps are those of least norm
that the damping allows, so that directions that change no outcome stay where they are. Residuals
may be those of several models of the world at once: what is left of them then is how far apart the
models' outcomes are. The first steps are taken in the one model alone, until its outcome is near:
that tells where all are. They keep the models as near each other as at a first point found so.

References
----------
.. [1] D. W. Marquardt: An algorithm for least-squares estimation of nonlinear parameters. Journal
   of the SIAM 11(2), 1963, DOI 10.1137/0111030.
"""

from __future__ import annotations

from typing import TypeGuard

import numpy as np
import numpy.typing as npt

from besman.search.cma_es import CmaEs, Restarts
from besman.search.damped_step import damped_step
from besman.search.gaussian import Bounds, check_bounds
from besman.search.linear_model import learn_slopes
from besman.search.residual_points import Tried, correct_by_step, foresee, rms, ways_down
from besman.search.rough_steps import BESIDE, FAR, RoughSteps

FloatArray = npt.NDArray[np.float64]

# Longest step at first, and the one below which nothing is gained any more, in units.
_REACH, _LEAST_REACH = 3.0, 0.1
# How much more models must agree, in radii of success, after a step to where all are farther off.
_CLOSER = 0.02
_NEAR = 0.5  # an outcome that CMA-ES brings this near is worth Newton steps again
_ASIDE = 2  # steps without progress at the nearest point that CMA-ES knows
# Normal outcomes of two dimensions so far apart (root mean square) are within it 87 times in 100.
_POOR = 0.7
_STEPS_BACK = 2
_PROGRESS = 0.9  # a step that leaves less than this of the cost is not counted
# How much of what a step did is believed of the worlds apart from each other. Where steps stall,
# the Jacobian is measured along so many directions by so many units; more of that is believed.
_TRUST = 0.2
_DIRECTIONS, _DIFFERENCE, _TRUST_OF_MEASURED = 6, 1.0, 0.5
_ASTRAY = 1.0  # where all are off alike, or all within the radius: as soon as steps are so short
_LONGER = 3


class GaussNewton:
    """Gauss-Newton with a given Jacobian, damped after Levenberg and Marquardt; then CMA-ES.

    Parameters
    ----------
    start : array, shape (D,)
        Where CMA-ES begins, if it comes to that before any outcome is known.
    sigma, population, seed, restarts
        Of CMA-ES, see `besman.search.cma_es.CmaEs`.
    bounds : two arrays, shape (D,), optional
        Least and greatest value of every coordinate.
    steps : int
        Greatest number of steps in a row that gain less than a tenth.
    damping : float
        Of the normal equations at first, in squared radii of success per squared unit.
    detours : int
        How many steps in a row may make the worlds agree more at the cost of all being elsewhere.
    jacobian : array, shape (W, R, D), optional
        Of the residuals in each of W worlds; without it there is CMA-ES alone.
    first : array, shape (D,), optional
        First point, where worlds agree as far as is known; the start if not given.
    trust : array, shape (D,), optional
        How far each coordinate's slopes can be relied on, 0 to 1: what it is scaled by before
        steps of least norm are sought. 1 if not given.
    floor : array, shape (D,), optional
        Nothing changes below: no step goes there.
    gained : array, shape (R,), optional
        By how much the residual changes from the start to the first point, as far as is known: in
        one world steps begin there if that is nearer.

    Attributes
    ----------
    jacobian : array, shape (W, R, D), or None
        As far as it is corrected.
    handed_over : bool
        Whether CMA-ES has had to go on.
    """

    def __init__(
        self,
        start: npt.ArrayLike,
        sigma: float,
        population: int | None,
        seed: tuple[int, ...],
        bounds: Bounds | None = None,
        restarts: Restarts = "none",
        steps: int = 6,
        damping: float = 0.1,
        detours: int = 2,
        jacobian: npt.ArrayLike | None = None,
        first: npt.ArrayLike | None = None,
        trust: npt.ArrayLike | None = None,
        floor: npt.ArrayLike | None = None,
        gained: npt.ArrayLike | None = None,
    ) -> None:
        self._start = np.array(start, dtype=np.float64)
        one = np.ones(len(self._start))
        self._trust = one if trust is None else np.array(trust)
        self._bounds = check_bounds(self._start, bounds)
        self._floor = -np.inf * one if floor is None else np.array(floor)
        self._options = (sigma, population, seed, bounds, restarts)
        self._steps, self._left = steps, _LONGER * steps
        self._next = self._agreed = np.array(start if first is None else first, dtype=np.float64)
        self._gained = np.full(1, np.nan) if gained is None else np.array(gained)
        self._foresees = bool((np.abs(self._next - self._start) > BESIDE).any())
        self._at: Tried | None = None
        self._best: Tried | None = None
        self._seen: list[Tried] = []  # all that has an outcome in the first world
        self._nearest: Tried | None = None
        self._wary, self._most_detours = damping, detours
        self._damping, self._reach, self._detours, self._back = damping, _REACH, 0, 0
        self._rough = RoughSteps(seed)
        self._ended = self.handed_over = self._in_worlds = self._aside = False
        self._strategy: CmaEs | None = None
        self._other: Tried | None = None
        self._block: FloatArray | None = None  # points at which the Jacobian is being measured
        self._may_measure, self._alone, self._returned = True, False, False
        self._given = None if jacobian is None else np.array(jacobian, dtype=np.float64)
        self.jacobian = self._prior = self._given
        if self.jacobian is None:
            self._begin_cma(self._start)

    @property
    def n_worlds(self) -> int:
        """In how many worlds points are to be tried, the model as it is among them."""
        return 1 if self.jacobian is None else len(self.jacobian)

    @property
    def in_worlds(self) -> bool:
        """Whether the points asked for next are to be tried in all of them."""
        return self._in_worlds and not (self._block is not None and self._alone)

    @property
    def exhausted(self) -> bool:
        """Whether going on is of no use."""
        if self._strategy is None:
            return self._ended
        return self._strategy.exhausted and not self._aside

    def ask(self) -> FloatArray:
        """Return the points to try next, shape (P, D); one, where it takes steps."""
        if self._strategy is not None and not self._aside:
            return self._strategy.ask()
        return (self._next[None] if self._block is None else self._block).copy()

    def tell_start(self, point: FloatArray, residuals: FloatArray) -> None:
        """Take the residuals (1, R) of the start (D,), before anything is asked for."""
        if self._strategy is not None:
            return
        known, tried = np.isfinite(residuals).all(), Tried(np.array(point), np.array(residuals))
        if self.n_worlds > 1:
            self._other = tried if known and not np.array_equal(self._next, point) else None
        elif known:
            told = Tried(self._next, tried.residuals + self._gained)
            self._learn(tried)
            if told.cost < tried.cost:
                near = told.cost <= _NEAR
                self._next = told.point if near else self._within(told.point + self._step(told))
        elif np.array_equal(self._next, point):
            self._next = self._within(self._next + BESIDE)

    def tell(
        self, points: FloatArray, returns: FloatArray, residuals: FloatArray | None = None
    ) -> None:
        """Take the returns (P,) of the points (P, D) that were asked for, and their residuals.

        These, shape (P, W, R), are those in every world that the points were tried in; NaN without
        an outcome.
        """
        if self._strategy is not None and not self._aside:
            self._strategy.tell(points, returns)
            self._step_aside(points, residuals)
        elif residuals is None:
            self._begin_cma(self._start)
        else:
            tried = [Tried(*one) for one in zip(np.array(points), np.array(residuals), strict=True)]
            if self._block is None:
                self._learn(tried[0])
            else:
                self._learn_anew(tried)

    def _step_aside(self, points: FloatArray, residuals: FloatArray | None) -> None:
        """Take steps again from the nearest point, if CMA-ES has found one that is nearer.

        Near, they go on in all worlds; else its points have told of the Jacobian there.
        """
        if self.jacobian is None or residuals is None or self._in_worlds:
            return
        before = self._nearest
        for point, found in zip(points, residuals, strict=True):
            self._note(Tried(np.array(point), np.array(found)))
        nearest = self._nearest
        if nearest is None or nearest is before:
            return
        if nearest.first <= _NEAR and self.n_worlds > 1:
            self.enter_worlds(nearest.point)
            return
        self._begin()
        self._aside, self._left = True, _ASIDE
        self._at = self._best = nearest
        self._go_on(nearest)

    def enter_worlds(self, point: FloatArray) -> None:
        """Look at all worlds from now on, beginning at a point that is near in the first."""
        self._strategy, self._aside, self._in_worlds, self._next = None, False, True, point
        self._begin()
        self._may_measure = not self._returned

    def _begin(self) -> None:
        """Begin a row of steps."""
        self._at = self._best = None
        steps = self._steps if self._in_worlds else _LONGER * self._steps
        self._left, self._damping, self._reach, self._detours = steps, self._wary, _REACH, 0
        self._rough.begin()

    def _begin_at_other(self, other: Tried) -> None:
        """Begin again at the start, whose outcome is known: where the first point leads nowhere."""
        assert self._given is not None
        self.jacobian = self._prior = self._given
        self._other, self._in_worlds, self._agreed = None, False, other.point
        self._begin()
        self._learn(other)

    def _learn(self, tried: Tried) -> None:
        """Correct the Jacobian, judge the last step and take the next one."""
        if self._best is None or tried.cost < self._best.cost:
            self._best = tried
        self._note(tried)
        if self._at is None:
            if not np.isfinite(tried.residuals).any():
                self._step_back(tried.point)
                return
            self._at = tried
        else:
            self._judge(self._at, tried)
        enough = self._best.cost <= _NEAR and self.n_worlds > 1 and not self._in_worlds
        # All off alike in spite of steps: what tells why is cheap.
        short = self._in_worlds and self._reach <= _ASTRAY
        lost = short and not self._best.apart and self._worth_measuring(self._best)
        lost |= short and self._best.within
        if enough or lost or self._left == 0 or self._reach < _LEAST_REACH:
            self._end()
        else:
            self._go_on(self._at)

    def _note(self, tried: Tried) -> None:
        """Keep what has an outcome in the first world."""
        if np.isfinite(tried.residuals[0]).all():
            self._seen.append(tried)
            if self._nearest is None or tried.first < self._nearest.first:
                self._nearest = tried

    def _go_on(self, tried: Tried) -> None:
        """Take the next step from a point."""
        assert self._prior is not None
        assert self._best is not None
        self._left -= 1
        if self._in_worlds:
            self._next = self._within(tried.point + self._step(tried))
            return
        self.jacobian = learn_slopes(self._prior, tried, [o for o in self._seen if o is not tried])
        slopes = self.jacobian[0]
        anew = self._rough.begins_anew(self._best, slopes)
        if anew is None:
            begin = self._rough.beside(tried, slopes, self._within)
            anew = begin.point + self._step(begin)
        self._next = self._within(anew)

    def _within(self, points: FloatArray) -> FloatArray:
        """Move points (..., D) to where they may be."""
        points = np.maximum(points, self._floor)
        return points if self._bounds is None else np.clip(points, *self._bounds)

    def _measure_anew(self, tried: Tried) -> None:
        """Ask for points along the directions that matter most, to the side that leads down.

        Where all worlds are off alike, the first tells of all.
        """
        assert self.jacobian is not None
        self._alone = not tried.apart
        n = 1 if self._alone else len(tried.residuals)
        ways = ways_down(self.jacobian * self._trust, tried.residuals[:n], _DIRECTIONS)
        self._block = self._within(tried.point + _DIFFERENCE * ways)
        self._may_measure = False

    def _learn_anew(self, tried: list[Tried]) -> None:
        """Correct the Jacobian by what came of those points, and go on from the best."""
        assert self._best is not None
        assert self.jacobian is not None
        self._block, before = None, self._best
        for one in tried:
            self._note(one)
            self.jacobian = correct_by_step(self.jacobian, before, one, _TRUST_OF_MEASURED)
        if self._alone and self._in_worlds:
            # One world tells where to aim, until it is near.
            self._in_worlds, self._returned, self._prior = False, True, self.jacobian
            before = Tried(before.point, before.residuals[:1])
        best = min([before, *tried], key=lambda one: one.cost)
        self._begin()
        self._at = self._best = best
        if best.cost <= _NEAR and self.n_worlds > 1 and not self._in_worlds:
            self.enter_worlds(best.point)
        else:
            self._go_on(best)

    def _step_back(self, point: FloatArray) -> None:
        """Halve the way to the first point: there is no outcome there."""
        if self._back == _STEPS_BACK or not np.any(point - self._start):
            self._end()
            return
        self._back += 1
        self._next = 0.5 * (point + self._start)

    def _judge(self, before: Tried, after: Tried) -> None:
        """Go on from where a step has led, or back, and in all worlds with a shorter one."""
        assert self._best is not None
        assert self.jacobian is not None
        if not self._in_worlds and before.cost <= FAR:
            self._at = self._rough.judge(before, after)
            self._left += after.cost < _PROGRESS * before.cost
            return
        if self._in_worlds:
            self.jacobian = correct_by_step(self.jacobian, before, after, _TRUST)
        closer = after.spread < before.spread - _CLOSER and np.isfinite(after.residuals).all()
        if after.cost < before.cost:
            self._at, self._detours = after, 0
            self._left += after.cost < _PROGRESS * before.cost
        elif closer and self._detours < self._most_detours:
            self._at, self._detours = after, self._detours + 1
        else:
            self._at, self._detours = self._best, 0
            self._damping, self._reach = 2.0 * self._damping, 0.5 * self._reach

    def _step(self, tried: Tried) -> FloatArray:
        """Return the damped step of the linear model [1]_, no longer than the reach."""
        assert self.jacobian is not None
        if not self._in_worlds and self._foresees:
            tried = foresee(tried, self.jacobian, self._agreed)
        known, n = np.isfinite(tried.residuals), len(tried.residuals)
        rows = self.jacobian[:n][known] / np.sqrt(n)
        wanted = tried.residuals[known] / np.sqrt(n)
        return damped_step(
            rows, wanted, self._trust, self._damping, self._reach, self._floor - tried.point
        )

    def _end(self) -> None:
        """End, or look at all worlds, if an outcome is within the radius; else begin elsewhere.

        At the start, if its outcome is known; with a Jacobian of its own; by CMA-ES.
        """
        best = self._best
        near = best is not None and best.cost <= 1.0
        if self._strategy is not None:
            self._aside = False
            if near and best is not None and self.n_worlds > 1:
                self.enter_worlds(best.point)
            return
        if self._worth_measuring(best):
            self._measure_anew(best)
        elif best is not None and near and self.n_worlds > 1 and not self._in_worlds:
            self.enter_worlds(best.point)
        elif near:
            self._ended = True
        elif self._other is not None:
            self._begin_at_other(self._other)
        elif best is not None and self._in_worlds and rms(best.residuals[:1]) <= 1.0:
            # CMA-ES looks at the model as it is alone, which this serves already.
            self._ended = True
        else:
            self.hand_over()

    def hand_over(self) -> None:
        """Have CMA-ES go on from the best point, if it does not yet."""
        if self._strategy is None:
            self._begin_cma(self._start if self._nearest is None else self._nearest.point)
            self.handed_over = True

    def _worth_measuring(self, best: Tried | None) -> TypeGuard[Tried]:
        """Tell whether steps stalled for want of a Jacobian that holds here."""
        if best is None or not self._may_measure or not best.cost < np.inf:
            return False
        if not self._in_worlds:
            return best.cost > FAR
        unspread = not best.apart or best.cost <= 1.0 or self._other is None
        return best.cost > _POOR and unspread

    def _begin_cma(self, start: FloatArray) -> None:
        """Have CMA-ES go on."""
        sigma, population, seed, bounds, restarts = self._options
        self._strategy = CmaEs(start, sigma, population, seed, bounds, restarts)
