"""Gaps in rigid clusters, filled from the markers of the cluster that are seen."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.geometry.cubic_spline import interpolate_cubic
from besman.geometry.gaps import BoolArray, find_runs

FloatArray = npt.NDArray[np.float64]

# How much the interpolated place counts beside a seen marker: it only settles the turn about the
# line through two seen markers, which these leave open.
_GUESS_WEIGHT = 1e-3
_N_KNOTS = 8  # samples on each side of a gap that the interpolation goes through


def fill_cluster(positions: FloatArray, longest: int) -> tuple[FloatArray, BoolArray]:
    """Fill the gaps of markers that form a rigid body.

    At least two others of the body must be seen. The body's shape, learnt from the frames that
    show all of it, is laid on the markers seen (least squares). Where these are two, the turn
    about the line through them is taken from the missing marker's interpolated place relative to
    them. What is left at both ends of the gap (skin moves) is spread over it.

    Parameters
    ----------
    positions : array, shape (T, K, 3)
        Markers of the body, metres; NaN where not seen.
    longest : int
        Greatest number of samples to fill at a stretch.

    Returns
    -------
    positions : array, shape (T, K, 3)
        Filled where that was possible.
    filled : bool array, shape (T, K)
        Which samples were filled.

    References
    ----------
    Arun et al. (1987), Least-squares fitting of two 3-D point sets,
    https://doi.org/10.1109/TPAMI.1987.4767965
    """
    result = positions.copy()
    seen: BoolArray = np.all(np.isfinite(positions), axis=2)
    filled = np.zeros(seen.shape, dtype=np.bool_)
    if positions.shape[1] < 3 or seen.all() or not seen.all(axis=1).any():
        return result, filled
    shape = learn_shape(positions[seen.all(axis=1)])
    for marker in range(positions.shape[1]):
        for start, end in find_runs(~seen[:, marker]):
            inside = start > 0 and end < len(positions)
            if not inside or end - start > longest:
                continue
            _fill_run(result, filled, positions, seen, shape, marker, int(start), int(end))
    return result, filled


def _fill_run(
    result: FloatArray,
    filled: BoolArray,
    positions: FloatArray,
    seen: BoolArray,
    shape: FloatArray,
    marker: int,
    start: int,
    end: int,
) -> None:
    """Fill one gap in place if two mates are seen through all of it."""
    around = slice(start - 1, end + 1)
    mates = np.flatnonzero(seen[around].all(axis=0))
    if len(mates) < 2:
        return
    # Relative to its mates a marker hardly moves, so interpolating that way is safest.
    middle = positions[:, mates].mean(axis=1)
    relative = positions[:, marker] - middle
    known = np.flatnonzero(np.isfinite(relative[:, 0]))
    first = max(0, int(np.searchsorted(known, start)) - _N_KNOTS)
    near = known[first : first + 2 * _N_KNOTS]
    frames = np.arange(start - 1, end + 1)
    guess = interpolate_cubic(near, relative[near], frames) + middle[around]
    points = np.concatenate((positions[around][:, mates], guess[:, None]), axis=1)
    weights = np.append(np.ones(len(mates)), _GUESS_WEIGHT if len(mates) == 2 else 0.0)
    places = place_shape(shape[[*mates, marker]], points, weights)[:, -1]
    share = np.linspace(0.0, 1.0, len(frames))[:, None]
    left = positions[start - 1, marker] - places[0]
    right = positions[end, marker] - places[-1]
    result[start:end, marker] = (places + (1.0 - share) * left + share * right)[1:-1]
    filled[start:end, marker] = True


def learn_shape(positions: FloatArray, n_most: int = 500) -> FloatArray:
    """Return the mean shape of a body about its centroid.

    Parameters
    ----------
    positions : array, shape (T, K, 3)
        Frames that show all of it, metres.
    n_most : int
        Most frames that are used, spread over all.

    Returns
    -------
    array, shape (K, 3)
        Metres, in a frame of its own.
    """
    positions = positions[:: -(-len(positions) // n_most)]
    shape: FloatArray = positions[0] - positions[0].mean(axis=0)
    weights = np.ones(len(shape))
    for _ in range(3):
        rotation, _ = _fit(positions, shape, weights)
        centred = positions - positions.mean(axis=1, keepdims=True)
        shape = np.einsum("tij,tkj->tki", rotation, centred).mean(axis=0)
        shape -= shape.mean(axis=0)
    return shape


def place_shape(shape: FloatArray, points: FloatArray, weights: FloatArray) -> FloatArray:
    """Lay a shape on points by rotation and translation, least squares.

    Parameters
    ----------
    shape : array, shape (K, 3)
        Metres.
    points : array, shape (T, K, 3)
        Where its markers are, metres.
    weights : array, shape (K,)
        How much each counts.

    Returns
    -------
    array, shape (T, K, 3)
        The placed shape, metres.
    """
    centre = np.average(shape, axis=0, weights=weights)
    rotation, middle = _fit(points, shape - centre, weights)
    laid: FloatArray = np.einsum("tji,kj->tki", rotation, shape - centre) + middle[:, None]
    return laid


def _fit(
    points: FloatArray, shape: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the rotations from the points to the shape (T, 3, 3) and the points' centres."""
    middle = np.average(points, axis=1, weights=weights)
    centred = points - middle[:, None]
    correlation = np.einsum("k,ki,tkj->tij", weights, shape, centred)
    left, _, right = np.linalg.svd(correlation)
    left = left.copy()
    left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
    return left @ right, middle
