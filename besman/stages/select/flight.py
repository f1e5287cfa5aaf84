"""Where a thrown object comes down: its free flight, extrapolated to the floor.

References
----------
L. Gutzeit: From human movement recordings to robot behavior, thesis, section 7.2.3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from besman.exceptions import MappingError
from besman.records import LabelledRecording

FloatArray = npt.NDArray[np.float64]

GRAVITY = 9.81  # m/s^2
_ACCELERATION_WINDOW_S = 0.09
_ACCELERATION_TOLERANCE = 3.0  # m/s^2 from free fall, above the noise of markers
_LEAST_FLIGHT_S = 0.06
_LATEST_RELEASE_S = 0.3
_LONGEST_FLIGHT_S = 2.0


def object_touchdown(
    recording: LabelledRecording,
    bounds: tuple[int, int],
    marker: str,
    gone: npt.NDArray[np.bool_] | None = None,
) -> FloatArray:
    """Extrapolate the free flight of a thrown object to the floor.

    The flight is the longest stretch from the segment on in which the marker accelerates like a
    falling body; the parabola through it has gravity as its only acceleration.

    Parameters
    ----------
    recording : LabelledRecording
        With hand markers and the object's.
    bounds : pair of int
        Half-open rows of the throw; the object leaves the hand at the latest 0.3 s later.
    marker : str
        The object's marker.
    gone : bool array, shape (T,), optional
        Rows of the recording in which the object has left the hand: at the end of its flight it
        has. A ball that a hand brings down falls freely too.

    Returns
    -------
    array, shape (3,)
        Touchdown on z = 0 in the laboratory frame, metres; NaN if no flight was seen.

    Raises
    ------
    MappingError
        If the recording has no such marker.
    """
    check_thrown(marker, recording.markers, recording.source)
    last = min(len(recording.time), bounds[1] + int(_LONGEST_FLIGHT_S * recording.rate_hz))
    rows = np.arange(bounds[0], last)
    path = recording.marker(marker)[rows]
    ends = np.ones(len(rows), dtype=np.bool_) if gone is None else gone[rows]
    flight = _flight(path, recording.rate_hz, bounds[1] - bounds[0], ends)
    if flight is None:
        return np.full(3, np.nan)
    return _fall(recording.time[rows[flight]], path[flight])


def check_thrown(marker: str, markers: Sequence[str], source: str) -> None:
    """Refuse a recording without the marker of a thrown object: a MappingError."""
    if marker not in markers:
        raise MappingError(
            f"{source}: the recording has no marker {marker!r} of a thrown object; "
            f"markers: {', '.join(markers)}"
        )


def _flight(
    path: FloatArray, rate_hz: float, n_throw: int, ends: npt.NDArray[np.bool_]
) -> slice | None:
    """Find the longest run of samples in free fall that begins with the throw or shortly after."""
    window = max(round(_ACCELERATION_WINDOW_S * rate_hz) | 1, 5)
    if len(path) < window:
        return None
    acceleration = find_acceleration(path, window, rate_hz)
    acceleration[:, 2] += GRAVITY
    # NaN, where the object or its past was not seen, compares false.
    falling = np.linalg.norm(acceleration, axis=1) < _ACCELERATION_TOLERANCE
    edges = np.diff(np.concatenate([[0], falling.astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    latest = n_throw + _LATEST_RELEASE_S * rate_hz
    usable = (stops - starts >= _LEAST_FLIGHT_S * rate_hz) & (starts <= latest)
    usable &= ends[stops - 1]
    if not usable.any():
        return None
    longest = int(np.argmax(np.where(usable, stops - starts, 0)))
    return slice(int(starts[longest]), int(stops[longest]))


def find_acceleration(path: FloatArray, window: int, rate_hz: float) -> FloatArray:
    """Return the second derivative of the parabola that fits a path best around every sample.

    The filter of Savitzky and Golay [1]_ for polynomials of degree 2 in closed form; SciPy's takes
    longer to load than this to filter.

    Parameters
    ----------
    path : array, shape (T, K)
        Metres.
    window : int
        Samples that are fitted at a time: odd, at most T.
    rate_hz : float

    Returns
    -------
    array, shape (T, K)
        m/s^2; NaN where a sample is not seen or beyond the path in the window.

    References
    ----------
    .. [1] A. Savitzky, M. J. E. Golay: Smoothing and differentiation of data by simplified least
       squares procedures, Analytical Chemistry 36(8), 1964, DOI 10.1021/ac60214a047.
    """
    half = window // 2
    squares = np.arange(-half, half + 1, dtype=np.float64) ** 2
    squares -= squares.mean()
    weights = 2.0 * rate_hz**2 * squares / (squares @ squares)
    found = np.full(path.shape, np.nan)
    found[half : len(path) - half] = sliding_window_view(path, window, axis=0) @ weights
    return found


def _fall(time: FloatArray, path: FloatArray) -> FloatArray:
    """Fit a parabola under gravity and follow it to z = 0."""
    since = time - time[0]
    basis = np.stack([np.ones_like(since), since], axis=1)
    fallen = path + np.outer(since**2, [0.0, 0.0, GRAVITY / 2])
    (start, velocity), *_ = np.linalg.lstsq(basis, fallen, rcond=None)
    below = velocity[2] ** 2 + 2 * GRAVITY * start[2]
    if below < 0.0:
        return np.full(3, np.nan)
    landing = (velocity[2] + np.sqrt(below)) / GRAVITY
    touchdown: FloatArray = start + landing * velocity
    touchdown[2] = 0.0
    return touchdown
