"""Which neighbouring building blocks make an action: the best grouping, exactly."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Grouping:
    """Consecutive groups of blocks.

    Attributes
    ----------
    borders : tuple of int
        Rising, from 0 to the number of blocks: group g holds blocks borders[g] to
        borders[g + 1] - 1.
    fitness : float
        Minus the mean uncertainty of the groups.
    """

    borders: tuple[int, ...]
    fitness: float


class GroupingSearch:
    """Finds the best grouping of the blocks so far, each time a block is added.

    Best is the grouping with the greatest fitness, minus the mean uncertainty of its groups. For
    every border and every number of groups before it the least sum of uncertainties is kept, so
    that a block costs a time proportional to the number of groups times `longest`. Of equally good
    groupings the one with fewest groups counts, then the one with the shortest last group, and so
    on towards the front.

    Under a mean no border is ever certain: blocks to come that fit nothing make it worthwhile to
    cut what went before into as many groups as possible. With a `horizon` groups that lie far
    enough back are settled all the same, and memory and time stay bounded.

    Parameters
    ----------
    longest : int, optional
        Most blocks in one group.
    horizon : int, optional
        A group of the current best grouping is settled once at least this many blocks follow it.

    References
    ----------
    Thesis algorithm 1, steps 3 to 5, there by enumeration of all groupings.
    """

    def __init__(self, longest: int | None = None, horizon: int | None = None) -> None:
        for name, value in (("longest", longest), ("horizon", horizon)):
            if value is not None and value < 1:
                raise RecognitionError(f"compose: {name} is {value}; expected at least 1 block")
        self._longest, self._horizon = longest, horizon
        self._settled: tuple[int, ...] = (0,)
        self._settled_sum = 0.0
        self._costs: list[FloatArray] = []
        self._restart()

    @property
    def n_blocks(self) -> int:
        """Blocks so far."""
        return self._settled[-1] + len(self._costs)

    @property
    def n_settled(self) -> int:
        """Groups that do not change any more."""
        return len(self._settled) - 1

    @property
    def first_open(self) -> int:
        """First block that is not settled."""
        return self._settled[-1]

    @property
    def reach(self) -> int:
        """How many blocks the longest group that ends with the next block may have."""
        open_blocks = len(self._costs) + 1
        return open_blocks if self._longest is None else min(open_blocks, self._longest)

    def copy(self) -> GroupingSearch:
        """Return a search that goes on from here on its own."""
        twin = copy.copy(self)
        twin._costs, twin._sums, twin._choices = (
            self._costs[:],
            self._sums.copy(),
            self._choices[:],
        )
        return twin

    def add(self, uncertainty: npt.ArrayLike) -> None:
        """Add a block.

        Parameters
        ----------
        uncertainty : array, shape (`reach`,)
            Of the last 1, 2, ... blocks as one group, the new one included; infinite where a group
            is not allowed.

        Raises
        ------
        RecognitionError
            If an uncertainty is NaN or their number is not `reach`.
        """
        costs = np.asarray(uncertainty, dtype=np.float64)
        if costs.shape != (self.reach,):
            raise RecognitionError(
                f"compose: block {self.n_blocks}: got uncertainties of shape {costs.shape}, "
                f"expected ({self.reach},)"
            )
        if np.isnan(costs).any() or (costs == -np.inf).any():
            raise RecognitionError(
                f"compose: block {self.n_blocks}: the uncertainty of its group of "
                f"{int(np.argmax(~(costs > -np.inf))) + 1} blocks is "
                f"{costs[~(costs > -np.inf)][0]}; expected a number"
            )
        self._extend(costs)
        if self._horizon is not None:
            self._settle()

    def best(self) -> Grouping:
        """Return the best grouping of all blocks so far.

        Raises
        ------
        RecognitionError
            If there is no block, or no grouping is allowed.
        """
        if self.n_blocks == 0:
            raise RecognitionError("compose: got no blocks; expected at least 1")
        inner = self._trace()
        mean = self._means()
        return Grouping(self._settled[:-1] + inner, -float(mean.min()))

    def _restart(self) -> None:
        # Row j, column k: least sum of the first j open blocks in k groups.
        self._sums = np.full((16, 17), np.inf)
        self._sums[0, 0] = 0.0
        self._choices: list[npt.NDArray[np.intp]] = []

    def _extend(self, costs: FloatArray) -> None:
        """Add one row to the table."""
        self._costs.append(costs)
        n = len(self._costs)
        if n >= len(self._sums):
            size = 2 * len(self._sums)
            grown = np.full((size, size + 1), np.inf)
            grown[: len(self._sums), : self._sums.shape[1]] = self._sums
            self._sums = grown
        before = self._sums[n - len(costs) : n, :n][::-1]
        options = before + costs[:, np.newaxis]
        choice = options.argmin(axis=0)
        self._sums[n, 1 : n + 1] = options[choice, np.arange(n)]
        self._choices.append(choice + 1)

    def _means(self) -> FloatArray:
        """Mean uncertainty with 1, 2, ... open groups, the settled ones counted."""
        n = len(self._costs)
        if n == 0:
            return np.array([self._settled_sum / self.n_settled])
        counts = self.n_settled + np.arange(1, n + 1)
        means: FloatArray = (self._settled_sum + self._sums[n, 1 : n + 1]) / counts
        return means

    def _trace(self) -> tuple[int, ...]:
        """Borders of the best grouping from the last settled one on."""
        n = len(self._costs)
        if n == 0:
            return (self.first_open,)
        means = self._means()
        if not np.isfinite(means).any():
            raise RecognitionError(
                f"compose: no grouping of {self.n_blocks} blocks is allowed: too long a group or "
                "blocks that cannot be classified"
            )
        borders = [n]
        for count in range(int(means.argmin()) + 1, 0, -1):
            borders.append(borders[-1] - int(self._choices[borders[-1] - 1][count - 1]))
        return tuple(self.first_open + border for border in reversed(borders))

    def _settle(self) -> None:
        """Settle the groups that lie beyond the horizon; go on behind them."""
        assert self._horizon is not None
        if len(self._costs) <= self._horizon:
            return
        borders = self._trace()
        settled = [border for border in borders if border <= self.n_blocks - self._horizon]
        if len(settled) < 2:
            return
        costs, first = self._costs, self.first_open
        for start, end in pairwise(settled):
            self._settled_sum += float(costs[end - 1 - first][end - start - 1])
        self._settled = self._settled[:-1] + tuple(settled)
        self._costs = []
        self._restart()
        for open_blocks, row in enumerate(costs[settled[-1] - first :], start=1):
            self._extend(row[:open_blocks])


def best_grouping(uncertainty: npt.ArrayLike, longest: int | None = None) -> Grouping:
    """Find the best grouping of n blocks; see `GroupingSearch`.

    Parameters
    ----------
    uncertainty : array, shape (n, n)
        Entry [i, j] is the uncertainty of blocks i to j as one group, for i <= j; what is below the
        diagonal is not looked at. Infinite where a group is not allowed.
    longest : int, optional
        Most blocks in one group.

    Returns
    -------
    Grouping
        One block is one group.

    Raises
    ------
    RecognitionError
        If there are no blocks, an uncertainty is NaN, or no grouping is allowed.
    """
    costs = np.asarray(uncertainty, dtype=np.float64)
    if costs.ndim != 2 or costs.shape[0] != costs.shape[1]:
        raise RecognitionError(
            f"compose: got uncertainties of shape {costs.shape}, expected (n, n)"
        )
    search = GroupingSearch(longest)
    for end in range(len(costs)):
        search.add(costs[end - search.reach + 1 : end + 1, end][::-1])
    return search.best()
