"""Which motions are in one posture of the arm: a Jacobian of one holds for those alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from besman.records import AnyPlan, CartesianPlan

# Joints that are farther apart belong to another posture (elbow up or down, a wrist turned over);
# within one, throws of the embedded recordings are up to 0.7 rad apart.
_APART_RAD = 1.0


def group_by_posture(plans: Sequence[AnyPlan]) -> list[list[int]]:
    """Group motions whose joints are near each other's at start and goal, over others if need be.

    Parameters
    ----------
    plans : sequence of MotionPlan or CartesianPlan

    Returns
    -------
    list of list of int
        Places in `plans`, rising within a group; the groups in the order of their first.
    """
    ends = np.stack([_ends(plan) for plan in plans])
    near = np.abs(ends[:, None] - ends).max(axis=2) <= _APART_RAD
    groups, left = [], set(range(len(plans)))
    while left:
        found, new = set[int](), {min(left)}
        while new:
            found |= new
            new = {int(at) for one in new for at in np.flatnonzero(near[one])} - found
        groups.append(sorted(found))
        left -= found
    return groups


def _ends(plan: AnyPlan) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the joints at start and goal, rad; those at the start alone of a Cartesian plan."""
    if isinstance(plan, CartesianPlan):
        return np.asarray(plan.joints)
    return np.concatenate([plan.start, plan.goal])
