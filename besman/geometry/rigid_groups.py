"""Which markers move together as rigid bodies."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_FRAMES = 300
_PER_METRE = 0.02  # 5 cm farther apart counts like a distance that varies by 1 mm more
_LEAST_TOGETHER = 20  # frames that show both, or all of a short recording


def find_rigid_groups(
    positions: FloatArray, rigid_m: float = 0.004, longest_m: float = 0.25
) -> list[tuple[int, ...]]:
    """Find groups of three and more markers of which all distances stay the same.

    Groups grow from the most rigid and nearest pairs; each further marker must be rigid to all of
    a group. Who hardly moves is one body but for the distances: a shoulder is not of the back.

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
    costs = _measure_costs(few, rigid_m, longest_m)
    pairs = np.argwhere(np.triu(np.isfinite(costs), 1))
    order = np.argsort(costs[tuple(pairs.T)], kind="stable")
    left = set(range(few.shape[1]))
    groups = []
    for first, second in pairs[order].tolist():
        if not {first, second} <= left:
            continue
        group = [first, second]
        while True:
            worst = {one: costs[one, group].max() for one in left - set(group)}
            best = min(worst, key=lambda one: worst[one], default=None)
            if best is None or not np.isfinite(worst[best]):
                break
            group.append(best)
        if len(group) > 2:
            groups.append(tuple(sorted(group)))
            left -= set(group)
    return sorted(groups)


def _measure_costs(positions: FloatArray, rigid_m: float, longest_m: float) -> FloatArray:
    """Return how little each pair looks like one body, (M, M); infinite where it is none."""
    n_markers = positions.shape[1]
    costs = np.full((n_markers, n_markers), np.inf)
    least = min(_LEAST_TOGETHER, len(positions))
    for column in range(n_markers):
        apart = np.linalg.norm(positions - positions[:, column : column + 1], axis=2)
        for other in range(n_markers):
            known = apart[np.isfinite(apart[:, other]), other]
            if other == column or len(known) < least:
                continue
            mean, spread = known.mean(), known.std()
            if mean <= longest_m and spread <= rigid_m:
                costs[column, other] = spread + _PER_METRE * mean
    return costs
