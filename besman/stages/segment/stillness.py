r"""How fast noise seems to move: below that speed there is rest.

White noise of standard deviation :math:`\sigma`, sampled at a rate f and low-passed by a Gaussian
bell of standard deviation s, has speeds of

.. math::

    \sigma_v^2 = \frac{\sigma^2}{4 \sqrt{\pi} s^3 f}

on each axis. A movement has hardly any third difference from sample to sample, noise has
:math:`20 \sigma^2`: so :math:`\sigma` is taken from the middle one of these, whatever moves.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# Noise alone hardly ever gets so many times its root mean square speed: once in hours.
_TIMES = 3.5
_MEDIAN_TO_DEVIATION = 1.4826  # of a normal distribution
_THIRD_DIFFERENCE = 20.0  # 1 + 9 + 9 + 1


def least_speed(time: npt.ArrayLike, paths: npt.ArrayLike, smoothing_s: float) -> float:
    """Return the speed below which nothing but noise need be at work.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds, rising in equal steps, T at least 2.
    paths : array, shape (T, m, 3)
        Positions of m markers, metres.
    smoothing_s : float
        Standard deviation of the low-pass after which speed is taken, seconds.

    Returns
    -------
    float
        Root of the sum of the markers' squared speeds, metres per second; 0 of fewer than four
        samples.
    """
    t = np.asarray(time, dtype=np.float64)
    x = np.asarray(paths, dtype=np.float64)
    if len(t) < 4 or smoothing_s <= 0.0:
        return 0.0
    rate_hz = (len(t) - 1) / (t[-1] - t[0])
    # A coordinate at a time: of an hour at 500 Hz each copy of one has 14 MB.
    thirds = [
        np.median(np.abs(np.diff(path, n=3)), overwrite_input=True)
        for path in x.reshape(len(t), -1).T
    ]
    deviation = _MEDIAN_TO_DEVIATION * np.array(thirds) / np.sqrt(_THIRD_DIFFERENCE)
    variance = np.sum(deviation**2) / (4.0 * np.sqrt(np.pi) * smoothing_s**3 * rate_hz)
    return float(_TIMES * np.sqrt(variance))
