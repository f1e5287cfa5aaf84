"""Cubic splines through many segments at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.geometry.cubic_spline import solve_tridiagonal

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Of more samples than this, to load SciPy's compiled solver takes less time than to do without.
_MANY = 10_000


def resample_segments(
    time: FloatArray, values: FloatArray, bounds: IntArray, n_points: int
) -> tuple[FloatArray, FloatArray]:
    """Interpolate segments to the same number of points by cubic splines (not-a-knot).

    Each segment has a spline of its own. One spline per segment would take a call each; here the
    slopes of all are the solution of one banded system whose blocks do not touch.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds, strictly rising.
    values : array, shape (T, K)
        Finite inside the segments.
    bounds : int array, shape (S, 2)
        Half-open rows of segments of at least two samples; they may overlap.
    n_points : int
        Points per segment, first and last at its first and last sample.

    Returns
    -------
    points : array, shape (S, n_points, K)
    step_s : array, shape (S,)
        Time between two points, seconds.
    """
    if len(bounds) == 0:
        return np.empty((0, n_points, values.shape[1])), np.empty(0)
    lengths = np.diff(bounds, axis=1)[:, 0]
    first = np.concatenate([[0], np.cumsum(lengths)])[:-1]
    last = first + lengths - 1
    rows = np.arange(lengths.sum()) + np.repeat(bounds[:, 0] - first, lengths)
    duration = time[bounds[:, 1] - 1] - time[bounds[:, 0]]
    # One time axis for all, on which the segments follow each other.
    begin = np.concatenate([[0.0], np.cumsum(duration + 1.0)])[:-1]
    axis = time[rows] + np.repeat(begin - time[bounds[:, 0]], lengths)
    knots = values[rows]
    step = np.diff(axis)
    rise = np.diff(knots, axis=0) / step[:, np.newaxis]
    slopes = _slopes(step, rise, first, last)
    places = begin[:, np.newaxis] + duration[:, np.newaxis] * np.linspace(0.0, 1.0, n_points)
    left = np.searchsorted(axis, places, side="right") - 1
    left = np.clip(left, first[:, np.newaxis], last[:, np.newaxis] - 1)
    h = step[left][..., np.newaxis]
    u = (places - axis[left])[..., np.newaxis] / h
    bend_in = slopes[left] - rise[left]
    bend_out = slopes[left + 1] - rise[left]
    linear = knots[left] + u * h * rise[left]
    points = linear + h * u * (1 - u) * ((1 - u) * bend_in - u * bend_out)
    return points, duration / (n_points - 1)


def _slopes(step: FloatArray, rise: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """Solve for the derivatives at all samples; the equations of each spline are separate."""
    n = len(step) + 1
    below, diagonal, above = np.zeros(n), np.ones(n), np.zeros(n)
    right = np.zeros((n, rise.shape[1]))
    inner = np.setdiff1d(np.arange(n), np.concatenate([first, last]), assume_unique=True)
    before, after = step[inner - 1], step[inner]
    below[inner], diagonal[inner], above[inner] = after, 2 * (before + after), before
    right[inner] = 3 * (
        after[:, np.newaxis] * rise[inner - 1] + before[:, np.newaxis] * rise[inner]
    )
    two, three = last - first == 1, last - first == 2
    for ends, inwards, beyond, band in ((first, 0, 1, above), (last, -1, -2, below)):
        # A line through two samples, a parabola through three, else no knot at the second sample.
        right[ends[two]] = rise[first[two]]
        band[ends[three]] = 1.0
        right[ends[three]] = 2 * rise[ends[three] + inwards]
        long = ends[~(two | three)]
        a, b = step[long + inwards], step[long + beyond]
        diagonal[long], band[long] = b, a + b
        right[long] = ((a + 2 * (a + b)) * b / (a + b))[:, np.newaxis] * rise[long + inwards] + (
            a**2 / (a + b)
        )[:, np.newaxis] * rise[long + beyond]
    if n <= _MANY:
        return solve_tridiagonal(below[1:], diagonal, above[:-1], right)
    from scipy.linalg import solve_banded

    bands = np.stack([np.roll(above, 1), diagonal, np.roll(below, -1)])
    return np.asarray(solve_banded((1, 1), bands, right))
