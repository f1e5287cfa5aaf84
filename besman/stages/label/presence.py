"""Whether the body of a marker set is there at all, once names were found."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import combinations

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_seen
from besman.geometry.row_blocks import by_rows, measure_apart
from besman.person.marker_set import MarkerSet
from besman.stages.label.model import MarkerModel
from besman.stages.label.person_check import find_exchanges, limbs_of_arms, say_limbs

FloatArray = npt.NDArray[np.float64]

# The best explanation of any points leaves some out. 145 stretches of recordings without an arm, by
# four models each, got four to seven of eight required markers in 374 cases, all eight in 6.
_MOST_MISSING = 0.1
_ENOUGH_GIVEN = 0.5
# Root mean square deviation of a cluster's distances from what is known of it. In recordings that
# have the body it stays below a tenth of this, in those 6 it was twice as much.
_MOST_DEVIATION_M = 0.0125
_MOST_DEVIATION = 0.125  # share of the distance, added


def find_absence(
    paths: Mapping[str, FloatArray],
    marker_set: MarkerSet,
    model: MarkerModel,
    rate_hz: float,
    given: Collection[str] = (),
) -> str | None:
    """Tell why names that were found can not be those of a body.

    Naming takes the best of all explanations, which of legs is an arm as well. An arm that is
    there has all its markers, clusters that are as large as they are known to be and keep their
    shape, limbs as people have them, and the shoulder on its side of the back.

    Parameters
    ----------
    paths : mapping of str to array, shape (T, 3)
        Markers as they were named, metres; NaN where not seen.
    marker_set : MarkerSet
    model : MarkerModel
        What the names were found by.
    rate_hz : float
        Frames per second.
    given : collection of str
        Markers that the recording names itself; with half of those required the body is there.

    Returns
    -------
    str or None
        The reason, None if the body is there.
    """
    missing = [marker for marker in marker_set.required if marker not in paths]
    n = len(marker_set.required)
    known = sum(marker in given for marker in marker_set.required)
    if len(missing) > _MOST_MISSING * n and known < _ENOUGH_GIVEN * n:
        return f"{n - len(missing)} of {n} required markers found, without {', '.join(missing)}"
    return (
        _find_broken_cluster(paths, marker_set, model)
        or _find_odd_limb(paths, marker_set)
        or _find_wrong_side(paths, rate_hz, given)
    )


def _find_broken_cluster(
    paths: Mapping[str, FloatArray], marker_set: MarkerSet, model: MarkerModel
) -> str | None:
    """Tell which cluster has not the size that it is known to have, or does not keep its shape."""
    for cluster, markers in marker_set.clusters.items():
        there = [marker for marker in markers if marker in paths and marker in model.markers]
        for one, two in combinations(there, 2):
            apart = measure_apart(paths[one], paths[two])
            apart = apart[np.isfinite(apart)]
            if not apart.size:
                continue
            known = model.distance[model.markers.index(one), model.markers.index(two)]
            deviation = float(np.sqrt(np.mean((apart - known) ** 2)))
            if deviation > _MOST_DEVIATION_M + _MOST_DEVIATION * known:
                return (
                    f"cluster {cluster} is not as known: {one} and {two} are "
                    f"{1e3 * apart.mean():.0f} mm apart, changing by {1e3 * apart.std():.0f} mm, "
                    f"expected {1e3 * known:.0f} mm"
                )
    return None


def _find_odd_limb(paths: Mapping[str, FloatArray], marker_set: MarkerSet) -> str | None:
    """Tell which limb nobody has, or does not keep its length."""
    for limbs in limbs_of_arms(paths, marker_set):
        for one in limbs:
            if not one.is_human:
                return say_limbs([one])
            if not one.is_steady:
                return (
                    f"{one.limb.first} to {one.limb.second} changes by {100 * one.change:.0f} % "
                    "of its length"
                )
    return None


def _find_wrong_side(
    paths: Mapping[str, FloatArray], rate_hz: float, given: Collection[str]
) -> str | None:
    """Tell which markers lie on the wrong side of the body for most of the time."""
    for (one, two), exchanged, why in find_exchanges(paths, rate_hz, ""):
        seen = by_rows(lambda a, b: find_seen(a - b), paths[one], paths[two])
        if 2 * exchanged.sum() > seen.sum() and not {one, two} & set(given):
            return f"{one} and {two} lie the wrong way round: {why}"
    return None
