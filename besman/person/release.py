"""When a hand throws: the moment at which what it holds would fly highest.

The fastest moment is none: in a basketball shot a hand is no faster than while it bounces the ball
or sinks afterwards, but then it is high.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_GRAVITY = 9.81  # m/s^2
# A hand that stays up after the throw keeps its energy: the first moment counts.
_SHARE = 0.98


def hand_energy(heights: FloatArray, speeds: FloatArray) -> FloatArray:
    """Return a hand's mechanical energy by its mass.

    Parameters
    ----------
    heights : array, shape (T,)
        Above the floor, metres; NaN where not known.
    speeds : array, shape (T,)
        Metres per second.

    Returns
    -------
    array, shape (T,)
        Square metres by square seconds.
    """
    energy: FloatArray = _GRAVITY * np.maximum(heights, 0.0) + 0.5 * speeds**2
    return energy


def find_release(energy: FloatArray) -> int | None:
    """Return the first sample at which a hand's energy is nearly greatest.

    Parameters
    ----------
    energy : array, shape (T,)
        As of `hand_energy`; NaN where not known.

    Returns
    -------
    int or None
        None if it is known nowhere.
    """
    if not np.isfinite(energy).any():
        return None
    return int(np.flatnonzero(energy >= _SHARE * np.nanmax(energy))[0])
