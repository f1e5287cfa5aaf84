"""The convex program: the smallest change of a joint trajectory that keeps the arm's limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csc_array

from besman.exceptions import MappingError
from besman.robot.parts import JointLimits
from besman.stages.map.joint_spline import DEGREE, JointSpline

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# A longer movement is left as it is: a solve takes time in proportion to the number of points.
GREATEST_POINTS = 256
# Shares of a torque limit that are left, and rounding.
_NEAR = 0.5
_BROKEN = 1e-9
# Numbers of the states that a solver ends in with an answer, exact or not: what comes of it is
# checked.
_ANSWERED = ("Solved", "AlmostSolved", "MaxIterations", "InsufficientProgress")


@dataclass(frozen=True, eq=False)
class ChangeMetric:
    """A quadratic measure of the change of control points, x' H x / 2 + g' x.

    Attributes
    ----------
    bands : array, shape (6, C, n, n)
        Blocks of H: ``bands[d, c]`` couples control point c with c + d; no others are coupled.
    gradient : array, shape (C, n)
        g.
    """

    bands: FloatArray
    gradient: FloatArray


@dataclass(frozen=True, eq=False)
class TorqueRows:
    """Joint torques as shares of their limits, linear in the change x of the control points.

    Attributes
    ----------
    slopes : array, shape (C, n, 11, n)
        ``slopes[k, j, d, m]``: share of joint j at the k-th time, per rad of joint m's control
        point k + d - 5, the ones that count there; 0 if there is no such point.
    shares : array, shape (C, n)
        Now.
    """

    slopes: FloatArray
    shares: FloatArray


def solve_change(
    spline: JointSpline,
    metric: ChangeMetric,
    limits: JointLimits,
    stretch: float,
    torques: TorqueRows | None = None,
) -> FloatArray:
    """Find the smallest change that keeps the limits if time is stretched.

    ::

        minimize    x' H x / 2 + g' x
        subject to  the control points of position, velocity and acceleration within bounds,
                    and, if given, linearised torques at as many times as control points

    over the change x of the control points, by an interior-point solver for quadratic programs
    [1]_, in one thread: the arithmetic does not depend on the machine's number of cores.

    Parameters
    ----------
    spline : JointSpline
    metric : ChangeMetric
        Of the change.
    limits : JointLimits
    stretch : float
        Duration over the spline's own.
    torques : TorqueRows, optional
        At that stretch.

    Returns
    -------
    array, shape (C, n)
        Change of the control points, rad.

    Raises
    ------
    MappingError
        If the spline has more control points than the greatest program, or the solver finds no
        solution.

    References
    ----------
    .. [1] P. J. Goulart, Y. Chen: Clarabel: an interior-point solver for conic programs with
       quadratic objectives, 2024. doi:10.48550/arXiv.2405.12762
    """
    count, n = spline.points.shape
    if count > GREATEST_POINTS:
        raise MappingError(
            f"the smallest change within limits: got {count} control points, "
            f"expected at most {GREATEST_POINTS}"
        )
    matrix, high = _limit_rows(spline, limits, stretch)
    n_limits = len(high)
    if torques is not None:
        from scipy.sparse import vstack

        slopes, shares = _torque_matrix(torques), torques.shares.ravel()
        matrix = csc_array(vstack([matrix, slopes, -slopes], format="csc"))
        high = np.concatenate([high, 1.0 - shares, 1.0 + shares])
    # Rows of torques are many and full, and most are far away: these are left out, and come in if
    # the answer breaks them.
    chosen = np.ones(len(high), dtype=np.bool_)
    chosen[n_limits:] = high[n_limits:] < _NEAR
    while True:
        some = matrix if chosen.all() else csc_array(matrix.tocsr()[chosen].tocsc())
        change = _solve(metric, some, high[chosen])
        broken = ~chosen & (matrix @ change > high + _BROKEN)
        if not broken.any():
            return change.reshape(count, n)
        chosen = chosen | broken


def _solve(metric: ChangeMetric, matrix: csc_array, high: FloatArray) -> FloatArray:
    """Minimise x' H x / 2 + g' x with A x <= b; return x."""
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.direct_solve_method = "qdldl"
    settings.max_threads = 1
    settings.presolve_enable = False
    solver = clarabel.DefaultSolver(
        _hessian(metric), metric.gradient.ravel(), matrix, high,
        [clarabel.NonnegativeConeT(len(high))], settings,
    )  # fmt: skip
    solution = solver.solve()
    status, value = str(solution.status), np.array(solution.x)
    if status not in _ANSWERED or not np.isfinite(value).all():
        raise MappingError(f"the smallest change within limits: solver says {status}")
    return value


def _hessian(metric: ChangeMetric) -> csc_array:
    """Return the upper triangle of H."""
    count, n = metric.gradient.shape
    shift, point, row, column = _hessian_places(count, n)
    values = metric.bands[shift, point, row, column]
    places = point * n + row, (point + shift) * n + column
    return coo_array((values, places), shape=(count * n, count * n)).tocsc()


@lru_cache(maxsize=64)
def _hessian_places(count: int, n: int) -> tuple[IntArray, ...]:
    """Return the indices of the bands' elements that lie in the upper triangle."""
    shift, point, row, column = np.indices((DEGREE + 1, count, n, n)).reshape(4, -1)
    inside = (point + shift < count) & ((shift > 0) | (row <= column))
    return shift[inside], point[inside], row[inside], column[inside]


def _limit_rows(
    spline: JointSpline, limits: JointLimits, stretch: float
) -> tuple[csc_array, FloatArray]:
    """Return A and b of A x <= b for the limits of all control points, both ways."""
    first, second = spline.first_factors, spline.second_factors
    count, n = spline.points.shape
    # In units of the mean factor, so that all rows are of one size.
    mean = float(np.mean(first))
    weights = first / mean
    steps = np.diff(spline.points, axis=0)
    bends = np.diff(weights[:, None] * steps, axis=0)
    reach = np.outer(stretch / first, limits.velocity)
    pull = np.outer(stretch**2 / (mean * second), limits.acceleration)
    room = (
        (limits.position_max - spline.points, spline.points - limits.position_min),
        (reach - steps, reach + steps),
        (pull - bends, pull + bends),
    )
    high = np.concatenate([side[way].ravel() for way in range(2) for side in room])
    ones, before, after = np.ones(count), weights[:-1], weights[1:]
    values = np.concatenate([ones, -ones[1:], ones[1:], before, -before - after, after])
    order, indices, starts = _limit_places(count, n)
    both = np.concatenate([np.repeat(values, n), -np.repeat(values, n)])
    return csc_array((both[order], indices, starts), shape=(len(high), count * n)), high


@lru_cache(maxsize=64)
def _limit_places(count: int, n: int) -> tuple[IntArray, IntArray, IntArray]:
    """Return the order of the values of `_limit_rows` in a matrix by columns, and its places."""
    points = [np.arange(count - order) for order in (0, 1, 1, 2, 2, 2)]
    row_starts = np.repeat([0, count, 2 * count - 1], (1, 2, 3))
    ahead = (0, 0, 1, 0, 1, 2)
    joint = np.arange(n)
    rows = np.concatenate(
        [((start + at)[:, None] * n + joint).ravel()
         for start, at in zip(row_starts, points, strict=True)]
    )  # fmt: skip
    columns = np.concatenate(
        [((at + shift)[:, None] * n + joint).ravel()
         for shift, at in zip(ahead, points, strict=True)]
    )  # fmt: skip
    half = (3 * count - 3) * n
    rows, columns = np.concatenate([rows, half + rows]), np.tile(columns, 2)
    order = np.lexsort((rows, columns))
    starts = np.searchsorted(columns[order], np.arange(count * n + 1))
    return order, rows[order], starts


def _torque_matrix(torques: TorqueRows) -> csc_array:
    """Return the torques' slopes as a matrix of all joints' control points."""
    count, n = torques.shares.shape
    time, joint, near, other = np.indices(torques.slopes.shape)
    point = time + near - DEGREE
    inside = (point >= 0) & (point < count)
    places = (time * n + joint)[inside], (point * n + other)[inside]
    return coo_array((torques.slopes[inside], places), shape=(count * n, count * n)).tocsc()
