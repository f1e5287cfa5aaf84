"""Valleys of the speed: the places where one movement may end and the next may begin."""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.geometry.cubic_spline import interpolate_cubic
from besman.stages.segment.signals import resample

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Borders are placed on this grid, whatever the rate of the recording.
GRID_HZ = 100.0

# Rates that differ by less are one: samples do not come apart by 10 ns in a day.
_SAME_RATE = 1e-13

# A Gaussian bell is below this share within so many standard deviations.
_TRUNCATE = 4.0


class ValleyShape(NamedTuple):
    """What counts as a valley and as a rest; shares are of speed, so that no unit matters to them.

    Attributes
    ----------
    smoothing_s : float
        Standard deviation of the Gaussian low-pass of the positions, seconds.
    hill : float
        A hill lower than this share of the typical speed is no movement; see `typical_speed`. A
        movement is under way above this share of its own peak.
    depth : float
        A valley is deeper than this share of the lower of the two peaks beside it.
    rest : float
        A rest is slower than this share of the peak before it and after it.
    least_rest_s : float
        A shorter rest is a turning point: one border at its slowest instant.
    sure : float
        A valley deeper than this share of the lower peak beside it is a border in any case.
    least : float
        A hill lower than this is no movement either, m/s.
    """

    smoothing_s: float = 0.05
    hill: float = 0.2
    depth: float = 0.4
    rest: float = 0.08
    least_rest_s: float = 0.45
    sure: float = 0.3
    least: float = 0.0


class Valley(NamedTuple):
    """One valley, as grid indices: `first` to `last` is the rest in it, or its lowest point.

    A rest at the beginning of the recording counts as one, from 0; one at its end ends at G.
    """

    first: int
    last: int


def smooth_speed(time: npt.ArrayLike, paths: npt.ArrayLike, smoothing_s: float) -> FloatArray:
    """Derive the low-passed speed on a grid of `GRID_HZ`.

    Parameters
    ----------
    time : array, shape (T,)
        Seconds, rising in equal steps, T at least 2.
    paths : array, shape (T, m, 3)
        Positions of m markers, metres.
    smoothing_s : float
        Standard deviation of the low-pass, seconds.

    Returns
    -------
    array, shape (G,)
        Root of the sum of the markers' squared speeds at time[0] + g / GRID_HZ, m/s.
    """
    return path_speed(smooth_path(time, paths, smoothing_s))


def path_speed(path: FloatArray) -> FloatArray:
    """Return the speed, shape (G,), along a path (G, n) on the grid of `GRID_HZ`."""
    if len(path) < 2:
        return np.zeros(len(path))
    speed: FloatArray = np.linalg.norm(np.gradient(path, axis=0), axis=1) * GRID_HZ
    return speed


def smooth_path(time: npt.ArrayLike, paths: npt.ArrayLike, smoothing_s: float) -> FloatArray:
    """Low-pass paths and bring them to the grid of `GRID_HZ`.

    Parameters
    ----------
    time, paths, smoothing_s
        As of `smooth_speed`.

    Returns
    -------
    array, shape (G, 3 m)
        From the first place on, metres.
    """
    t = np.asarray(time, dtype=np.float64)
    x = np.asarray(paths, dtype=np.float64).reshape(len(t), -1)
    x = x - x[0]
    rate_hz = (len(t) - 1) / (t[-1] - t[0])
    if abs(rate_hz / GRID_HZ - 1) < _SAME_RATE:
        grid = x
    elif rate_hz > GRID_HZ * (1 + 1e-6):
        grid = resample(t, x, GRID_HZ)
    else:
        n_grid = int(np.floor((len(t) - 1) / rate_hz * GRID_HZ + 1e-6)) + 1
        grid = interpolate_cubic(np.arange(len(t)) / rate_hz, x, np.arange(n_grid) / GRID_HZ)
    return smooth_grid(grid, smoothing_s)


def smooth_grid(grid: FloatArray, smoothing_s: float) -> FloatArray:
    """Low-pass a path (G, n) that is on the grid of `GRID_HZ` already; see `smooth_path`."""
    return _low_pass(grid, smoothing_s * GRID_HZ)


def _low_pass(values: FloatArray, deviation: float) -> FloatArray:
    """Take the mean under a Gaussian bell about each row; beyond the ends these are held.

    To load SciPy's takes longer than to segment a recording.
    """
    radius, n = int(_TRUNCATE * deviation + 0.5), len(values)
    bell = np.exp(-0.5 * (np.arange(-radius, radius + 1) / deviation) ** 2)
    bell /= bell.sum()
    held = np.pad(values, ((radius, radius), (0, 0)), mode="edge")
    smooth: FloatArray = bell[radius] * values
    for k in range(radius):
        smooth += bell[k] * (held[k : k + n] + held[2 * radius - k : 2 * radius - k + n])
    return smooth


def typical_speed(speed: FloatArray) -> float:
    """Return the speed below which half of the way is covered: rests do not change it."""
    rising = np.sort(speed)
    way = np.cumsum(rising)
    return float(rising[np.searchsorted(way, way[-1] / 2)])


def find_valleys(
    speed: FloatArray,
    shape: ValleyShape | None = None,
    ahead: FloatArray | None = None,
    typical: float | None = None,
) -> list[Valley]:
    """Find the valleys of the speed and the rests in them.

    Local minima are removed one by one: first those beside a hill that is too low for a movement
    (the higher of the two beside it), lowest hill first, then those that are too shallow,
    shallowest first. Removing a minimum joins its two hills.

    Parameters
    ----------
    speed : array, shape (G,)
        On a grid of `GRID_HZ`, not negative.
    shape : ValleyShape, optional
        What counts as a valley.
    ahead : array, shape (G,), optional
        The speed with which the path gets on, whose valleys are found; rests are those of `speed`.
    typical : float, optional
        Of the movement, m/s; `typical_speed` of what is given if not said.

    Returns
    -------
    list of Valley
        In their order in time.
    """
    shape = shape or ValleyShape()
    ahead = speed if ahead is None else ahead
    inner = (ahead[1:-1] <= ahead[:-2]) & (ahead[1:-1] < ahead[2:])
    minima = np.flatnonzero(inner) + 1
    if speed.size < 2 or not speed.any():
        return []
    typical = typical_speed(speed) if typical is None else typical
    minima = _drop_low_hills(ahead, minima, max(shape.hill * typical, shape.least))
    minima = _drop_shallow(ahead, minima, shape.depth)
    return _find_rests(speed, minima, shape)


def find_sure(speed: FloatArray, valleys: list[Valley], share: float) -> npt.NDArray[np.bool_]:
    """Tell which valleys are so deep that they are borders in any case.

    Parameters
    ----------
    speed : array, shape (G,)
        On a grid of `GRID_HZ`.
    valleys : list of Valley
        In their order in time.
    share : float
        Of the lower of the two peaks beside a valley; of the one there is, at the ends.

    Returns
    -------
    bool array, shape (V,)
    """
    edges = [0, *(edge for valley in valleys for edge in valley), len(speed) - 1]
    hills = [
        speed[a : b + 1].max(initial=-np.inf) for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    floors = [speed[first : last + 1].min() for first, last in valleys]
    beside = [min(x for x in pair if x > 0) if max(pair) > 0 else 0.0 for pair in pairwise(hills)]
    return np.array([low < share * peak for low, peak in zip(floors, beside, strict=True)], bool)


class _Relief:
    """Minima of the speed and the hills between them; a minimum that goes joins its two hills.

    Hill k + 1 begins at minimum k, hill 0 at the beginning of the recording. It is there as long as
    that minimum is: a joined hill keeps the lower number, so that numbers rise in time.
    """

    def __init__(self, speed: FloatArray, minima: IntArray) -> None:
        n = len(minima)
        self.minima = minima
        self.floors: list[float] = speed[minima].tolist()
        peaks = np.maximum.reduceat(speed, np.concatenate([[0], minima]))
        self.peaks: list[float] = peaks.tolist()
        self.there = [True] * n
        # The hill before each minimum, and the minimum behind each hill; n where there is none.
        self.hill = list(range(n))
        self.behind = list(range(n + 1))

    def left(self) -> IntArray:
        """Return the minima that are left."""
        return self.minima[np.array(self.there, dtype=np.bool_)]

    def remove(self, gone: int) -> int:
        """Remove a minimum; return the number of the joined hill."""
        hill = self.hill[gone]
        self.there[gone] = False
        self.peaks[hill] = max(self.peaks[hill], self.peaks[gone + 1])
        self.behind[hill] = behind = self.behind[gone + 1]
        if behind < len(self.hill):
            self.hill[behind] = hill
        return hill


def _drop_low_hills(speed: FloatArray, minima: IntArray, least: float) -> IntArray:
    """Remove the higher minimum beside each hill that is lower than `least`, lowest hill first."""
    relief = _Relief(speed, minima)
    n = n_left = len(minima)
    queue = [(peak, hill) for hill, peak in enumerate(relief.peaks) if peak < least]
    heapify(queue)
    while queue and n_left:
        peak, hill = heappop(queue)
        is_there = hill == 0 or relief.there[hill - 1]
        if not is_there or relief.peaks[hill] != peak:
            continue
        beside = [k for k in (hill - 1, relief.behind[hill]) if 0 <= k < n]
        hill = relief.remove(max(beside, key=relief.floors.__getitem__))
        n_left -= 1
        if relief.peaks[hill] < least:
            heappush(queue, (relief.peaks[hill], hill))
    return relief.left()


def _drop_shallow(speed: FloatArray, minima: IntArray, depth: float) -> IntArray:
    """Remove the minima not deeper than a share of the lower peak beside them, shallowest first."""
    relief = _Relief(speed, minima)
    n = len(minima)

    def share(k: int) -> float:
        peak = min(relief.peaks[relief.hill[k]], relief.peaks[k + 1])
        return relief.floors[k] / peak if peak > 0.0 else np.inf

    shares = [share(k) for k in range(n)]
    queue = [(-value, k) for k, value in enumerate(shares) if value >= depth]
    heapify(queue)
    while queue:
        value, gone = heappop(queue)
        if not relief.there[gone] or shares[gone] != -value:
            continue
        hill = relief.remove(gone)
        for k in (hill - 1, relief.behind[hill]):
            if 0 <= k < n:
                shares[k] = share(k)
                if shares[k] >= depth:
                    heappush(queue, (-shares[k], k))
    return relief.left()


def _find_rests(speed: FloatArray, minima: IntArray, shape: ValleyShape) -> list[Valley]:
    """Find the rest in each valley that has one, and those at the two ends of the recording.

    It begins once the speed has fallen, for good, below a share of the peak before it, and ends
    when the speed last leaves that of the peak behind it. A bell is slow at its ends as well: a
    minimum-jerk movement spends a share x of its duration below each, x^2 (1 - x)^2 = rest / 16,
    and a rest must outlast that of the two movements beside it.
    """
    final = len(speed) - 1
    bounds = np.concatenate([[0], minima, [final]])
    # Between two borders there is one peak: here the speed falls after it, here it rises to it.
    pieces = [speed[low : high + 1] for low, high in pairwise(bounds)]
    falls = [low + _fall(piece, shape) for low, piece in zip(bounds[:-1], pieces, strict=True)]
    rises = [
        high - _fall(piece[::-1], shape) for high, piece in zip(bounds[1:], pieces, strict=True)
    ]
    durations = [fall - rise for fall, rise in zip(falls, rises, strict=True)]
    tail = (1 - np.sqrt(1 - np.sqrt(shape.rest))) / 2
    share = tail / (1 - 2 * tail)
    least = shape.least_rest_s * GRID_HZ
    valleys = []
    if rises[0] > max(least, share * durations[0]):
        valleys.append(Valley(0, rises[0]))
    for k, lowest in enumerate(minima):
        first, last = falls[k], rises[k + 1]
        rests = last - first > max(least, share * (durations[k] + durations[k + 1]))
        valleys.append(Valley(first, last) if rests else Valley(int(lowest), int(lowest)))
    if final - falls[-1] > max(least, share * durations[-1]):
        valleys.append(Valley(falls[-1], len(speed)))
    return valleys


def _fall(piece: FloatArray, shape: ValleyShape) -> int:
    """Return where the speed falls below the rest's share of the peak, for good."""
    peak = piece.max()
    under_way = int(np.flatnonzero(piece >= shape.hill * peak)[-1])
    slow = np.flatnonzero(piece[under_way:] < shape.rest * peak)
    return under_way + int(slow[0]) if slow.size else len(piece) - 1
