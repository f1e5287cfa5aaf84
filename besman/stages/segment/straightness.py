r"""How fast a path gets on: its speed, and lower where it turns.

Two movements that blend into each other leave no valley in the speed, nor a rest, where a hand goes
on in another direction. Over a window of w seconds, the way made good is what lies between its
ends, the way gone is what lies along the path; their ratio

.. math::

    \rho(t) = \frac{\| x(t + w/2) - x(t - w/2) \|}{\int_{t - w/2}^{t + w/2} \| v \| d\tau}

is one of a straight path whatever its speed, constant along a circle, and cos(a / 2) where an even
path turns by the angle a. The speed with which a path gets on is :math:`v \rho^p`. Of movements
that do not turn it is the speed itself; rests are found in that alone.

The power tells how deep a valley is for a turn as against a mere slowing down: a valley counts
below 0.4 of its peaks (`besman.stages.segment.valleys.ValleyShape`), and with p = 4 that is a turn
by 75 degrees on an even path, or a straight path on which a hand slows to 0.4. People slow down by
half within a movement, when they correct it or carry something, but hardly turn there.

Of simulated reaches that blend for 35 % and 50 % of their duration and turn by 50 to 150 degrees
(``benchmarks/segmentation_blends.py``) its valleys give F1 0.89 and 0.64, those of the speed alone
0.53 and 0.25. A higher power finds more of them, and would cut throws along a wide arc sooner.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# People need about as long to turn from one movement into the next.
_WINDOW_S = 0.4
_POWER = 4


def speed_ahead(path: FloatArray, speed: FloatArray, rate_hz: float) -> FloatArray:
    """Return the speed with which a path gets on.

    Parameters
    ----------
    path : array, shape (G, n)
        Places, in even steps: of several markers their coordinates side by side.
    speed : array, shape (G,)
        Its speed.
    rate_hz : float
        Steps per second.

    Returns
    -------
    array, shape (G,)
        At most `speed`; the window is shorter at the ends.
    """
    n = len(path)
    half = min(max(1, round(_WINDOW_S * rate_hz / 2)), n - 1)
    low = np.maximum(np.arange(n) - half, 0)
    high = np.minimum(np.arange(n) + half, n - 1)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    gone = way[high] - way[low]
    made_good = np.linalg.norm(path[high] - path[low], axis=1)
    straight = np.divide(made_good, gone, out=np.ones(n), where=gone > 0.0)
    ahead: FloatArray = speed * np.minimum(straight, 1.0) ** _POWER
    return ahead
