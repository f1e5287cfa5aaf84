"""Smooth joint trajectories that keep the arm's limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_lsq_spline

from besman.robot.limits import resample, time_stretch
from besman.robot.parts import JointLimits

FloatArray = npt.NDArray[np.float64]

# The limits are met between the samples that are looked at, too.
_RESERVE = 1.002
_FINE_HZ = 4000.0


@dataclass(frozen=True, eq=False)
class ScaledPath:
    """A joint trajectory within limits of velocity and acceleration.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds from 0.
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2: one quintic spline and its own derivatives.
    stretch : float
        Duration over the duration before, at least 1.
    """

    time: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    stretch: float


def smooth_path(
    time: FloatArray, positions: FloatArray, knot_spacing_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a quintic spline by least squares, with its knots at samples.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds, evenly spaced.
    positions : array, shape (T, n)
        rad.
    knot_spacing_s : float
        Seconds between knots, about; shorter follows closer.

    Returns
    -------
    positions, velocities, accelerations : array, shape (T, n)
        rad, rad/s, rad/s^2.
    """
    n_samples = len(time)
    degree = min(5, n_samples - 1)
    pieces = int(np.ceil((time[-1] - time[0]) / knot_spacing_s - 1e-9))
    pieces = max(1, min(pieces, (n_samples - degree - 1) // 2))
    inner = np.unique(np.rint(np.linspace(0, n_samples - 1, pieces + 1)).astype(int))[1:-1]
    ends = np.full(degree + 1, time[0]), np.full(degree + 1, time[-1])
    spline = make_lsq_spline(time, positions, np.r_[ends[0], time[inner], ends[1]], degree)
    return spline(time), spline.derivative()(time), spline.derivative(min(2, degree))(time)


def scale_path(
    time: FloatArray,
    positions: FloatArray,
    limits: JointLimits,
    *,
    knot_spacing_s: float = 0.05,
    least_duration_s: float = 0.0,
) -> ScaledPath:
    """Smooth a path in joint space and slow it down evenly until the limits hold everywhere.

    Velocities at start and end are those of the movement: it need not begin or end at rest.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds from 0, evenly spaced.
    positions : array, shape (T, n)
        rad.
    limits : JointLimits
    knot_spacing_s : float
        See `smooth_path`.
    least_duration_s : float
        Shorter movements are stretched to this duration, seconds.

    Returns
    -------
    ScaledPath
    """
    smooth, velocities, accelerations = smooth_path(time, positions, knot_spacing_s)
    _, _, fine_velocities, fine_accelerations = resample(
        time, smooth, velocities, accelerations, _FINE_HZ
    )
    needed = _RESERVE * time_stretch(limits, fine_velocities, fine_accelerations)
    stretch = max(1.0, needed, least_duration_s / float(time[-1]))
    return ScaledPath(
        time=time * stretch,
        positions=smooth,
        velocities=velocities / stretch,
        accelerations=accelerations / stretch**2,
        stretch=stretch,
    )
