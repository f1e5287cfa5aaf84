"""The convex program: the smallest change of a joint trajectory that keeps the arm's limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import MappingError
from besman.robot.kinematics import compiled
from besman.robot.parts import JointLimits
from besman.stages.map.band_program import solve_band_program
from besman.stages.map.joint_spline import DEGREE, JointSpline

FloatArray = npt.NDArray[np.float64]

# A longer movement is left as it is: a solve takes time in proportion to the number of points.
GREATEST_POINTS = 256
# By so much an answer may miss a bound, rad.
_MISSED = 1e-6


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

    over the change x of the control points. A control point meets its five neighbours on both
    sides alone, so that all matrices are bands:
    `besman.stages.map.band_program.solve_band_program`.

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
    """
    count, n = spline.points.shape
    if count > GREATEST_POINTS:
        raise MappingError(
            f"the smallest change within limits: got {count} control points, "
            f"expected at most {GREATEST_POINTS}"
        )
    weights, room = _limit_room(spline, limits, stretch)
    rows, width = np.empty((0, n)), (DEGREE + 1) * n
    if torques is not None:
        rows = np.array(torques.slopes.reshape(count * n, -1))
        width = rows.shape[1]
        both = np.stack([1.0 - torques.shares.ravel(), 1.0 + torques.shares.ravel()])
        room = np.concatenate([room, both], axis=1)
    band, change = _columns(np.array(metric.bands), width), np.empty(count * n)
    gradient = np.array(metric.gradient).ravel()
    missed, rounds = solve_band_program(band, gradient, n, weights, rows, room, change)
    if not (missed <= _MISSED and np.isfinite(change).all()):
        raise MappingError(
            "the smallest change within limits: none is found, a bound is missed by "
            f"{missed:.2g} after {rounds} rounds"
        )
    return change.reshape(count, n)


@compiled
def _columns(bands: FloatArray, width: int) -> FloatArray:
    """Return the lower triangle of H by columns, of shape (C n, width)."""
    count, n = bands.shape[1:3]
    columns = np.zeros((count * n, width))
    for shift in range(min(len(bands), count)):
        for point in range(count - shift):
            for i in range(n):
                for j in range(n):
                    if shift > 0 or j >= i:
                        columns[point * n + i, shift * n + j - i] = bands[shift, point, i, j]
    return columns


def _limit_room(
    spline: JointSpline, limits: JointLimits, stretch: float
) -> tuple[FloatArray, FloatArray]:
    """Return weights of the steps, and the room of all control points above and below."""
    first, second = spline.first_factors, spline.second_factors
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
    return weights, np.stack(
        [np.concatenate([side[way].ravel() for side in room]) for way in range(2)]
    )
