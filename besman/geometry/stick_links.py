"""Which points of a body to join by lines: those that keep near each other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_FRAMES = 100
_LEAST_TOGETHER = 5  # frames of these that show both
_MOST_CHANGE_M = 0.05  # standard deviation: limbs between two markers keep their length better
_CHANGE = 4.0  # a pair whose distance changes by 1 cm counts like one 4 cm farther apart


def find_links(positions: FloatArray, longest_m: float = 0.5) -> list[tuple[int, int]]:
    """Join points by the tree whose lines are short and keep their length.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Metres; NaN where not seen.
    longest_m : float
        Points farther apart (mean) are not joined, nor those whose distance changes, so that there
        may be several trees.

    Returns
    -------
    list of (int, int)
        Pairs of points, at most M - 1.

    References
    ----------
    R. C. Prim (1957), Shortest connection networks and some generalizations,
    https://doi.org/10.1002/j.1538-7305.1957.tb01515.x
    """
    few = positions[:: max(1, -(-len(positions) // _FRAMES))]
    costs = np.stack([_measure_costs(few, column, longest_m) for column in range(few.shape[1])])
    left = set(range(few.shape[1]))
    links = []
    while left:
        tree = [left.pop()]
        best = {column: (costs[tree[0], column], tree[0]) for column in left}
        while best:
            column = min(best, key=lambda one: best[one])
            cost, mate = best.pop(column)
            if not np.isfinite(cost):
                break
            links.append((mate, column))
            left.discard(column)
            best = {one: min(old, (costs[column, one], column)) for one, old in best.items()}
    return links


def _measure_costs(positions: FloatArray, column: int, longest_m: float) -> FloatArray:
    """Return how badly a point is joined to each, shape (M,); infinite where it must not be."""
    apart = np.linalg.norm(positions - positions[:, column : column + 1], axis=2)
    together = np.isfinite(apart)
    count = together.sum(axis=0)
    mean = np.where(together, apart, 0.0).sum(axis=0) / np.maximum(count, 1)
    spread = np.where(together, (apart - mean) ** 2, 0.0).sum(axis=0) / np.maximum(count, 1)
    costs = mean + _CHANGE * np.sqrt(spread)
    apart_for_good = (mean > longest_m) | (spread > _MOST_CHANGE_M**2)
    costs[(count < min(_LEAST_TOGETHER, len(positions))) | apart_for_good] = np.inf
    return np.asarray(costs)
