"""The convex program: the smallest change of a joint trajectory that keeps the arm's limits."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_array

from besman.exceptions import MappingError
from besman.robot.kinematics import compiled
from besman.robot.parts import JointLimits
from besman.stages.map.joint_spline import DEGREE, JointSpline

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Problems are compiled for these numbers of control points; a spline is padded to the next one.
SIZES = (16, 24, 32, 48, 64, 96, 128, 192, 256)

# Bounds of what is padded, rad: never met.
_FREE = 100.0
# One thread a solve: the arithmetic does not depend on the machine's number of cores.
_OPTIONS = {"direct_solve_method": "qdldl"}
_threads = threading.local()


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


class LimitProgram:
    """One compiled program for a number of control points and joints; solved again and again.

    ::

        minimize    |R x + r|^2
        subject to  the control points of position, velocity and acceleration within bounds,
                    and, if asked for, linearised torques at as many times as control points

    over the change x of the control points. R is the Cholesky factor of the metric; all data are
    parameters, so that cvxpy compiles the program once (disciplined parametrized programming [1]_).

    Parameters
    ----------
    size : int
        Number of control points.
    n : int
        Number of joints.
    torques : bool
        Whether torques are constrained.

    References
    ----------
    .. [1] A. Agrawal, B. Amos, S. Barratt, S. Boyd, S. Diamond, J. Z. Kolter: Differentiable convex
       optimization layers, 2019, section 4.1. doi:10.48550/arXiv.1910.12430
    """

    def __init__(self, size: int, n: int, torques: bool = False) -> None:
        import cvxpy

        self._size, self._n = size, n
        self._change = cvxpy.Variable(size * n)
        self._problem = cvxpy.Problem(
            cvxpy.Minimize(self._state_metric()),
            self._state_limits() + (self._state_torques() if torques else []),
        )

    def _state_metric(self) -> Any:
        """Return the objective; its parameters are the factor's bands and the offset."""
        import cvxpy

        size, n = self._size, self._n
        total, width = size * n, (DEGREE + 1) * n
        rows = np.arange(total)[:, None] + 0 * np.arange(width)
        columns = rows + np.arange(width)
        self._filled = columns < total
        self._factor = cvxpy.Parameter(int(self._filled.sum()))
        self._offset = cvxpy.Parameter(total)
        factor = _fill(self._factor, rows[self._filled], columns[self._filled], total)
        return cvxpy.sum_squares(factor @ self._change + self._offset)

    def _state_limits(self) -> list[Any]:
        """Return the bounds of the control points and of their first and second differences."""
        import cvxpy

        size, n = self._size, self._n
        self._weights = cvxpy.Parameter((size - 1, n))
        self._low = [cvxpy.Parameter((size - order, n)) for order in range(3)]
        self._high = [cvxpy.Parameter((size - order, n)) for order in range(3)]
        points = cvxpy.reshape(self._change, (size, n), order="C")
        steps = points[1:] - points[:-1]
        weighted = cvxpy.multiply(self._weights, steps)
        terms = points, steps, weighted[1:] - weighted[:-1]
        return [term >= low for term, low in zip(terms, self._low, strict=True)] + [
            term <= high for term, high in zip(terms, self._high, strict=True)
        ]

    def _state_torques(self) -> list[Any]:
        """Return the bounds of the torques; their parameters are those of `TorqueRows`."""
        import cvxpy

        size, n = self._size, self._n
        time, joint, near, other = np.indices((size, n, 2 * DEGREE + 1, n))
        point = time + near - DEGREE
        self._torque_filled = (point >= 0) & (point < size)
        self._slopes = cvxpy.Parameter(int(self._torque_filled.sum()))
        self._shares = cvxpy.Parameter(size * n)
        rows, columns = time * n + joint, point * n + other
        chosen = rows[self._torque_filled], columns[self._torque_filled]
        shares = _fill(self._slopes, *chosen, size * n) @ self._change + self._shares
        return [shares >= -1.0, shares <= 1.0]

    def solve(
        self,
        spline: JointSpline,
        metric: ChangeMetric,
        limits: JointLimits,
        stretch: float,
        torques: TorqueRows | None = None,
    ) -> FloatArray:
        """Find the smallest change that keeps the limits if time is stretched.

        Parameters
        ----------
        spline : JointSpline
            With at most as many control points as the program.
        metric : ChangeMetric
            Of the change.
        limits : JointLimits
        stretch : float
            Duration over the spline's own.
        torques : TorqueRows, optional
            At that stretch; for a program that constrains torques.

        Returns
        -------
        array, shape (C, n)
            Change of the control points, rad.

        Raises
        ------
        MappingError
            If the metric is not positive definite or the solver finds no solution.
        """
        import cvxpy

        self._set_metric(metric)
        self._set_bounds(spline, limits, stretch)
        if torques is not None:
            self._set_torques(torques)
        data, chain, inverse = self._problem.get_problem_data(cvxpy.CLARABEL, solver_opts=_OPTIONS)
        solution = chain.invert(chain.solve_via_data(self._problem, data), inverse)
        value = solution.primal_vars.get(self._change.id)
        # A solution that may be inaccurate will do: what comes of it is checked.
        if value is None or not np.isfinite(value).all():
            raise MappingError(f"the smallest change within limits: solver says {solution.status}")
        change: FloatArray = value.reshape(self._size, self._n)[: len(spline.points)]
        return change

    def _set_metric(self, metric: ChangeMetric) -> None:
        """Factorise the metric; what is padded is held at zero."""
        n, count = self._n, len(metric.gradient)
        padded = np.zeros((DEGREE + 1, self._size, n, n))
        padded[:, :count] = metric.bands
        padded[0, count:] = np.eye(n)
        rows = np.zeros((self._size, n, (DEGREE + 1) * n))
        for shift in range(DEGREE + 1):
            for row in range(n):
                # The upper triangle alone, each row from its diagonal on.
                start = shift * n - row
                rows[:, row, max(start, 0) : start + n] = padded[shift, :, row, max(-start, 0) :]
        factor = rows.reshape(-1, rows.shape[2])
        offset = np.zeros(self._size * n)
        offset[: count * n] = metric.gradient.ravel()
        if not _factorise(factor, offset):
            raise MappingError("the smallest change within limits: no positive definite metric")
        self._factor.value = factor[self._filled]
        self._offset.value = offset

    def _set_bounds(self, spline: JointSpline, limits: JointLimits, stretch: float) -> None:
        """Set what is left up to the limits, all in rad."""
        first, second = spline.first_factors, spline.second_factors
        mean = float(np.mean(first))
        weights = np.ones((self._size - 1, self._n))
        weights[: len(first)] = first[:, None] / mean
        self._weights.value = weights
        steps = np.diff(spline.points, axis=0)
        bends = np.diff(weights[: len(first)] * steps, axis=0)
        reach = np.outer(stretch / first, limits.velocity)
        pull = np.outer(stretch**2 / (mean * second), limits.acceleration)
        bounds = (
            (limits.position_min - spline.points, limits.position_max - spline.points),
            (-reach - steps, reach - steps),
            (-pull - bends, pull - bends),
        )
        for low, high, values in zip(self._low, self._high, bounds, strict=True):
            full = np.full(low.shape, -_FREE), np.full(low.shape, _FREE)
            for whole, part in zip(full, values, strict=True):
                whole[: len(part)] = part
            low.value, high.value = full

    def _set_torques(self, torques: TorqueRows) -> None:
        """Set the torques' slopes and shares; what is padded has none."""
        count = len(torques.shares)
        slopes = np.zeros((self._size, *torques.slopes.shape[1:]))
        slopes[:count] = torques.slopes
        shares = np.zeros((self._size, self._n))
        shares[:count] = torques.shares
        self._slopes.value = slopes[self._torque_filled]
        self._shares.value = shares.ravel()


def _fill(values: Any, rows: IntArray, columns: IntArray, total: int) -> Any:
    """Return a square expression with a parameter's values at some places, 0 elsewhere."""
    import cvxpy

    count = len(rows)
    spread = csc_array(
        (np.ones(count), (rows + total * columns, np.arange(count))), shape=(total**2, count)
    )
    return cvxpy.reshape(spread @ values, (total, total), order="F")


def get_program(spline: JointSpline, torques: bool = False) -> LimitProgram:
    """Return this thread's compiled program for a spline.

    Programs are kept: compiling one takes many times as long as solving it. cvxpy's problems are
    not safe between threads, so every thread has its own.

    Raises
    ------
    MappingError
        If the spline has more control points than the largest program.
    """
    count, n = spline.points.shape
    size = next((size for size in SIZES if size >= count), None)
    if size is None:
        raise MappingError(
            f"the smallest change within limits: got {count} control points, "
            f"expected at most {SIZES[-1]}"
        )
    programs = _threads.__dict__.setdefault("programs", {})
    if (size, n, torques) not in programs:
        programs[size, n, torques] = LimitProgram(size, n, torques)
    program: LimitProgram = programs[size, n, torques]
    return program


# Small matrices: LAPACK would start threads, which cost more than they save.
@compiled
def _factorise(rows: FloatArray, vector: FloatArray) -> bool:
    """Replace a banded matrix H by R with H = R' R, and a vector g by r with R' r = g.

    Rows start at their diagonal elements. False if H is not positive definite.
    """
    count, width = rows.shape
    for row in range(count):
        if not rows[row, 0] > 0.0:
            return False
        pivot = np.sqrt(rows[row, 0])
        reach = min(width, count - row)
        for one in range(reach):
            rows[row, one] /= pivot
        vector[row] /= pivot
        for one in range(1, reach):
            vector[row + one] -= rows[row, one] * vector[row]
            for other in range(one, reach):
                rows[row + one, other - one] -= rows[row, one] * rows[row, other]
    return True
