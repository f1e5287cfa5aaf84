"""A low-pass filter without delay; SciPy's signals take longer to load than this to filter."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def low_pass(values: FloatArray, rate_hz: float, cutoff_hz: float, n_beyond: int) -> FloatArray:
    """Filter forwards and backwards with a Butterworth filter of second order.

    The values are those of ``scipy.signal.sosfiltfilt`` with the sections of
    ``scipy.signal.butter(2, cutoff_hz, fs=rate_hz, output="sos")``.

    Parameters
    ----------
    values : array, shape (T, ...)
        Sampled evenly along the first axis.
    rate_hz : float
        Samples a second.
    cutoff_hz : float
        Below half of that.
    n_beyond : int
        By how many samples, less than T, values are continued beyond either end, turned about it.

    Returns
    -------
    array, shape (T, ...)
    """
    ahead, back = butterworth(rate_hz, cutoff_hz)
    rows = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
    before = 2.0 * rows[:1] - rows[n_beyond:0:-1]
    after = 2.0 * rows[-1:] - rows[-2 : -(n_beyond + 2) : -1]
    found = np.concatenate([before, rows, after])
    states = np.linalg.solve(
        np.array([[1.0 + back[1], -1.0], [back[2], 1.0]]), ahead[1:] - back[1:] * ahead[0]
    )
    for _ in range(2):
        found = _filter(found, ahead, back, states[:, None] * found[:1])[::-1]
    within: FloatArray = found[n_beyond : n_beyond + len(rows)].reshape(np.shape(values))
    return within


def butterworth(rate_hz: float, cutoff_hz: float) -> tuple[FloatArray, FloatArray]:
    """Design a low-pass filter of second order, by the bilinear transformation [1]_.

    Returns
    -------
    ahead, back : array, shape (3,)
        Coefficients of the last inputs and of the last outputs, the newest first; ``back[0]`` is 1.

    References
    ----------
    .. [1] A. V. Oppenheim, R. W. Schafer: Discrete-Time Signal Processing, 3rd ed., section 7.2.
    """
    # The poles of the analogue filter, at twice a sampling rate of 2, its cutoff pre-warped.
    pole = 4.0 * np.tan(np.pi * (2.0 * cutoff_hz / rate_hz) / 2.0)
    poles = -pole * np.exp(1j * np.pi * np.array([-1.0, 1.0]) / 4.0)
    gain = pole**2 * np.real(1.0 / np.prod(4.0 - poles))
    return gain * np.array([1.0, 2.0, 1.0]), np.real(np.poly((4.0 + poles) / (4.0 - poles)))


@numba.njit(cache=True, nogil=True)
def _filter(
    values: FloatArray, ahead: FloatArray, back: FloatArray, states: FloatArray
) -> FloatArray:  # pragma: no cover
    """Filter columns (T, K), in the transposed direct form II from its states (2, K) on."""
    found = np.empty_like(values)
    for column in range(values.shape[1]):
        first, second = states[0, column], states[1, column]
        for row in range(len(values)):
            value = values[row, column]
            new = ahead[0] * value + first
            first = ahead[1] * value - back[1] * new + second
            second = ahead[2] * value - back[2] * new
            found[row, column] = new
    return found
