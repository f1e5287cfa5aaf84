"""Samples that no body makes: out and back faster than an arm, a ball or a stick can."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_runs, find_seen

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

LONGEST = 10
"""Frames of one spike; what lasts longer is a place where something was."""

SMALLEST_M = 0.1
"""A deviation up to this may be a marker that trembles or is taken for its neighbour."""

IMPOSSIBLE_M_S = 100.0
"""Nothing that a camera sees is this fast."""

# A hand that goes out and comes back does not exceed this, and a throw is below this speed.
_ACCELERATION_M_S2 = 300.0
_SPEED_M_S = 40.0
# At an end few samples are lost if it was something after all.
_AT_AN_END_M_S, _AT_AN_END_M = 50.0, 0.3
_FARTHEST_M = 1e9
# Times of frames, and with them what a step may be, are rounded.
_ROUNDING = 1e-6
# Frames whose steps are looked at together; they stay near the processor.
_AT_ONCE = 1024


class Faults(NamedTuple):
    """What no body makes.

    Attributes
    ----------
    spikes : bool array, shape (T, M)
        Samples away from a trajectory that comes back.
    jumps : tuple of (int, int)
        Row after a step that is not taken back, and trajectory: two things under one name.
    """

    spikes: BoolArray
    jumps: tuple[tuple[int, int], ...]


def find_faults(positions: FloatArray, rate_hz: float, joined: BoolArray) -> Faults:
    """Find the samples that leave a trajectory faster than any body, and whether they come back.

    Each sample of a spike is farther from the straight line between the samples before and after it
    than a hand gets between two samples (0.1 m and what 300 m/s^2 or 40 m/s give), and than these
    two are from each other. At the start or end of a trajectory there is one of them only; there
    a spike is what jumps by 0.3 m and 50 m/s.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Metres; NaN where not seen.
    rate_hz : float
        Frames per second.
    joined : bool array, shape (M,)
        Which trajectories are of one thing before and after a gap; those without a name need not
        be.

    Returns
    -------
    Faults
        Spikes of at most `LONGEST` seen samples; a place that is left for longer is none.
    """
    spikes = np.zeros(positions.shape[:2], dtype=np.bool_)
    jumps: list[tuple[int, int]] = []
    for column in _suspects(positions, rate_hz, joined):
        # Beyond this squares are no numbers any more, and nothing is there.
        path = np.clip(positions[:, column], -_FARTHEST_M, _FARTHEST_M)
        seen = find_seen(path)
        pieces = [np.flatnonzero(seen)]
        if not joined[column]:
            pieces = _pieces_with_steps(path, seen, rate_hz)
        for rows in pieces:
            if len(rows) < 2:
                continue
            found = _spikes_of(path[rows], rows / rate_hz)
            spikes[rows, column] = found
            left = rows[~found]
            steps = np.linalg.norm(np.diff(path[left], axis=0), axis=1)
            fast = steps > np.maximum(SMALLEST_M, IMPOSSIBLE_M_S / rate_hz * np.diff(left))
            jumps += [(int(row), column) for row in left[1:][fast]]
    return Faults(spikes, tuple(sorted(jumps)))


def _pieces_with_steps(
    path: FloatArray, seen: BoolArray, rate_hz: float
) -> list[npt.NDArray[np.int64]]:
    """Return the rows of each stretch that is seen and has a step that may begin a spike.

    Of an hour without names there are thousands of stretches, and a jump is a longer step yet.
    """
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    edges = np.flatnonzero(steps > (1.0 - _ROUNDING) * _reach(1.0 / rate_hz) / 2.0)
    runs = find_runs(seen)
    has_one = np.searchsorted(edges, runs[:, 0]) < np.searchsorted(edges, runs[:, 1] - 1)
    return [np.arange(start, end) for start, end in runs[has_one]]


def _suspects(positions: FloatArray, rate_hz: float, joined: BoolArray) -> list[int]:
    """Return the trajectories with a step that may begin a spike."""
    least = float(_reach(1.0 / rate_hz)) / 2.0
    suspect = np.zeros(positions.shape[1], dtype=np.bool_)
    # Of a step that long, one coordinate is at least this long; few trajectories have one.
    for column in np.flatnonzero(_greatest_steps(positions) > least / np.sqrt(3.0)).tolist():
        with np.errstate(over="ignore"):
            steps = np.abs(np.diff(positions[:, column], axis=0))
        longest = np.minimum(steps, _FARTHEST_M)
        suspect[column] = np.any(np.linalg.norm(longest, axis=1) > least)
    # A step over a gap is no number.
    unseen = np.isnan(positions[:, :, 0])
    for column in np.flatnonzero(joined & unseen.any(axis=0) & ~suspect).tolist():
        runs = find_runs(~unseen[:, column])
        before, after = runs[:-1, 1] - 1, runs[1:, 0]
        with np.errstate(over="ignore", invalid="ignore"):
            steps = np.linalg.norm(positions[after, column] - positions[before, column], axis=1)
        # What is no number may be anything.
        suspect[column] = not np.all(steps <= _reach((after - before) / rate_hz) / 2.0)
    return [int(column) for column in np.flatnonzero(suspect)]


def _greatest_steps(positions: FloatArray) -> FloatArray:
    """Return the greatest change of a coordinate from sample to sample, (M,); 0 where none is."""
    flat = positions.reshape(len(positions), -1)
    greatest = np.zeros(flat.shape[1])
    steps = np.empty((min(_AT_ONCE, len(flat)), flat.shape[1]))
    with np.errstate(over="ignore", invalid="ignore"):
        for start in range(0, len(flat) - 1, _AT_ONCE):
            later = flat[start + 1 : start + 1 + _AT_ONCE]
            some = steps[: len(later)]
            np.subtract(later, flat[start : start + len(later)], out=some)
            np.abs(some, out=some)
            np.fmax(greatest, np.fmax.reduce(some, axis=0), out=greatest)
    return np.asarray(greatest.reshape(-1, 3).max(axis=1))


def _reach(seconds: FloatArray | float) -> FloatArray:
    """Return how far a body can be from where it is expected after so many seconds, metres."""
    pause = np.asarray(seconds, dtype=np.float64)
    return np.asarray(SMALLEST_M + np.minimum(_ACCELERATION_M_S2 * pause**2, _SPEED_M_S * pause))


def _spikes_of(path: FloatArray, time: FloatArray) -> BoolArray:
    """Find the spikes of one trajectory without gaps: places (S, 3) at times (S,)."""
    found = np.zeros(len(path), dtype=np.bool_)
    if len(path) < 3:
        return found
    pauses = np.diff(time)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    edges = np.flatnonzero(steps > _reach(pauses) / 2.0)
    last = -1
    for edge in edges:
        if edge <= last:
            continue
        length = _length_from(path, time, int(edge))
        found[edge + 1 : edge + 1 + length] = True
        # A spike is left behind: what follows it is compared with what it came back to.
        last = int(edge) + length if length else last
    _mark_ends(path, time, found)
    return found


def _length_from(path: FloatArray, time: FloatArray, before: int) -> int:
    """Return how many samples after one are a spike; 0 if none."""
    best, slowest = 0, np.inf
    for length in range(1, min(LONGEST, len(path) - before - 2) + 1):
        after = before + length + 1
        inside = slice(before + 1, after)
        duration = float(time[after] - time[before])
        share = (time[inside] - time[before]) / duration
        line = path[before] + share[:, None] * (path[after] - path[before])
        away = np.linalg.norm(path[inside] - line, axis=1)
        pause = max(time[before + 1] - time[before], time[after] - time[after - 1])
        apart = float(np.linalg.norm(path[after] - path[before]))
        # Of several ends the calmest: two samples of one spike may lie close to each other.
        if apart / duration < slowest and np.all(away > max(float(_reach(pause)), apart)):
            best, slowest = length, apart / duration
    return best


def _mark_ends(path: FloatArray, time: FloatArray, found: BoolArray) -> None:
    """Mark spikes that a trajectory begins or ends with."""
    for backwards in (False, True):
        order = np.flatnonzero(~found)[:: -1 if backwards else 1]
        if len(order) < 3:
            return
        head = order[: LONGEST + 1]
        steps = np.linalg.norm(np.diff(path[head], axis=0), axis=1)
        # What was found between two samples is no time in which the body got farther unseen.
        between = np.abs(np.diff(head)) - 1
        pauses = np.abs(np.diff(time[head])) - between * np.diff(time).min()
        jumps = np.flatnonzero(steps > _AT_AN_END_M + _AT_AN_END_M_S * pauses)
        # The longer part is the trajectory.
        if jumps.size and 2 * (jumps[-1] + 1) < len(order):
            found[head[: jumps[-1] + 1]] = True
