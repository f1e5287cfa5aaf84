"""When the frames of a recording are sent, by a network that loses and delays some of them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.exceptions import ConfigError
from besman.records import FloatArray


def schedule_frames(
    n_frames: int,
    rate_hz: float,
    pace: float = 1.0,
    lose: float = 0.0,
    late_s: float = 0.0,
    seed: int = 0,
) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return when which frame is sent.

    Parameters
    ----------
    n_frames : int
    rate_hz : float
    pace : float
        Seconds of the recording in a second.
    lose : float
        Share of the frames that are not sent.
    late_s : float
        One frame in twenty is late by up to so much, evenly; others overtake it.
    seed : int

    Returns
    -------
    time_s : array, shape (k,)
        From the start, rising.
    rows : int array, shape (k,)

    Raises
    ------
    ConfigError
        If a number is out of range.
    """
    if not (0 < pace <= 1000 and 0 <= lose < 1 and 0 <= late_s <= 10):
        raise ConfigError(
            f"got --pace {pace:g}, --lose {lose:g}, --late {late_s:g}; expected a pace above "
            "0 and up to 1000, a share from 0 and below 1, and 0 to 10 s"
        )
    draw = np.random.default_rng(seed)
    is_sent, is_late = draw.random(n_frames) >= lose, draw.random(n_frames) < _SHARE_LATE
    time_s = np.arange(n_frames) / (rate_hz * pace)
    time_s = time_s + np.where(is_late, draw.random(n_frames) * late_s, 0.0)
    rows = np.flatnonzero(is_sent)
    order = np.argsort(time_s[rows], kind="stable")
    return time_s[rows][order], rows[order]


_SHARE_LATE = 0.05
