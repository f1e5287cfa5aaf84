"""Marker paths made ready for segmentation: resampled, scaled, with their speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# Steps below this share of the largest coordinate are rounding, not movement.
_ROUNDING = 1e-12


class Signals(NamedTuple):
    """What a segmentation looks at.

    Attributes
    ----------
    positions : array, shape (T, 3 * m)
        Paths of m markers, zero mean, first differences of unit mean square for each marker.
    speeds : array, shape (T, m)
        Absolute speeds, first differences of unit mean square.
    moves : bool
        False if no marker moves; then all values are zero.
    """

    positions: FloatArray
    speeds: FloatArray
    moves: bool


def resample(
    time: npt.ArrayLike, values: npt.ArrayLike, rate_hz: float, first_s: float = 0.0
) -> FloatArray:
    """Sample values at a lower rate; every new sample is the mean over its period.

    The mean keeps movement faster than the new rate from folding into slower movement.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds, rising in equal steps.
    values : array, shape (T, ...)
        Values to be sampled.
    rate_hz : float
        New samples per second, at most the old rate.
    first_s : float
        Where the first new sample is, seconds after time[0].

    Returns
    -------
    array, shape (R, ...)
        Values at time[0] + first_s + k / rate_hz, as far as the data reach.
    """
    t = np.asarray(time, dtype=np.float64)
    x = np.asarray(values, dtype=np.float64)
    step = (t[-1] - t[0]) / (len(t) - 1)
    n_new = int(np.floor((t[-1] - t[0] - first_s) * rate_hz + 1e-6)) + 1
    centres = t[0] + first_s + np.arange(n_new) / rate_hz
    half = max(1 / rate_hz, step) / 2
    edges = t[0] + (np.arange(len(t) + 1) - 0.5) * step
    flat = x.reshape(len(t), -1)
    low, high = (np.clip(centres + side, edges[0], edges[-1]) for side in (-half, half))
    means = np.empty((n_new, flat.shape[1]))
    integral = np.zeros(len(t) + 1)
    # A column at a time: of an hour at 500 Hz each copy of a marker has 43 MB.
    for column in range(flat.shape[1]):
        # The mean is taken about the first sample: sums of large offsets would round.
        np.cumsum(flat[:, column] - flat[0, column], out=integral[1:])
        means[:, column] = np.interp(high, edges, integral) - np.interp(low, edges, integral)
    means = means * step / (high - low)[:, np.newaxis] + flat[0]
    resampled: FloatArray = means.reshape(n_new, *x.shape[1:])
    return resampled


class Scaling(NamedTuple):
    """How paths are brought to zero mean and unit steps.

    Attributes
    ----------
    centre : array, shape (m, 3)
        Taken off the positions, metres.
    step : array, shape (m,)
        Unit of the positions of each marker, metres; infinite if it does not move.
    change : array, shape (m,)
        Unit of its speed, metres per sample; infinite if it does not move.
    """

    centre: FloatArray
    step: FloatArray
    change: FloatArray


def measure_scaling(paths: npt.ArrayLike) -> Scaling:
    """Measure the scaling of paths, shape (T, m, 3), T at least 2; see `prepare_signals`."""
    x = np.asarray(paths, dtype=np.float64)
    size = np.abs(x).max()
    centre = x.mean(axis=0)
    x = x - centre
    speeds = np.linalg.norm(np.gradient(x, axis=0), axis=2)
    steps = np.sqrt(np.mean(np.diff(x, axis=0) ** 2, axis=(0, 2)))
    moving = steps > _ROUNDING * size
    changes = np.sqrt(np.mean(np.diff(speeds, axis=0) ** 2, axis=0))
    # A marker at constant speed has no changes to scale by.
    changes = np.where(changes > _ROUNDING * size, changes, speeds.max(axis=0))
    return Scaling(centre, np.where(moving, steps, np.inf), np.where(moving, changes, np.inf))


def pool_scalings(scalings: Sequence[Scaling]) -> Scaling:
    """Return one scaling for what is like several recordings: the root mean square of their units.

    Parameters
    ----------
    scalings : sequence of Scaling
        Of the same m markers; at least one.

    Returns
    -------
    Scaling
        A marker counts where it moved; one that never did stays infinite.
    """
    centre = np.mean([one.centre for one in scalings], axis=0)
    units = []
    for name in ("step", "change"):
        squares = np.square([getattr(one, name) for one in scalings])
        moved = np.isfinite(squares)
        mean = np.where(moved, squares, 0.0).sum(axis=0) / np.maximum(moved.sum(axis=0), 1)
        units.append(np.where(moved.any(axis=0), np.sqrt(mean), np.inf))
    return Scaling(centre, units[0], units[1])


def prepare_signals(paths: npt.ArrayLike) -> Signals:
    """Scale paths to zero mean and unit steps and derive their speeds.

    One scale for the three axes of a marker, so that neither the unit nor a turn of the laboratory
    matters (scaling each axis by itself, as the thesis does, would depend on the axes). Speed is
    taken by central differences: the backward difference has no first value.

    Parameters
    ----------
    paths : array, shape (T, m, 3)
        Positions of m markers in equal time steps, T at least 2.

    Returns
    -------
    Signals
        Scaled positions and speeds.

    References
    ----------
    Thesis 4.4.1 (scaling of the data) and 4.4.2 (prior from the first differences).
    """
    x = np.asarray(paths, dtype=np.float64)
    scaling = measure_scaling(x)
    x = x - scaling.centre
    speeds = np.linalg.norm(np.gradient(x, axis=0), axis=2) / scaling.change
    positions = x / scaling.step[:, np.newaxis]
    moves = bool(np.isfinite(scaling.step).any())
    return Signals(positions.reshape(len(x), -1), speeds, moves)
