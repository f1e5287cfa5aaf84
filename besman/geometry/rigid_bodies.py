"""Gaps in rigid clusters, filled from the markers of the cluster that are seen."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from besman.geometry.cubic_spline import interpolate_cubic
from besman.geometry.gaps import BoolArray, find_runs

FloatArray = npt.NDArray[np.float64]

# How much the interpolated place counts beside a seen marker: it only settles the turn about the
# line through two seen markers, which these leave open.
_GUESS_WEIGHT = 1e-3
_N_KNOTS = 8  # samples on each side of a gap that the interpolation goes through
_SHAPE_FRAMES = 500  # of which a body's shape is learnt


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
    return result, fill_members(result, list(range(positions.shape[1])), longest)


def fill_members(positions: FloatArray, members: list[int], longest: int) -> BoolArray:
    """Fill the gaps of some markers as `fill_cluster` does, in the array given.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Metres; NaN where not seen.
    members : list of int, length K
        Those that form a rigid body.
    longest : int
        Greatest number of samples to fill at a stretch.

    Returns
    -------
    bool array, shape (T, K)
        Which samples were filled.
    """
    filled = np.zeros((len(positions), len(members)), dtype=np.bool_)
    if len(members) < 3:
        return filled
    sightings = [np.isfinite(positions[:, member]).all(axis=1) for member in members]
    seen: BoolArray = np.stack(sightings, axis=1)
    whole = np.flatnonzero(seen.all(axis=1))
    if seen.all() or whole.size == 0:
        return filled
    shape = learn_shape(positions[_thin_out(whole, _SHAPE_FRAMES)][:, members])
    for k in range(len(members)):
        for start, end in find_runs(~seen[:, k]):
            inside = start > 0 and end < len(positions)
            if inside and end - start <= longest:
                _fill_run(filled, positions, members, seen, shape, k, int(start), int(end))
    return filled


def _fill_run(
    filled: BoolArray,
    positions: FloatArray,
    members: list[int],
    seen: BoolArray,
    shape: FloatArray,
    k: int,
    start: int,
    end: int,
) -> None:
    """Fill one gap if two mates are seen through all of it; what was filled is never looked at."""
    around = slice(start - 1, end + 1)
    mates = np.flatnonzero(seen[around].all(axis=0))
    if len(mates) < 2:
        return
    marker, others = members[k], [members[mate] for mate in mates]
    # Relative to its mates a marker hardly moves, so interpolating that way is safest.
    near = _find_near(seen, [k, *mates], start)
    relative = positions[near, marker] - positions[near][:, others].mean(axis=1)
    beside = positions[around][:, others]
    frames = np.arange(start - 1, end + 1)
    guess = interpolate_cubic(near, relative, frames) + beside.mean(axis=1)
    points = np.concatenate((beside, guess[:, None]), axis=1)
    weights = np.append(np.ones(len(mates)), _GUESS_WEIGHT if len(mates) == 2 else 0.0)
    places = place_shape(shape[[*mates, k]], points, weights)[:, -1]
    share = np.linspace(0.0, 1.0, len(frames))[:, None]
    left = positions[start - 1, marker] - places[0]
    right = positions[end, marker] - places[-1]
    positions[start:end, marker] = (places + (1.0 - share) * left + share * right)[1:-1]
    filled[start:end, k] = True


def _find_near(seen: BoolArray, columns: list[int], start: int) -> npt.NDArray[np.int64]:
    """Return the frames next to a gap that show some markers: a few before its start and after."""
    reach = 8 * _N_KNOTS
    while True:
        first, last = max(0, start - reach), min(len(seen), start + reach)
        known = first + np.flatnonzero(seen[first:last][:, columns].all(axis=1))
        before = int(np.searchsorted(known, start))
        low = max(0, before - _N_KNOTS)
        near = known[low : low + 2 * _N_KNOTS]
        enough_before = before >= _N_KNOTS or first == 0
        if enough_before and (len(near) == 2 * _N_KNOTS or last == len(seen)):
            return near
        reach *= 4


def _thin_out(values: npt.NDArray[Any], n_most: int) -> npt.NDArray[Any]:
    """Take every so many, at most n_most."""
    return values[:: -(-len(values) // n_most)]


def learn_shape(positions: FloatArray, n_most: int = _SHAPE_FRAMES) -> FloatArray:
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
    positions = _thin_out(positions, n_most)
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
