"""Values of ROS messages over time: joints by name, and bodies that move against each other."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecordingError
from besman.records import FloatArray

IntArray = npt.NDArray[np.int64]

# A body is not seen where its messages are farther apart than so many of its usual steps.
_USUAL_STEPS = 5.5
_LONGEST_GRID = 50_000_000
# A bag of few messages is not that long: of so many samples one at least was told.
_MOST_EMPTY, _FEW = 20, 100_000


@dataclass
class Track:
    """What one body or joint did.

    Attributes
    ----------
    stamps : list of int
        Nanoseconds: seconds of today have no digits left for them.
    values : list
        Of a joint its angle or shift, of a body position and quaternion (x, y, z; w last).
    parent : str
        The frame that a body's poses are in; empty of a joint.
    """

    stamps: list[int] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)
    parent: str = ""

    @property
    def is_seen(self) -> bool:
        """Whether any value is a number."""
        return len(self.arrays()[0]) > 0

    def arrays(self) -> tuple[IntArray, FloatArray, int]:
        """Return stamps that rise, (N,), values (N, ...), and how many came twice.

        What is no number is left out.
        """
        values = np.asarray(self.values, dtype=np.float64)
        known = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        stamps, values = np.asarray(self.stamps, dtype=np.int64)[known], values[known]
        order = np.argsort(stamps, kind="stable")
        stamps, values = stamps[order], values[order]
        new = np.diff(stamps, prepend=stamps[:1] - 1) > 0
        return stamps[new], values[new], int(len(new) - new.sum())


@dataclass(frozen=True)
class Grid:
    """Even times that everything is brought to.

    Attributes
    ----------
    start_ns : int
        Of the first sample, on the clock of the bag.
    time : array, shape (T,)
        Seconds from there.
    rate_hz : float
    """

    start_ns: int
    time: FloatArray
    rate_hz: float

    def seconds(self, stamps: IntArray) -> FloatArray:
        """Return stamps on the grid's own clock."""
        return np.asarray((stamps - self.start_ns) * 1e-9)


def find_grid(tracks: Iterable[Track], where: str) -> Grid:
    """Return even times over all tracks at the rate of the one with most samples a second.

    Parameters
    ----------
    tracks : iterable of Track
        Those with one sample only are constant.
    where : str
        Named in errors.

    Raises
    ------
    RecordingError
        If no track has two samples, or they lie too far apart.
    """
    from besman.io.recordings.clock import whole_if_near

    moving = [stamps for stamps in (one.arrays()[0] for one in tracks) if len(stamps) > 1]
    if not moving:
        raise RecordingError(f"{where}: a recording of one frame; expected at least two")
    step_ns = min(float(np.median(np.diff(stamps))) for stamps in moving)
    start, end = min(int(one[0]) for one in moving), max(int(one[-1]) for one in moving)
    rate_hz = whole_if_near(1e9 / step_ns)
    seconds = (end - start) * 1e-9
    count = seconds * rate_hz
    most = max(len(stamps) for stamps in moving)
    if not count < min(_LONGEST_GRID, _FEW + _MOST_EMPTY * most):
        raise RecordingError(
            f"{where}: {most} messages at {rate_hz:.4g} Hz over {seconds:.4g} s; are the times "
            "right?"
        )
    return Grid(start, np.arange(int(count + 1e-3) + 1) / rate_hz, rate_hz)


def sample_values(track: Track, grid: Grid) -> FloatArray:
    """Return a joint's values on a grid, (T,), along straight lines; NaN where none was told."""
    stamps, values, _ = track.arrays()
    times = grid.seconds(stamps)
    sampled: FloatArray = np.interp(grid.time, times, values)
    sampled[_unseen(times, grid)] = np.nan
    return sampled


def sample_poses(track: Track, grid: Grid) -> tuple[FloatArray, FloatArray]:
    """Return a body's poses on a grid: rotations (T, 3, 3), positions (T, 3) m; NaN if not seen."""
    from scipy.spatial.transform import Rotation, Slerp

    stamps, values, _ = track.arrays()
    times = grid.seconds(stamps)
    rotations = Rotation.from_quat(values[:, 3:])
    if len(times) == 1:
        shape = len(grid.time), 3
        matrix = np.broadcast_to(rotations.as_matrix()[0], (*shape, 3))
        return matrix, np.broadcast_to(values[0, :3], shape)
    inside = np.clip(grid.time, times[0], times[-1])
    turned = Slerp(times, rotations)(inside).as_matrix()
    moved = np.stack([np.interp(inside, times, values[:, axis]) for axis in range(3)], axis=1)
    unseen = _unseen(times, grid)
    turned[unseen], moved[unseen] = np.nan, np.nan
    return turned, moved


def _unseen(times: FloatArray, grid: Grid) -> Any:
    """Tell, (T,), where no message is near on both sides."""
    if len(times) == 1:
        return np.zeros(len(grid.time), dtype=bool)
    clock, step = grid.time, 0.5 / grid.rate_hz
    after = np.clip(np.searchsorted(times, clock), 1, len(times) - 1)
    apart = times[after] - times[after - 1]
    far = apart > _USUAL_STEPS * max(float(np.median(np.diff(times))), 1.0 / grid.rate_hz)
    near = np.minimum(np.abs(clock - times[after]), np.abs(clock - times[after - 1])) < step
    return (far & ~near) | (clock < times[0] - step) | (clock > times[-1] + step)


def compose_tree(tracks: Mapping[str, Track], grid: Grid, where: str) -> dict[str, Any]:
    """Return the poses of bodies in the frame that is above them all.

    Parameters
    ----------
    tracks : mapping of str to Track
        Bodies by their frame, each in the frame of its `parent`.
    grid : Grid
    where : str
        Named in errors.

    Returns
    -------
    dict of str to (array, array)
        Rotations, shape (T, 3, 3), and positions, shape (T, 3), metres.

    Raises
    ------
    RecordingError
        If frames stand in a circle, or in several trees.
    """
    tops = {_find_top(name, tracks, where): name for name in tracks}
    if len(tops) > 1:
        several = ", ".join(f"{name!r} in {top!r}" for top, name in sorted(tops.items())[:4])
        raise RecordingError(
            f"{where}: poses in {len(tops)} frames that nothing joins: {several}; choose topics of "
            "one with --topic, in a recipe with read.topics"
        )
    found: dict[str, Any] = {}

    def pose(name: str) -> Any:
        if name not in found:
            turned, moved = sample_poses(tracks[name], grid)
            parent = tracks[name].parent
            if parent in tracks:
                above, origin = pose(parent)
                moved = origin + np.einsum("tij,tj->ti", above, moved)
                turned = above @ turned
            found[name] = turned, moved
        return found[name]

    for name in tracks:
        pose(name)
    return found


def _find_top(name: str, tracks: Mapping[str, Track], where: str) -> str:
    """Return the frame above all others of the tree that one is in."""
    met = [name]
    while met[-1] in tracks:
        above = tracks[met[-1]].parent
        if above in met or len(met) > 500:
            raise RecordingError(f"{where}: frame {name!r:.60} stands in a circle of frames")
        met.append(above)
    return met[-1]
