"""Speeding up before a movement and slowing down after it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

# Longest interval between samples of a lead, seconds.
_STEP_S = 0.01


def rest_at_both_ends(
    time: npt.ArrayLike,
    positions: npt.ArrayLike,
    velocities: npt.ArrayLike,
    lead_in_s: float,
    lead_out_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Lengthen a movement at both ends, so that it starts and ends at rest.

    Within a lead the velocity goes from the movement's own to zero as 1 - 3 u^2 + 2 u^3, so that
    neither velocity nor acceleration jumps at rest. A joint moves by half its velocity times the
    duration.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds from 0, rising.
    positions, velocities : array, shape (T, n)
        rad, rad/s.
    lead_in_s, lead_out_s : float
        Durations of the leads, seconds; 0 for none.

    Returns
    -------
    time : array, shape (S,)
        Seconds from 0; the movement itself begins at `lead_in_s`.
    positions : array, shape (S, n)
        rad.
    """
    time, positions = np.asarray(time, dtype=np.float64), np.asarray(positions, dtype=np.float64)
    velocities = np.asarray(velocities, dtype=np.float64)
    before, moved_before = _rest_at_one_end(lead_in_s)
    after, moved_after = _rest_at_one_end(lead_out_s)
    return (
        np.concatenate([lead_in_s - before[::-1], lead_in_s + time, lead_in_s + time[-1] + after]),
        np.concatenate(
            [
                positions[0] - np.outer(moved_before[::-1], velocities[0]),
                positions,
                positions[-1] + np.outer(moved_after, velocities[-1]),
            ]
        ),
    )


def _rest_at_one_end(duration: float) -> tuple[FloatArray, FloatArray]:
    """Return the time since a lead's moving end, and the way made per unit of velocity."""
    steps = int(np.ceil(duration / _STEP_S - 1e-9))
    share = np.arange(1, steps + 1) / max(steps, 1)
    return duration * share, duration * (share - share**3 + share**4 / 2.0)
