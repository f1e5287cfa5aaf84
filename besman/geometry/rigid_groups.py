"""Which markers move together as rigid bodies."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_FRAMES = 300
_LEAST_TOGETHER = 20  # frames that show both, or all of a short recording


def find_rigid_groups(
    positions: FloatArray, rigid_m: float = 0.004, longest_m: float = 0.25
) -> list[tuple[int, ...]]:
    """Find groups of three and more markers of which all distances stay the same.

    Groups grow from the most rigid pairs; each further marker must be rigid to all of a group.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Metres; NaN where not seen.
    rigid_m : float
        Standard deviation of a distance up to which it is rigid, metres.
    longest_m : float
        Greatest distance within a group, metres: what stands still does not move together.

    Returns
    -------
    list of tuple of int
        Columns in rising order; no marker is in two groups.
    """
    few = positions[:: max(1, -(-len(positions) // _FRAMES))]
    spreads = _measure_spreads(few, longest_m)
    pairs = np.argwhere(np.triu(spreads <= rigid_m, 1))
    order = np.argsort(spreads[tuple(pairs.T)], kind="stable")
    left = set(range(few.shape[1]))
    groups = []
    for first, second in pairs[order].tolist():
        if not {first, second} <= left:
            continue
        group = [first, second]
        while True:
            worst = {one: spreads[one, group].max() for one in left - set(group)}
            best = min(worst, key=lambda one: worst[one], default=None)
            if best is None or worst[best] > rigid_m:
                break
            group.append(best)
        if len(group) > 2:
            groups.append(tuple(sorted(group)))
            left -= set(group)
    return sorted(groups)


def _measure_spreads(positions: FloatArray, longest_m: float) -> FloatArray:
    """Return how much the distance of each pair varies (M, M); infinite where it is too long."""
    n_markers = positions.shape[1]
    spreads = np.full((n_markers, n_markers), np.inf)
    least = min(_LEAST_TOGETHER, len(positions))
    for column in range(n_markers):
        apart = np.linalg.norm(positions - positions[:, column : column + 1], axis=2)
        for other in range(n_markers):
            known = apart[np.isfinite(apart[:, other]), other]
            if other != column and len(known) >= least and known.mean() <= longest_m:
                spreads[column, other] = known.std()
    return spreads
