"""When an object moves with a hand: grasp and release, by their common motion."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_runs

FloatArray = npt.NDArray[np.float64]

REACH_M = 0.4
"""Farther from the hand's centre an object's centre is not held."""

# Speeds are taken over this time on both sides, so that noise of the cameras is no movement.
_HALF_WINDOW_S = 0.05
_MOVES_M_S = 0.05
# The object sways in the hand: this much of its speed may be of its own.
_OWN_SHARE = 0.5
_OWN_M_S = 0.1
# The hand may stop on the way; to and fro over less than this is a touch.
_PAUSE_S = 0.25
_LEAST_S = 0.15
_LEAST_WAY_M = 0.03
# An object that is slower stands; it has left that place when it is farther from it than this.
_STANDS_M_S = 0.02
_STANDS_M = 0.003
_REST_S = 0.5


def find_holds(
    hand: FloatArray, thing: FloatArray, rate_hz: float, hand2lab: FloatArray | None = None
) -> npt.NDArray[np.int64]:
    """Find the stretches in which an object moves with a hand.

    An object moves with the hand while it moves, is near, and its velocity as seen from the hand,
    which may turn, is little against its own. Such a stretch begins with the last sample at which
    the object still stood, and ends with the first at which it stands again; of an object that is
    thrown it ends where the velocities part.

    Parameters
    ----------
    hand : array, shape (T, 3)
        Centre of the hand, metres.
    thing : array, shape (T, 3)
        Centre of the object, metres; NaN where it is not seen, which is no common motion.
    rate_hz : float
    hand2lab : array, shape (T, 3, 3), optional
        How the hand is turned; without it a hand that turns seems to leave what it holds.

    Returns
    -------
    int array, shape (H, 2)
        Rows of grasp and release, each the first one at which it is so.
    """
    half = max(1, round(_HALF_WINDOW_S * rate_hz))
    if len(thing) <= 2 * half:
        return np.empty((0, 2), dtype=np.int64)
    velocity = _velocity(thing, half, rate_hz)
    speed = np.linalg.norm(velocity, axis=1)
    apart = thing - hand
    near = np.linalg.norm(apart, axis=1) < REACH_M
    if hand2lab is not None:
        apart = np.einsum("tji,tj->ti", hand2lab, apart)
    own = np.linalg.norm(_velocity(apart, half, rate_hz), axis=1)
    together = near & (speed > _MOVES_M_S) & (own < np.maximum(_OWN_SHARE * speed, _OWN_M_S))
    holds = []
    for start, end in _join(find_runs(together), round(_PAUSE_S * rate_hz)):
        grasp = _first_move(thing, speed, start, rate_hz)
        stands = _first_move(thing[::-1], speed[::-1], len(thing) - end, rate_hz)
        release = len(thing) - stands
        way = np.linalg.norm(thing[grasp:release] - thing[grasp], axis=1)
        if end - start >= _LEAST_S * rate_hz and np.nanmax(way) > _LEAST_WAY_M:
            holds.append((grasp, min(release, len(thing) - 1)))
    return np.array(holds, dtype=np.int64).reshape(-1, 2)


def _velocity(path: FloatArray, half: int, rate_hz: float) -> FloatArray:
    """Return the velocity over `half` samples on both sides, shape (T, 3)."""
    rows = np.arange(len(path))
    before, after = np.maximum(rows - half, 0), np.minimum(rows + half, len(path) - 1)
    return np.asarray((path[after] - path[before]) * (rate_hz / (after - before))[:, np.newaxis])


def _join(runs: npt.NDArray[np.int64], longest_pause: int) -> list[tuple[int, int]]:
    """Join runs with short pauses between them."""
    joined: list[tuple[int, int]] = []
    for start, end in runs.tolist():
        if joined and start - joined[-1][1] <= longest_pause:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((start, end))
    return joined


def _first_move(thing: FloatArray, speed: FloatArray, start: int, rate_hz: float) -> int:
    """Return the first row at which an object has left where it stood before row `start`.

    The row itself if the object did not stand in the time before it.
    """
    first = max(0, start - round(_REST_S * rate_hz))
    slow = np.flatnonzero(speed[first : start + 1] < _STANDS_M_S)
    if not len(slow):
        return start
    still = first + int(slow[-1])
    away = np.linalg.norm(thing[still : start + 1] - thing[still], axis=1) > _STANDS_M
    return still + int(np.argmax(away)) if away.any() else start
