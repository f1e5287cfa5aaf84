"""Gauss-Newton steps from one place after another: what stalls at one may get on at the next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.search.protocol import ResidualSearch
from besman.search.residual_points import Tried

FloatArray = npt.NDArray[np.float64]

# What leaves less than this of the cost is progress; so many tries in all worlds without any, or so
# many in the model alone before all worlds are looked at, are enough at one place.
_PROGRESS = 0.9
_PATIENCE, _PATIENCE_ALONE = 2, 10


class Relay:
    """Searches one after another; after the last, the one that came nearest goes on to its end.

    Parameters
    ----------
    searches : sequence of ResidualSearch
        Alike but for where they begin and what slopes they know.
    waits : bool
        Whether it ends as soon as all have stalled, because there will be other places to begin at.
    """

    def __init__(self, searches: Sequence[ResidualSearch], waits: bool) -> None:
        self._legs = [_Leg(one) for one in searches]
        self._waits, self._at, self._patient = waits, 0, True
        self.waiting = False
        """Whether all have stalled, and other places are waited for."""

    @property
    def _search(self) -> ResidualSearch:
        return self._legs[self._at].search

    @property
    def begun_again(self) -> bool:
        """Whether another place than the first has been begun at."""
        return self._at > 0 or not self._patient

    @property
    def jacobian(self) -> FloatArray | None:
        """Of the search that is on, shape (W, R, D)."""
        return self._search.jacobian

    @property
    def n_worlds(self) -> int:
        """In how many worlds points are to be tried."""
        return self._search.n_worlds

    @property
    def in_worlds(self) -> bool:
        """Whether the points asked for next are to be tried in all of them."""
        return self._search.in_worlds

    @property
    def handed_over(self) -> bool:
        """Whether CMA-ES goes on in the search that is on."""
        return self._search.handed_over

    @property
    def exhausted(self) -> bool:
        """Whether going on is of no use, or of none yet."""
        return self.waiting or self._search.exhausted

    def hand_over(self) -> None:
        """Have CMA-ES go on, unless other places are waited for."""
        if not self.waiting:
            self._search.hand_over()

    def enter_worlds(self, point: FloatArray) -> None:
        """Look at all worlds from now on, beginning at a point (D,)."""
        self._search.enter_worlds(point)

    def ask(self) -> FloatArray:
        """Return the points to try next, shape (P, D)."""
        return self._search.ask()

    def tell_start(self, point: FloatArray, residuals: FloatArray) -> None:
        """Take the residuals (1, R) of the start (D,) for the first search."""
        self._search.tell_start(point, residuals)

    def tell(
        self, points: FloatArray, returns: FloatArray, residuals: FloatArray | None = None
    ) -> None:
        """Take what came of the points (P, D); see `besman.search.gauss_newton.GaussNewton`."""
        self._search.tell(points, returns, residuals)
        if not self._patient or residuals is None:
            return
        self._legs[self._at].note(points, residuals)
        if not self._legs[self._at].stalled:
            return
        if self._at + 1 < len(self._legs):
            self._at += 1
        elif self._waits:
            self.waiting = True
        else:
            self._patient = False
            nearest = min(self._legs, key=lambda leg: (leg.least, leg.least_alone))
            self._at = self._legs.index(nearest)


class _Leg:
    """A search from one place, and whether it gets on.

    Attributes
    ----------
    search : ResidualSearch
    least, least_alone : float
        Root mean square of the distances to the target, in radii, in all worlds and in the model
        alone, the least so far.
    """

    def __init__(self, search: ResidualSearch) -> None:
        self.search = search
        self.least = self.least_alone = np.inf
        self._vain = self._n_alone = 0
        self._hits = False

    def note(self, points: FloatArray, residuals: FloatArray) -> None:
        """Take note of a generation: points (P, D) with residuals (P, W, R)."""
        tried = [Tried(*one) for one in zip(points, residuals, strict=True)]
        cost = min(one.cost for one in tried)
        if residuals.shape[1] == 1:
            self._n_alone += 1
            self.least_alone = min(self.least_alone, cost)
            return
        self._vain = 0 if cost < _PROGRESS * self.least else self._vain + 1
        self.least = min(self.least, cost)
        self._hits |= any(one.within for one in tried)

    @property
    def stalled(self) -> bool:
        """Whether to try another place before this one goes on, at a greater cost or in vain.

        Not where all worlds' outcomes are within the radius already: the rest is soon done.
        """
        search = self.search
        if self._hits:
            return False
        if search.exhausted or search.handed_over or len(search.ask()) > 1:
            return True
        alone = self._n_alone >= _PATIENCE_ALONE and not search.in_worlds
        return alone or self._vain >= _PATIENCE
