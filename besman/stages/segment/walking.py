"""Paths in the frame of a person who walks: what the hand does, without where the person goes.

Of a person who stays, nothing is changed: leaning and turning the trunk are part of what a hand
does, and are in the laboratory's frame. Who goes farther than anybody leans takes the hand along;
then its path is looked at from the back.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.geometry.row_blocks import by_rows

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# People who reached while they stood moved their backs by up to 0.26 m, and turned by up to 76
# degrees; the mean over a second leaves out the swaying.
_FARTHEST_LEAN_M = 0.6
_MOST_TURN_RAD = np.radians(120.0)
_MEAN_OVER_S = 1.0


def take_from_person(paths: FloatArray, back: FloatArray, rate_hz: float) -> FloatArray:
    """Return paths as seen from the back of a person who walks, as they are of one who stays.

    Parameters
    ----------
    paths : array, shape (T, m, 3)
        Positions of m markers, metres, laboratory frame, z up.
    back : array, shape (T, 3, 3)
        Middle, left and right of the back, metres; NaN where not seen.
    rate_hz : float
        Frames per second.

    Returns
    -------
    array, shape (T, m, 3)
        Of one who walks: relative to the middle of the back, beginning where they began; turned
        with the back too, if that turns farther than anybody does who faces one thing.
    """
    seen = np.flatnonzero(by_rows(lambda some: np.isfinite(some).all(axis=(1, 2)), back))
    if seen.size < 2:
        return paths
    rows = np.arange(len(back))
    middle = _interpolate(rows, seen, by_rows(lambda some: back[some].mean(axis=1), seen))
    if np.ptp(_mean_over(middle[:, :2], rate_hz), axis=0).max() <= _FARTHEST_LEAN_M:
        return paths
    relative = paths - middle[:, np.newaxis]
    across = back[seen, 1] - back[seen, 2]
    heading = np.unwrap(np.arctan2(across[:, 1], across[:, 0]))[:, np.newaxis]
    turn = _interpolate(rows, seen, heading)[:, 0]
    if np.ptp(_mean_over(turn[:, np.newaxis], rate_hz)) > _MOST_TURN_RAD:
        relative = _turn_back(relative, turn - turn[0])
    moved: FloatArray = relative + middle[0]
    return moved


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
