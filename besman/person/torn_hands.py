"""Points of a hand that are not where they are said to be: no hand is that long, or turns so fast.

Markerless systems put single joints of a finger on another part of the body for some frames, and
take thumb and little finger for each other.
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_runs

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

LONGEST_HAND_M = 0.25
"""No hand is longer, from the wrist to the tip of the longest finger."""

# Farther than it usually is, in any recording and at most; between these as it trembles.
_STRETCH_M = (0.05, 0.1)
_TREMBLES = 6.0 * 1.4826  # six standard deviations, by the median deviation
_FOREARM_M = 0.1  # by which a forearm differs from itself where its wrist is off
_LEADING_S = 0.03  # smoothed paths lead to a false place, and back
_LONGEST_EXCHANGE_S, _FASTEST_TURN_S = 0.3, 0.1
_TURNED = -0.5  # cosine of the angle between two frames that no forearm turns by
_LEAST_BEND = 0.17  # sine of the angle at the elbow below which its plane is noise: 10 degrees
_NARROW = 0.5  # of a hand's breadth: thumb and little finger on their way to each other's place


class Torn(NamedTuple):
    """Samples that are off.

    Attributes
    ----------
    points : bool array, shape (T, P)
    wrist : bool array, shape (T,)
    """

    points: BoolArray
    wrist: BoolArray


def find_torn(elbow: FloatArray, wrist: FloatArray, points: FloatArray, rate_hz: float) -> Torn:
    """Find what lies farther from the wrist than a hand is long.

    Parameters
    ----------
    elbow, wrist : array, shape (T, 3)
    points : array, shape (T, P, 3)
        Of one hand; all in metres in any frame, NaN where not seen.
    rate_hz : float
        Frames per second.

    Returns
    -------
    Torn
        Where all points are off at once and the forearm is not as long as usual it is the wrist.
    """
    away = np.linalg.norm(points - wrist[:, None], axis=2)
    usual = _median(away)
    trembling = _TREMBLES * _median(np.abs(away - usual))
    far = away > np.minimum(LONGEST_HAND_M, usual + np.clip(trembling, *_STRETCH_M))
    forearm = np.linalg.norm(wrist - elbow, axis=1)
    differs = np.abs(forearm - _median(forearm)) > _FOREARM_M
    seen = np.isfinite(away)
    by_wrist = differs & (seen.sum(axis=1) > 1) & (far == seen).all(axis=1)
    far &= ~by_wrist[:, None]
    n_leading = round(_LEADING_S * rate_hz)
    return Torn(_widen(far, n_leading), _widen(by_wrist[:, None], n_leading)[:, 0])


class TurnedOver(NamedTuple):
    """Where thumb and little finger are taken for each other.

    Attributes
    ----------
    over : bool array, shape (T,)
    on_the_way : bool array, shape (T,)
        There and back, where smoothed paths cross.
    """

    over: BoolArray
    on_the_way: BoolArray


def find_turned_over(thumb: FloatArray, little: FloatArray, rate_hz: float) -> TurnedOver:
    """Find where thumb and little finger are taken for each other for a moment.

    Parameters
    ----------
    thumb, little : array, shape (T, 3)
        Their knuckles, metres in any frame; NaN where not seen.
    rate_hz : float
        Frames per second.

    Returns
    -------
    TurnedOver
        From where a hand seems to turn over within 0.1 s until it has turned back, if that takes
        0.3 s at most.
    """
    across = thumb - little
    breadths = np.linalg.norm(across, axis=1)
    found = TurnedOver(*np.zeros((2, len(across)), dtype=np.bool_))
    with np.errstate(invalid="ignore"):
        rows = np.flatnonzero(breadths > _NARROW * _median(breadths))
    if len(rows) < 3:
        return found
    ways = across[rows] / breadths[rows, None]
    turned = (ways[1:] * ways[:-1]).sum(axis=1) < _TURNED
    turned &= np.diff(rows) <= max(1.0, _FASTEST_TURN_S * rate_hz)
    over = np.concatenate([[0], np.cumsum(turned)]) % 2 == 1
    if 2 * over.sum() > len(over):
        over = ~over
    for start, end in find_runs(over):
        first = rows[start - 1] + 1 if start else 0
        last = rows[end] if end < len(rows) else len(across)
        if rows[end - 1] + 1 - rows[start] <= _LONGEST_EXCHANGE_S * rate_hz:
            found.on_the_way[first:last] = True
            found.on_the_way[rows[start:end]] = False
            found.over[rows[start:end]] = True
    return found


def hold_to_forearm(
    shoulder: FloatArray, elbow: FloatArray, wrist: FloatArray, points: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Fill points of a hand while elbow and wrist are seen: they go along with the forearm.

    Parameters
    ----------
    shoulder, elbow, wrist : array, shape (T, 3)
    points : array, shape (T, P, 3)
        Of one hand, each seen at least once; all in metres in any frame, NaN where not seen.

    Returns
    -------
    points : array, shape (T, P, 3)
        Between two samples on the straight line, against the forearm, before the first and after
        the last as there.
    held : bool array, shape (T,)
        Where one of them was filled.
    """
    forearms = _forearm_axes(shoulder, elbow, wrist)
    known = np.isfinite(np.concatenate([forearms, wrist[:, None]], axis=1)).all(axis=(1, 2))
    local = np.einsum("tji,tpj->tpi", forearms, points - wrist[:, None])
    seen: BoolArray = np.isfinite(local).all(axis=2)
    rows = np.arange(len(points))
    held = known[:, None] & ~seen & seen.any(axis=0)
    result = points.copy()
    for column in np.flatnonzero(held.any(axis=0)):
        there, gone = np.flatnonzero(seen[:, column]), np.flatnonzero(held[:, column])
        for axis in range(3):
            local[gone, column, axis] = np.interp(rows[gone], there, local[there, column, axis])
        result[gone, column] = wrist[gone] + np.einsum(
            "tij,tj->ti", forearms[gone], local[gone, column]
        )
    return result, np.asarray(held.any(axis=1), dtype=np.bool_)


def _forearm_axes(shoulder: FloatArray, elbow: FloatArray, wrist: FloatArray) -> FloatArray:
    """Return the axes (T, 3, 3), as columns, of a forearm: along it, across, in the arm's plane."""
    along = wrist - elbow
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    bend = np.cross(elbow - shoulder, along)
    sines = np.linalg.norm(bend, axis=1) / np.linalg.norm(elbow - shoulder, axis=1)
    rows = np.arange(len(bend))
    bent = np.flatnonzero(sines > _LEAST_BEND)
    if not len(bent):
        return np.full((len(bend), 3, 3), np.nan)
    # Where the arm is straight its plane is the one before and after.
    across = np.stack([np.interp(rows, bent, bend[bent, axis]) for axis in range(3)], axis=1)
    across -= (across * along).sum(axis=1, keepdims=True) * along
    across = across / np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([along, across, np.cross(along, across)], axis=-1)


def _median(values: FloatArray) -> FloatArray:
    """Return medians over time; NaN of what is never seen."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.asarray(np.nanmedian(values, axis=0))


def _widen(found: BoolArray, n_more: int) -> BoolArray:
    """Return samples (T, P) with so many more before and after each."""
    wide = found.copy()
    for step in range(1, n_more + 1):
        wide[:-step] |= found[step:]
        wide[step:] |= found[:-step]
    return wide
