"""Joint trajectories as B-splines on a fixed stretch of time, by their control points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from besman.robot.parts import JointLimits

FloatArray = npt.NDArray[np.float64]

DEGREE = 5


@dataclass(frozen=True, eq=False)
class JointSpline:
    """A clamped B-spline for every joint, with its knots at samples.

    A spline lies within the hull of its control points, and its derivatives are splines too: what
    holds for the control points of a derivative holds for the derivative at every time [1]_.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds; the inner knots are among them.
    knots : array, shape (C + degree + 1,)
        Seconds; the ends are repeated.
    points : array, shape (C, n)
        Control points, rad.

    References
    ----------
    .. [1] C. de Boor: A Practical Guide to Splines, Springer 2001, chapters IX and X.
    """

    time: FloatArray
    knots: FloatArray
    points: FloatArray

    @property
    def degree(self) -> int:
        """Degree of the polynomials: five, less only if there are fewer than six samples."""
        return len(self.knots) - len(self.points) - 1

    @cached_property
    def first_factors(self) -> FloatArray:
        """Factors of the differences of `points` that give the velocity's control points, 1/s."""
        degree = self.degree
        factors: FloatArray = degree / (self.knots[degree + 1 : -1] - self.knots[1 : -degree - 1])
        return factors

    @cached_property
    def second_factors(self) -> FloatArray:
        """The same from control points of the velocity to those of the acceleration, 1/s."""
        degree = self.degree
        factors: FloatArray = (degree - 1) / (
            self.knots[degree + 1 : -2] - self.knots[2 : -degree - 1]
        )
        return factors

    @cached_property
    def basis(self) -> FloatArray:
        """Values of the basis functions at the samples, shape (T, C)."""
        from scipy.interpolate import BSpline

        matrix = BSpline.design_matrix(self.time, self.knots, self.degree)
        return np.asarray(matrix.toarray(), dtype=np.float64)

    @cached_property
    def centres(self) -> FloatArray:
        """Where each control point counts most (Greville abscissae), shape (C,), seconds."""
        degree = self.degree
        inner = np.lib.stride_tricks.sliding_window_view(self.knots[1:-1], degree)
        return np.asarray(inner.mean(axis=1), dtype=np.float64)

    @cached_property
    def bases_at_centres(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The basis functions and their two derivatives at `centres`, each (C, C)."""
        return self.moved(np.eye(len(self.points))).at(self.centres)

    def velocity_points(self) -> FloatArray:
        """Return the control points of the velocity, shape (C - 1, n), rad/s."""
        points: FloatArray = self.first_factors[:, None] * np.diff(self.points, axis=0)
        return points

    def acceleration_points(self) -> FloatArray:
        """Return the control points of the acceleration, shape (C - 2, n), rad/s^2."""
        points: FloatArray = self.second_factors[:, None] * np.diff(self.velocity_points(), axis=0)
        return points

    def moved(self, points: FloatArray) -> JointSpline:
        """Return the spline with other control points."""
        spline = replace(self, points=points)
        for name in ("basis", "first_factors", "second_factors", "centres", "bases_at_centres"):
            # They depend on the knots alone.
            if name in self.__dict__:
                spline.__dict__[name] = self.__dict__[name]
        return spline

    def times(self, rate_hz: float) -> FloatArray:
        """Return evenly spaced times from the first to the last sample, at least at this rate."""
        first, last = self.time[0], self.time[-1]
        return np.linspace(first, last, int(np.ceil((last - first) * rate_hz)) + 1)

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations at some times, each of shape (R, n)."""
        return self.positions_at(time), *self.rates_at(time)

    def positions_at(self, time: FloatArray) -> FloatArray:
        """Return the positions at some times, shape (R, n)."""
        return _evaluate(self.knots, self.points, self.degree, time)

    def rates_at(self, time: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return velocities and accelerations at some times, each of shape (R, n)."""
        knots, degree = self.knots, self.degree
        return (
            _evaluate(knots[1:-1], self.velocity_points(), degree - 1, time),
            _evaluate(knots[2:-2], self.acceleration_points(), degree - 2, time),
        )

    def samples(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations at `time`, each of shape (T, n)."""
        return self.at(self.time)

    def inside(self, limits: JointLimits) -> bool:
        """Whether the control points, and so the positions at every time, keep their limits."""
        return bool(
            np.all(self.points >= limits.position_min)
            and np.all(self.points <= limits.position_max)
        )


def _evaluate(knots: FloatArray, points: FloatArray, degree: int, time: FloatArray) -> FloatArray:
    """Evaluate a spline whose parts were checked where it was made."""
    from scipy.interpolate import BSpline

    values: FloatArray = BSpline.construct_fast(knots, points, degree)(time)
    return values


def fit_spline(time: FloatArray, positions: FloatArray, knot_spacing_s: float) -> JointSpline:
    """Fit a quintic spline by least squares, with its knots at samples.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds, rising; T at least three.
    positions : array, shape (T, n)
        rad.
    knot_spacing_s : float
        Seconds between knots, about; shorter follows closer.

    Returns
    -------
    JointSpline
    """
    from scipy.interpolate import make_lsq_spline

    n_samples = len(time)
    degree = min(DEGREE, n_samples - 1)
    pieces = int(np.ceil((time[-1] - time[0]) / knot_spacing_s - 1e-9))
    pieces = max(1, min(pieces, (n_samples - degree - 1) // 2))
    inner = np.unique(np.rint(np.linspace(0, n_samples - 1, pieces + 1)).astype(int))[1:-1]
    ends = np.full(degree + 1, time[0]), np.full(degree + 1, time[-1])
    knots = np.r_[ends[0], time[inner], ends[1]]
    points = make_lsq_spline(time, positions, knots, degree).c
    return JointSpline(time=time, knots=knots, points=points)
