"""Left and right of a person: told from how people are built, and where two markers exchange.

Three markers on a body look alike when two of them are exchanged. What they are on does not: the
right shoulder is right of the back, and the back of a hand does not face the inside of the elbow
for long. For a right arm that bends, the normal of the plane through shoulder, elbow and hand,
taken so that it points away from the trunk, is where the back of the hand faces with the thumb up;
turning the forearm leads at most a quarter turn away from it to either side.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_runs, find_seen
from besman.geometry.row_blocks import by_rows

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

# Between two frames no body turns so far: half a turn is an exchange.
_HALF_TURN_COSINE = -0.7
_LONGEST_STEP_S = 0.1
# An arm that is stretched out does not say where its elbow points.
_LEAST_BEND = 0.3
# Mean evidence from which on it is believed without an exchange that is seen to happen.
_SURE = 0.25
_LEAST_EVIDENCE_S = 0.3


def weigh_back(
    left: FloatArray, right: FloatArray, shoulder: FloatArray, side: float
) -> FloatArray:
    """Weigh whether left and right of the back are as they are called.

    Parameters
    ----------
    left, right : array, shape (T, 3)
        Markers on the back, metres; NaN where not seen.
    shoulder : array, shape (T, 3)
        Marker at a shoulder, metres.
    side : float
        1 for the left shoulder, -1 for the right one.

    Returns
    -------
    array, shape (T,)
        Cosine between the line to the shoulder and where it should lead: -1 to 1, negative where
        it lies on the wrong side; NaN where not seen.
    """

    def weigh(left: FloatArray, right: FloatArray, shoulder: FloatArray) -> FloatArray:
        across = _unit(left - right)
        to_shoulder = _unit(shoulder - 0.5 * (left + right))
        weight: FloatArray = side * np.sum(across * to_shoulder, axis=1)
        return weight

    return by_rows(weigh, left, right, shoulder)


def weigh_hand(
    hand: tuple[FloatArray, FloatArray, FloatArray],
    elbow: FloatArray,
    shoulder: FloatArray,
    side: float,
) -> FloatArray:
    """Weigh whether left and right of a hand are as they are called.

    Parameters
    ----------
    hand : three arrays, shape (T, 3)
        Top, left and right of the back of the hand, metres; NaN where not seen.
    elbow, shoulder : array, shape (T, 3)
        Metres.
    side : float
        1 for the left hand, -1 for the right one.

    Returns
    -------
    array, shape (T,)
        Cosine between where the back of the hand faces and where it does with the thumb up: -1 to
        1, negative where no forearm turns it; NaN where not seen or where the arm is stretched.
    """

    def weigh(
        top: FloatArray,
        left: FloatArray,
        right: FloatArray,
        elbow: FloatArray,
        shoulder: FloatArray,
    ) -> FloatArray:
        out = _unit(np.cross(top - 0.5 * (left + right), left - right))
        bend = np.cross(_unit(elbow - shoulder), _unit(top - elbow))
        bend[~(np.linalg.norm(bend, axis=1) >= _LEAST_BEND)] = np.nan
        weight: FloatArray = -side * np.sum(out * _unit(bend), axis=1)
        return weight

    return by_rows(weigh, *hand, elbow, shoulder)


def find_exchanged(
    left: FloatArray, right: FloatArray, evidence: FloatArray, rate_hz: float
) -> BoolArray:
    """Find the frames in which two markers of one body have each other's name.

    From frame to frame the line through both may turn a little; where it turns by half a turn, the
    two exchange. Between two such places nothing changes, so that the evidence of all frames says
    which of them are meant.

    Parameters
    ----------
    left, right : array, shape (T, 3)
        The two markers, metres; NaN where not seen.
    evidence : array, shape (T,)
        Of each frame, -1 to 1, negative where the two seem exchanged; NaN where nothing is known.
    rate_hz : float
        Frames per second.

    Returns
    -------
    bool array, shape (T,)
        False where one of the two is not seen.
    """
    exchanged = np.zeros(len(left), dtype=np.bool_)
    seen = np.flatnonzero(by_rows(lambda one, two: find_seen(one - two), left, right))
    if not seen.size:
        return exchanged
    steps = np.diff(seen)

    def turns(before: IntArray, after: IntArray) -> BoolArray:
        units = _unit(left[after] - right[after]) * _unit(left[before] - right[before])
        return np.asarray(np.sum(units, axis=1) < _HALF_TURN_COSINE)

    flips = by_rows(turns, seen[:-1], seen[1:])
    broken = steps > _LONGEST_STEP_S * rate_hz + 1.0
    edges = [0, *(np.flatnonzero(broken) + 1).tolist(), len(seen)]
    # What is held of an hour at 500 Hz is a dozen megabytes each time.
    del steps, broken
    for first, last in pairwise(edges):
        rows = seen[first:last]
        turned = np.concatenate(([False], np.logical_xor.accumulate(flips[first : last - 1])))
        weight = evidence[rows]
        n_known = int(np.isfinite(weight).sum())
        np.nan_to_num(weight, copy=False)
        np.negative(weight, out=weight, where=turned)
        total = float(weight.sum())
        sure = n_known >= _LEAST_EVIDENCE_S * rate_hz and abs(total) > _SURE * n_known
        if sure:
            exchanged[rows] = turned == (total > 0.0)
        elif turned.any():
            # Nothing but the exchange itself is known: what lasts is right.
            exchanged[rows] = turned == (2 * turned.sum() <= len(turned))
    return exchanged


def name_frames(exchanged: BoolArray, first_frame: int, most: int = 4) -> str:
    """Say which frames are meant, as ``10 to 20, 31 and 3 more stretches``."""
    runs = find_runs(exchanged) + first_frame
    named = [f"{a} to {b - 1}" if b - a > 1 else f"{a}" for a, b in runs[:most]]
    rest = len(runs) - most
    return ", ".join(named) + (f" and {rest} more stretches" if rest > 0 else "")


def _unit(vectors: FloatArray) -> FloatArray:
    """Return vectors (T, 3) of length one; NaN where there is no direction."""
    lengths = np.linalg.norm(vectors, axis=1)
    units: FloatArray = vectors / np.where(lengths > 0.0, lengths, np.nan)[:, None]
    return units
