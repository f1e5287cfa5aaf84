"""Gaps in trajectories: where they are, and filling the short ones."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.geometry.cubic_spline import interpolate_cubic

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

# Sightings on each side of a gap that the spline goes through: each one farther away changes it a
# quarter as much, so that beyond these not a bit of a double is left.
_N_KNOTS = 64


def find_seen(positions: FloatArray) -> BoolArray:
    """Tell which samples have all three coordinates.

    Parameters
    ----------
    positions : array, shape (..., 3)

    Returns
    -------
    bool array, shape (...)
    """
    # A reduction over three would take several times as long.
    known = np.isfinite(positions)
    return np.asarray(known[..., 0] & known[..., 1] & known[..., 2])


def find_runs(mask: BoolArray) -> npt.NDArray[np.int64]:
    """Find the stretches where a mask is true.

    Parameters
    ----------
    mask : bool array, shape (T,)

    Returns
    -------
    int array, shape (R, 2)
        Half-open bounds of each stretch.
    """
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return np.flatnonzero(edges).reshape(-1, 2)


def fill_gaps(positions: FloatArray, longest: int) -> tuple[FloatArray, BoolArray]:
    """Fill the gaps of one marker that are not too long.

    A gap between two sightings is filled by the cubic spline through the sightings; a gap at the
    start or the end by holding the nearest sighting. On real recordings the cubic spline was off
    by half as much as a monotone or an Akima one.

    Parameters
    ----------
    positions : array, shape (T, 3)
        Metres; a sample counts as unseen if any coordinate is NaN.
    longest : int
        Greatest number of samples to fill at a stretch.

    Returns
    -------
    positions : array, shape (T, 3)
        With all unseen samples that were not filled wholly NaN.
    filled : bool array, shape (T,)
        Which samples were filled.
    """
    unseen: BoolArray = np.any(np.isnan(positions), axis=1)
    filled = np.zeros(len(positions), dtype=np.bool_)
    result = np.where(unseen[:, np.newaxis], np.nan, positions)
    seen = np.flatnonzero(~unseen)
    if seen.size == 0:
        return result, filled
    runs = find_runs(unseen)
    for start, end in runs[runs[:, 1] - runs[:, 0] <= longest]:
        filled[start:end] = True
        after = int(np.searchsorted(seen, start))
        near = seen[max(0, after - _N_KNOTS) : after + _N_KNOTS]
        # Outside the sightings the spline would run away; there its end values are held.
        within = np.clip(np.arange(start, end), seen[0], seen[-1])
        result[start:end] = (
            interpolate_cubic(near, positions[near], within) if len(near) > 1 else positions[near]
        )
    return result, filled
