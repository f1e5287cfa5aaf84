"""Which axis of a recording's frame points up: by gravity, by names of body parts, by the floor."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_runs, find_seen
from besman.records import Axis

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]

CLEAR = 0.9
"""Confidence from which what was found counts more than what is usual."""

AXES: tuple[Axis, ...] = ("x", "y", "z", "-x", "-y", "-z")

# Parts of a body from top to bottom, by how markers, keypoints and segments are called. Sides and
# prefixes are left out before; hands are anywhere.
_PARTS = (
    r"\bhead|\b[lr]?[fb]hd\b|\bnose\b|\b[lr]? ?eye\b|\b[lr]? ?ear\b|\bvertex\b",
    r"\bneck|shoulder|\b[lr]?sho\b|acrom|\bclav|\bc7\b|\bt1\b|\bt10\b|\bstrn\b|sternum",
    r"elbow|\b[lr]?elb",
    r"pelvis|\bhips?\b|\b[lr]?[ap]si\w?\b|sacr|waist",
    r"knee|\b[lr]?kne\b|ankle|\b[lr]?ank\b|foot|\btoes?\b|\b[lr]toe\b|heel|\b[lr]hee\b|\b[lr]?tib",
)
# Parts that a direction is taken between, the farthest apart first; elbows hang below shoulders.
_PAIRS = ((0, 4), (1, 4), (0, 3), (1, 3), (3, 4), (0, 1), (1, 2))
_FRAMES = 300
_STEADY = 0.75  # mean of the direction from low to high parts, of 1
_STEADY_ARM = 0.65
_ASIDE = 0.5  # its greatest part across

_GRAVITY_M_S2 = (9.4, 10.2)
_FLIGHT_S, _FIT_S = 0.08, 0.15
_STRAIGHT_M = 0.004  # a flight is a parabola within this
_PLUMB = 0.98
_MOST_FRAMES = 60_000  # that flights are looked for in

# Feet are this high, and no standing or kneeling person higher than that.
_FEET_M = (-0.05, 0.15)
_TOP_M = (1.2, 2.6)
_LYING_M = 0.6
_FLOOR_MOVES_M = 0.05
# Fewer frames, or points seen at once, tell nothing of a floor: an arm's stay above any plane.
_LEAST_FRAMES, _LEAST_POINTS = 10, 10


class UpAxis(NamedTuple):
    """What points up.

    Attributes
    ----------
    axis : str
        Such as ``z`` or ``-y``.
    confidence : float
        0 where nothing tells, 1 where several signs agree; see `CLEAR`.
    told_by : str
        In words.
    """

    axis: Axis
    confidence: float
    told_by: str


def find_up_axis(
    positions: FloatArray, names: Sequence[str | None], rate_hz: float, usual: Axis = "z"
) -> UpAxis:
    """Tell which axis points up.

    A flight tells: what falls does so with 9.81 m/s^2. So do parts of a body that have names, if
    high ones stay above low ones, whatever an arm alone does; and the floor, the one plane that
    everything is above and near.
    A body that lies is long along the floor: then names and floor contradict each other.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Metres; NaN where not seen.
    names : sequence of str or None, length M
    rate_hz : float
        Frames per second.
    usual : str
        The axis where nothing tells.

    Returns
    -------
    UpAxis
    """
    # Damaged files have numbers whose squares no double holds; they tell nothing.
    with np.errstate(over="ignore", invalid="ignore"):
        return _weigh(positions, names, rate_hz, usual)


def _weigh(
    positions: FloatArray, names: Sequence[str | None], rate_hz: float, usual: Axis
) -> UpAxis:
    """Weigh what names, floor and flights say."""
    few = positions[:: max(1, -(-len(positions) // _FRAMES))]
    by_names, is_arm = _find_by_names(few, names)
    floors, flat = _find_floors(few)
    if by_names is not None:
        if by_names in floors:
            return UpAxis(by_names, 0.99, "names of body parts and the floor")
        if not is_arm and not flat - {by_names} and not floors:
            return UpAxis(by_names, 0.95, "names of body parts")
    falling = _find_by_gravity(positions[:_MOST_FRAMES], rate_hz)
    if falling is not None:
        return UpAxis(falling, 0.97, "gravity in a flight")
    if by_names is not None and is_arm and not floors:
        return UpAxis(by_names, 0.8, "the shoulder above the elbow")
    if by_names is not None and not is_arm:
        return UpAxis(usual, 0.3, "names of body parts and the floor contradict each other")
    if len(floors) == 1:
        return UpAxis(next(iter(floors)), 0.9, "the floor")
    return UpAxis(usual, 0.0, "")


def _find_by_names(positions: FloatArray, names: Sequence[str | None]) -> tuple[Axis | None, bool]:
    """Return the axis along which high parts of a body stay above low ones; whether only an arm."""
    words = [(index, _words(name)) for index, name in enumerate(names) if name]
    parts = [[index for index, name in words if re.search(part, name)] for part in _PARTS]
    for high, low in _PAIRS:
        if not parts[high] or not parts[low]:
            continue
        ways = _mean(positions[:, parts[high]]) - _mean(positions[:, parts[low]])
        lengths = np.linalg.norm(ways, axis=1)
        known = np.isfinite(lengths) & (lengths > 0)
        if known.sum() < 2 or known.mean() < 0.1:
            continue
        direction = (ways[known] / lengths[known, None]).mean(axis=0)
        if (high, low) == _PAIRS[-1]:
            return _name_axis(direction, _STEADY_ARM, _ASIDE), True
        return _name_axis(direction, _STEADY, _ASIDE), False
    return None, False


def _words(name: str) -> str:
    """Return a name in small letters, its words apart, without a subject before a colon."""
    bare = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.rpartition(":")[2])
    bare = re.sub(r"[^a-z0-9]+", " ", bare.lower())
    return re.sub(r"\b(left|right|l|r)\b ?", "", bare)


def _mean(positions: FloatArray) -> FloatArray:
    """Return the middle of the points seen, (T, 3); NaN where none is."""
    seen = find_seen(positions)
    counts = seen.sum(axis=1)
    sums = np.where(seen[..., None], positions, 0.0).sum(axis=1)
    return np.asarray(np.where(counts[:, None] > 0, sums / np.maximum(counts, 1)[:, None], np.nan))


def _name_axis(direction: FloatArray, least: float, aside: float) -> Axis | None:
    """Name the axis that a direction is along; None if it is along none."""
    which = int(np.argmax(np.abs(direction)))
    across = float(np.abs(np.delete(direction, which)).max())
    if abs(direction[which]) < least or across > aside:
        return None
    return AXES[which] if direction[which] > 0 else AXES[which + 3]


def _find_floors(positions: FloatArray) -> tuple[set[Axis], set[Axis]]:
    """Return the axes along which all is above and near a floor at 0, and those that are flat.

    Flat is what does not rise above 0.6 m, as a person who lies, or feet alone.
    """
    is_seen = find_seen(positions)
    points = positions[is_seen]
    if len(positions) < _LEAST_FRAMES or np.median(is_seen.sum(axis=1)) < _LEAST_POINTS:
        return set(), set()
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    seen = is_seen.any(axis=1)
    least = np.where(np.isnan(positions), np.inf, positions).min(axis=1)[seen].std(axis=0)
    most = np.where(np.isnan(positions), -np.inf, positions).max(axis=1)[seen].std(axis=0)
    floors, flat = set[Axis](), set[Axis]()
    for axis in range(3):
        sides = (
            (AXES[axis], low[axis], high[axis], least[axis]),
            (AXES[axis + 3], -high[axis], -low[axis], most[axis]),
        )
        for name, lowest, highest, moves in sides:
            if not (_FEET_M[0] <= lowest <= _FEET_M[1] and moves <= _FLOOR_MOVES_M):
                continue
            if _TOP_M[0] <= highest <= _TOP_M[1]:
                floors.add(name)
            elif highest < _LYING_M:
                flat.add(name)
    return floors, flat


def _find_by_gravity(positions: FloatArray, rate_hz: float) -> Axis | None:
    """Return the axis against which things fall, if anything flies."""
    half = round(_FIT_S * rate_hz / 2)
    if half < 2 or len(positions) <= 2 * half:
        return None
    steps = np.arange(-half, half + 1)
    # Least squares of a parabola over the window: the weights give its second derivative.
    design = np.stack([np.ones(len(steps)), steps, steps.astype(float) ** 2], axis=1)
    hat = design @ np.linalg.pinv(design)
    weights = 2.0 * np.linalg.pinv(design)[2] * rate_hz**2

    def fall(middles: IntArray, columns: IntArray) -> tuple[BoolArray, FloatArray]:
        """Tell whether things fall in windows, (K,), and how fast, (K, 3), m/s^2."""
        windows = positions[middles[:, None] + steps, columns[:, None]]
        pulls = np.einsum("kwd,w->kd", windows, weights)
        size = np.linalg.norm(pulls, axis=1)
        falls = (size > _GRAVITY_M_S2[0]) & (size < _GRAVITY_M_S2[1])
        errors = windows[falls] - hat @ windows[falls]
        falls[falls] = np.abs(errors).max(axis=(1, 2), initial=0.0) < _STRAIGHT_M
        return falls, pulls

    found = []
    shortest = max(2, round(_FLIGHT_S * rate_hz))
    middles, columns = _may_fall(positions, half, shortest, rate_hz)
    hits, _ = fall(middles, columns)
    around = np.arange(-shortest, shortest + 1)
    for column in np.unique(columns[hits]):
        rows = np.unique(middles[hits & (columns == column)][:, None] + around)
        rows = rows[(rows >= half) & (rows < len(positions) - half)]
        falling, pulls = np.zeros(len(positions), dtype=np.bool_), np.empty((len(positions), 3))
        falling[rows], pulls[rows] = fall(rows, np.full(len(rows), column))
        for start, end in find_runs(falling):
            if end - start >= shortest:
                found.append(pulls[start:end].mean(axis=0))
    if not found:
        return None
    # Several things may fly; all of them fall the same way.
    directions = np.array(found) / np.linalg.norm(found, axis=1)[:, None]
    return _name_axis(-directions.mean(axis=0), _PLUMB, 1.0)


def _may_fall(
    positions: FloatArray, half: int, shortest: int, rate_hz: float
) -> tuple[IntArray, IntArray]:
    """Return samples and trajectories (K,) where one may fall, at least one of every flight.

    Three samples, `half` apart, are as far off a line as in a flight: in each coordinate each is
    within `_STRAIGHT_M` of the parabola.
    """
    middles = np.arange(half, len(positions) - half, shortest)
    around = positions[middles - half] + positions[middles + half]
    pulls = np.linalg.norm(around - 2.0 * positions[middles], axis=2) * (rate_hz / half) ** 2
    slack = 4.0 * np.sqrt(3.0) * _STRAIGHT_M * (rate_hz / half) ** 2
    may = (pulls > _GRAVITY_M_S2[0] - slack) & (pulls < _GRAVITY_M_S2[1] + slack)
    rows, columns = np.nonzero(may)
    return middles[rows], columns
