"""Convex quadratic programs whose matrices are bands: an interior-point method, compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.robot.kinematics import compiled

FloatArray = npt.NDArray[np.float64]

_GREATEST_ROUNDS = 60
# Of the gap between cost and its bound, and of what the rows still miss, over their size.
_GAP, _MISSED = 1e-8, 1e-8
# So far to the wall a step goes.
_NEAR_WALL = 0.99


@compiled
def factor_columns(band: FloatArray) -> None:
    """Factor a symmetric positive definite band in place, L L'.

    Parameters
    ----------
    band : array, shape (N, w + 1)
        Row j holds column j of the lower triangle: entries (j, j), (j + 1, j) ... (j + w, j). A
        pivot that rounding has made negative is held far up, so that its unknown stays.
    """
    size, width = band.shape
    for j in range(size):
        pivot = band[j, 0]
        root = np.sqrt(pivot) if pivot > 0.0 else 1e64
        band[j, 0] = root
        last = min(width, size - j)
        for k in range(1, last):
            band[j, k] /= root
        for k in range(1, last):
            share = band[j, k]
            if share != 0.0:
                for m in range(k, last):
                    band[j + k, m - k] -= share * band[j, m]


@compiled
def solve_columns(band: FloatArray, vector: FloatArray) -> None:
    """Solve L L' x = b in place with the factor of `factor_columns`."""
    size, width = band.shape
    for j in range(size):
        vector[j] /= band[j, 0]
        for k in range(1, min(width, size - j)):
            vector[j + k] -= band[j, k] * vector[j]
    for j in range(size - 1, -1, -1):
        total = vector[j]
        for k in range(1, min(width, size - j)):
            total -= band[j, k] * vector[j + k]
        vector[j] = total / band[j, 0]


@compiled
def _fill_forms(
    x: FloatArray, n: int, weights: FloatArray, rows: FloatArray, out: FloatArray
) -> None:
    """Write what is limited: points, their steps, the steps' weighted differences, further rows."""
    size, at = len(x), 0
    for i in range(size):
        out[i] = x[i]
    at = size
    for i in range(size - n):
        out[at + i] = x[i + n] - x[i]
    at += size - n
    for i in range(size - 2 * n):
        before, after = weights[i // n], weights[i // n + 1]
        out[at + i] = before * (x[i] - x[i + n]) + after * (x[i + 2 * n] - x[i + n])
    at += max(0, size - 2 * n)
    half = rows.shape[1] // n // 2
    for i in range(len(rows)):
        first, total = (i // n - half) * n, 0.0
        for k in range(max(0, -first), min(rows.shape[1], size - first)):
            total += rows[i, k] * x[first + k]
        out[at + i] = total


@compiled
def _add_back(
    y: FloatArray, n: int, weights: FloatArray, rows: FloatArray, out: FloatArray
) -> None:
    """Add the transpose of `_fill_forms` times y to `out`."""
    size = len(out)
    for i in range(size):
        out[i] += y[i]
    at = size
    for i in range(size - n):
        out[i + n] += y[at + i]
        out[i] -= y[at + i]
    at += size - n
    for i in range(size - 2 * n):
        before, after = weights[i // n] * y[at + i], weights[i // n + 1] * y[at + i]
        out[i] += before
        out[i + n] -= before + after
        out[i + 2 * n] += after
    at += max(0, size - 2 * n)
    half = rows.shape[1] // n // 2
    for i in range(len(rows)):
        first, scale = (i // n - half) * n, y[at + i]
        for k in range(max(0, -first), min(rows.shape[1], size - first)):
            out[first + k] += rows[i, k] * scale


@compiled
def _add_squares(
    d: FloatArray, n: int, weights: FloatArray, rows: FloatArray, band: FloatArray
) -> None:
    """Add F' diag(d) F to a band, with the rows F of `_fill_forms`."""
    size = len(band)
    for i in range(size):
        band[i, 0] += d[i]
    at = size
    for i in range(size - n):
        band[i, 0] += d[at + i]
        band[i + n, 0] += d[at + i]
        band[i, n] -= d[at + i]
    at += size - n
    for i in range(size - 2 * n):
        a, c, scale = weights[i // n], weights[i // n + 1], d[at + i]
        b = -a - c
        band[i, 0] += a * a * scale
        band[i, n] += a * b * scale
        band[i, 2 * n] += a * c * scale
        band[i + n, 0] += b * b * scale
        band[i + n, n] += b * c * scale
        band[i + 2 * n, 0] += c * c * scale
    at += max(0, size - 2 * n)
    half = rows.shape[1] // n // 2
    for i in range(len(rows)):
        first = (i // n - half) * n
        last = min(rows.shape[1], size - first)
        for k in range(max(0, -first), last):
            scale = d[at + i] * rows[i, k]
            if scale != 0.0:
                for m in range(k, last):
                    band[first + k, m - k] += scale * rows[i, m]


@compiled
def _add_product(band: FloatArray, x: FloatArray, out: FloatArray) -> None:
    """Add the symmetric band times x to `out`."""
    size, width = band.shape
    for j in range(size):
        total = band[j, 0] * x[j]
        for k in range(1, min(width, size - j)):
            total += band[j, k] * x[j + k]
            out[j + k] += band[j, k] * x[j]
        out[j] += total


@compiled
def _fill_step(
    factor: FloatArray, n: int, weights: FloatArray, rows: FloatArray, downhill: FloatArray,
    missed: FloatArray, slack: FloatArray, price: FloatArray, product: FloatArray,
    dx: FloatArray, d_slack: FloatArray, d_price: FloatArray,
) -> None:  # fmt: skip
    """Write Newton's step for the given right sides."""
    pull = np.empty(slack.shape[1])
    for r in range(len(pull)):
        pull[r] = 0.0
        for side in range(2):
            sign = 1.0 - 2.0 * side
            pull[r] -= sign * (price[side, r] * missed[side, r] - product[side, r]) / slack[side, r]
    for i in range(len(dx)):
        dx[i] = -downhill[i]
    _add_back(pull, n, weights, rows, dx)
    solve_columns(factor, dx)
    _fill_forms(dx, n, weights, rows, pull)
    for r in range(len(pull)):
        for side in range(2):
            move = (1.0 - 2.0 * side) * pull[r]
            d_slack[side, r] = -missed[side, r] - move
            d_price[side, r] = (-product[side, r] - price[side, r] * d_slack[side, r]) / slack[
                side, r
            ]


@compiled
def _way_to_wall(now: FloatArray, step: FloatArray) -> float:
    """Return the share of a step at which the first entry is zero; at most 1."""
    share = 1.0
    for side in range(2):
        for r in range(now.shape[1]):
            if step[side, r] < 0.0:
                share = min(share, -now[side, r] / step[side, r])
    return share


@compiled
def _lift(values: FloatArray) -> None:
    """Move all entries up so that the least is as great as they are on average."""
    least, mean = np.inf, 0.0
    for side in range(2):
        for r in range(values.shape[1]):
            least = min(least, values[side, r])
            mean += abs(values[side, r]) / values.size
    if least <= 0.0:
        for side in range(2):
            for r in range(values.shape[1]):
                values[side, r] += max(mean, 1e-9) - least


@compiled
def _fill_start(
    band: FloatArray, gradient: FloatArray, n: int, weights: FloatArray, rows: FloatArray,
    room: FloatArray, x: FloatArray, slack: FloatArray, price: FloatArray,
) -> None:  # fmt: skip
    """Start where the squares of what is broken cost as much as the change."""
    n_rows = room.shape[1]
    factor, forms = band.copy(), np.ones(n_rows)
    _add_squares(forms, n, weights, rows, factor)
    factor_columns(factor)
    for r in range(n_rows):
        forms[r] = room[0, r] - room[1, r]
    for i in range(len(x)):
        x[i] = -gradient[i]
    _add_back(forms, n, weights, rows, x)
    solve_columns(factor, x)
    _fill_forms(x, n, weights, rows, forms)
    for r in range(n_rows):
        for side in range(2):
            slack[side, r] = room[side, r] - (1.0 - 2.0 * side) * forms[r]
            price[side, r] = -slack[side, r]
    _lift(slack)
    _lift(price)


@compiled
def _fill_missed(
    band: FloatArray, gradient: FloatArray, n: int, weights: FloatArray, rows: FloatArray,
    room: FloatArray, x: FloatArray, slack: FloatArray, price: FloatArray,
    downhill: FloatArray, missed: FloatArray, product: FloatArray,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Write by how much the conditions of an answer are missed.

    Returns the gap and the slope left, as shares of cost and slopes, the greatest row missed, and
    the gap itself.
    """
    forms = np.empty(room.shape[1])
    _fill_forms(x, n, weights, rows, forms)
    gap = worst = steep = cost = 0.0
    for i in range(len(x)):
        downhill[i] = 0.0
    _add_product(band, x, downhill)
    scale = 1e-9
    for i in range(len(x)):
        cost += x[i] * (0.5 * downhill[i] + gradient[i])
        downhill[i] += gradient[i]
        scale = max(scale, abs(gradient[i]), abs(downhill[i]))
    for r in range(len(forms)):
        for side in range(2):
            missed[side, r] = (1.0 - 2.0 * side) * forms[r] + slack[side, r] - room[side, r]
            worst = max(worst, abs(missed[side, r]))
            product[side, r] = slack[side, r] * price[side, r]
            gap += product[side, r]
        forms[r] = price[0, r] - price[1, r]
    _add_back(forms, n, weights, rows, downhill)
    for i in range(len(x)):
        steep = max(steep, abs(downhill[i]))
    return gap / (1.0 + abs(cost)), steep / scale, worst, gap


@compiled
def _correct_product(
    gap: float, slack: FloatArray, price: FloatArray, d_slack: FloatArray, d_price: FloatArray,
    product: FloatArray,
) -> None:  # fmt: skip
    """Aim less far after a step that would have gone to the end, and correct for its curve."""
    share = min(_way_to_wall(slack, d_slack), _way_to_wall(price, d_price))
    left = 0.0
    for side in range(2):
        for r in range(slack.shape[1]):
            left += (slack[side, r] + share * d_slack[side, r]) * (
                price[side, r] + share * d_price[side, r]
            )
    centre = (left / gap) ** 3 * gap / slack.size
    for side in range(2):
        for r in range(slack.shape[1]):
            product[side, r] += d_slack[side, r] * d_price[side, r] - centre


@compiled
def _fill_factor(
    band: FloatArray, n: int, weights: FloatArray, rows: FloatArray, slack: FloatArray,
    price: FloatArray, factor: FloatArray,
) -> None:  # fmt: skip
    """Factor the matrix of Newton's step."""
    stiff = np.empty(slack.shape[1])
    for r in range(len(stiff)):
        stiff[r] = price[0, r] / slack[0, r] + price[1, r] / slack[1, r]
    for i in range(band.shape[0]):
        for k in range(band.shape[1]):
            factor[i, k] = band[i, k]
    _add_squares(stiff, n, weights, rows, factor)
    factor_columns(factor)


@compiled
def solve_band_program(
    band: FloatArray,
    gradient: FloatArray,
    n: int,
    weights: FloatArray,
    rows: FloatArray,
    room: FloatArray,
    x: FloatArray,
) -> tuple[float, int]:
    """Minimise x' H x / 2 + g' x with -room[1] <= F x <= room[0].

    Mehrotra's predictor and corrector [1]_. F are the values of C points of n joints, their steps
    from point to point, the differences of these steps by their weights, and further rows of
    neighbouring points; so every matrix that is solved is a band.

    Parameters
    ----------
    band : array, shape (C n, w + 1)
        H, as in `factor_columns`; wide enough for F' F.
    gradient : array, shape (C n,)
    n : int
    weights : array, shape (C - 1,)
        Of the steps.
    rows : array, shape (R, k n)
        Further rows, n for every point and k odd: row i counts from joint 0 of the point
        i // n - k // 2 on.
    room : array, shape (2, (3 C - 3) n + R)
        Above and below.
    x : array, shape (C n,)
        Written.

    Returns
    -------
    missed : float
        By how much x breaks its room at most.
    rounds : int

    References
    ----------
    .. [1] S. Mehrotra: On the implementation of a primal-dual interior point method, 1992.
       doi:10.1137/0802028
    """
    size, n_rows = len(x), room.shape[1]
    slack, price, missed = np.empty((2, n_rows)), np.empty((2, n_rows)), np.empty((2, n_rows))
    product, d_slack = np.empty((2, n_rows)), np.empty((2, n_rows))
    d_price, downhill, dx = np.empty((2, n_rows)), np.empty(size), np.empty(size)
    factor = np.empty_like(band)
    _fill_start(band, gradient, n, weights, rows, room, x, slack, price)
    worst = np.inf
    for count in range(_GREATEST_ROUNDS):
        open_share, steep, worst, gap = _fill_missed(
            band, gradient, n, weights, rows, room, x, slack, price, downhill, missed, product
        )
        if open_share <= _GAP and steep <= _GAP and worst <= _MISSED:
            return worst, count
        _fill_factor(band, n, weights, rows, slack, price, factor)
        _fill_step(factor, n, weights, rows, downhill, missed, slack, price, product,
                   dx, d_slack, d_price)  # fmt: skip
        _correct_product(gap, slack, price, d_slack, d_price, product)
        _fill_step(factor, n, weights, rows, downhill, missed, slack, price, product,
                   dx, d_slack, d_price)  # fmt: skip
        share = _NEAR_WALL * min(_way_to_wall(slack, d_slack), _way_to_wall(price, d_price))
        for i in range(size):
            x[i] += share * dx[i]
        for side in range(2):
            for r in range(n_rows):
                slack[side, r] += share * d_slack[side, r]
                price[side, r] += share * d_price[side, r]
    return worst, _GREATEST_ROUNDS
