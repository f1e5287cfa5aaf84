"""The cubic spline through points, without SciPy's, which takes longer to load than to use."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
# Points may be counted.
Numbers = FloatArray | npt.NDArray[np.intp]

# Of more points than this, to load SciPy's compiled solver takes less time than to do without.
_MANY = 50_000


def interpolate_cubic(x: Numbers, y: FloatArray, at: Numbers) -> FloatArray:
    """Evaluate the cubic spline through points; its first two and last two pieces are one cubic.

    The values are those of ``scipy.interpolate.CubicSpline``.

    Parameters
    ----------
    x : array, shape (N,)
        Rising; N at least 2. Two points give a line, three a parabola.
    y : array, shape (N, K)
    at : array, shape (A,)
        Where to evaluate it; beyond the points the outer cubics go on.

    Returns
    -------
    array, shape (A, K)
    """
    x, at = np.asarray(x, dtype=np.float64), np.asarray(at, dtype=np.float64)
    if len(x) > _MANY:
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(x, y)(at))
    dx = np.diff(x)[:, np.newaxis]
    secants = np.diff(y, axis=0) / dx
    slopes = _find_slopes(dx, secants)
    bend = (slopes[:-1] + slopes[1:] - 2.0 * secants) / dx
    piece = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    s = (at - x[piece])[:, np.newaxis]
    square = (secants - slopes[:-1]) / dx - bend
    values: FloatArray = y[piece] + slopes[piece] * s
    values += square[piece] * (s * s)
    values += (bend / dx)[piece] * (s * s * s)
    return values


def _find_slopes(dx: FloatArray, secants: FloatArray) -> FloatArray:
    """Return the slopes (N, K) at the points that make the second derivative continuous."""
    if len(dx) == 1:
        return np.concatenate([secants, secants])
    first, last = dx[0] + dx[1], dx[-2] + dx[-1]
    if len(dx) == 2:
        middle = (dx[1] * secants[:1] + dx[0] * secants[1:]) / first
        return np.concatenate([2.0 * secants[:1] - middle, middle, 2.0 * secants[1:] - middle])
    start = ((dx[0] + 2.0 * first) * dx[1] * secants[0] + dx[0] ** 2 * secants[1]) / first
    end = (dx[-1] ** 2 * secants[-2] + (2.0 * last + dx[-1]) * dx[-2] * secants[-1]) / last
    inner = 3.0 * (dx[1:] * secants[:-1] + dx[:-1] * secants[1:])
    return solve_tridiagonal(
        np.concatenate([dx[1:, 0], last]),
        np.concatenate([dx[1], 2.0 * (dx[:-1, 0] + dx[1:, 0]), dx[-2]]),
        np.concatenate([first, dx[:-1, 0]]),
        np.concatenate([[start], inner, [end]]),
    )


def solve_tridiagonal(
    before: FloatArray, diagonal: FloatArray, after: FloatArray, right: FloatArray
) -> FloatArray:
    """Solve a tridiagonal system by elimination; of two rows the greater is eliminated with.

    Parameters
    ----------
    before, after : array, shape (N - 1,)
        Left of the diagonal, from the second row on, and right of it.
    diagonal : array, shape (N,)
    right : array, shape (N, K)
        Right sides.

    Returns
    -------
    array, shape (N, K)
    """
    # Lists: a loop over the elements of arrays takes five times as long.
    below, own = before.tolist(), diagonal.tolist()
    next_one, columns = [*after.tolist(), 0.0], right.T.tolist()
    next_but_one = [0.0] * len(own)
    for i, low in enumerate(below):
        if abs(own[i]) >= abs(low):
            factor = low / own[i]
            own[i + 1] -= factor * next_one[i]
            for column in columns:
                column[i + 1] -= factor * column[i]
            continue
        factor = own[i] / low
        own[i], next_one[i], own[i + 1] = low, own[i + 1], next_one[i] - factor * own[i + 1]
        next_but_one[i], next_one[i + 1] = next_one[i + 1], -factor * next_one[i + 1]
        for column in columns:
            column[i], column[i + 1] = column[i + 1], column[i] - factor * column[i + 1]
    for column in columns:
        column[-1] /= own[-1]
        column[-2] = (column[-2] - next_one[-2] * column[-1]) / own[-2]
        for i in range(len(own) - 3, -1, -1):
            known = next_one[i] * column[i + 1]
            column[i] = (column[i] - known - next_but_one[i] * column[i + 2]) / own[i]
    return np.array(columns).T
