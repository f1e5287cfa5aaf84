"""Paths in the frame of a person who walks: what the hand does, without where the person goes.

Of a person who stays, nothing is changed: leaning and turning the trunk are part of what a hand
does, and are in the laboratory's frame. Who goes farther than anybody leans takes the hand along;
then its path is looked at from the back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_seen
from besman.geometry.row_blocks import by_rows

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

# People who reached while they stood moved their backs by up to 0.26 m, and turned by up to 76
# degrees; the mean over a second leaves out the swaying.
_FARTHEST_LEAN_M = 0.6
_MOST_TURN_RAD = np.radians(120.0)
_MEAN_OVER_S = 1.0


def take_from_person(paths: FloatArray, back: Sequence[FloatArray], rate_hz: float) -> FloatArray:
    """Return paths as seen from the back of a person who walks, as they are of one who stays.

    Parameters
    ----------
    paths : array, shape (T, m, 3)
        Positions of m markers, metres, laboratory frame, z up.
    back : three arrays, shape (T, 3)
        Middle, left and right of the back, metres; NaN where not seen.
    rate_hz : float
        Frames per second.

    Returns
    -------
    array, shape (T, m, 3)
        Of one who walks: relative to the middle of the back, beginning where they began; turned
        with the back too, if that turns farther than anybody does who faces one thing.
    """
    seen = np.flatnonzero(by_rows(lambda *some: _are_seen(some), *back))
    if seen.size < 2:
        return paths
    rows = np.arange(len(paths))

    def place(some: IntArray) -> FloatArray:
        return np.asarray(np.stack([marker[some] for marker in back], axis=1).mean(axis=1))

    middle = by_rows(place, seen)
    if max(_wander(rows, seen, middle[:, axis], rate_hz) for axis in (0, 1)) <= _FARTHEST_LEAN_M:
        return paths
    middle = _interpolate(rows, seen, middle)
    relative = paths - middle[:, np.newaxis]
    across = back[1][seen] - back[2][seen]
    heading = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))[:, np.newaxis]
    turn = _interpolate(rows, seen, heading)[:, 0]
    if np.ptp(_mean_over(turn[:, np.newaxis], rate_hz)) > _MOST_TURN_RAD:
        relative = _turn_back(relative, turn - turn[0])
    moved: FloatArray = relative + middle[0]
    return moved


def _are_seen(markers: Sequence[FloatArray]) -> BoolArray:
    """Tell in which rows all of some markers are seen."""
    return np.asarray(np.all([find_seen(marker) for marker in markers], axis=0))


def _wander(rows: IntArray, seen: IntArray, place: FloatArray, rate_hz: float) -> float:
    """Return how far apart the means of one coordinate over `_MEAN_OVER_S` are, metres."""
    # A coordinate at a time: of an hour at 500 Hz each copy has 14 MB.
    means = _mean_over(np.interp(rows, seen, place)[:, np.newaxis], rate_hz)
    return float(np.ptp(means))


def _interpolate(rows: IntArray, seen: IntArray, x: FloatArray) -> FloatArray:
    """Interpolate the columns of x linearly between the rows that are seen."""
    return np.stack([np.interp(rows, seen, column) for column in x.T], axis=1)


def _mean_over(values: FloatArray, rate_hz: float) -> FloatArray:
    """Return means over `_MEAN_OVER_S` of values (T, n): (R, n); over all where T is shorter."""
    width = min(len(values), max(1, round(_MEAN_OVER_S * rate_hz)))
    sums = np.concatenate((np.zeros((1, values.shape[1])), np.cumsum(values - values[0], axis=0)))
    means: FloatArray = (sums[width:] - sums[:-width]) / width
    return means


def _turn_back(paths: FloatArray, angle: FloatArray) -> FloatArray:
    """Turn paths (T, m, 3) about z by minus an angle (T,), radians."""
    cosine, sine = np.cos(angle)[:, np.newaxis], np.sin(angle)[:, np.newaxis]
    x, y = paths[..., 0], paths[..., 1]
    return np.stack((cosine * x + sine * y, cosine * y - sine * x, paths[..., 2]), axis=-1)
