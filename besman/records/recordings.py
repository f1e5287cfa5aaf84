"""The frozen records that flow between the stages. SI units; NaN means not seen.

Arrays are copied, made read-only and checked once, at construction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from besman.records.frozen import FloatArray, Record, ShapeError, freeze

FARTHEST_M = 1000.0
"""Greatest absolute coordinate: no camera sees farther."""

RATES_HZ = (1.0, 10_000.0)
"""Least and greatest frames per second."""

GREATEST_FRAME = 10**9
"""Greatest number of a frame, and of seconds on a clock: no recording counts farther."""

# Quaternions are stored to sixteen digits; in files of others they have three.
_NO_UNIT = 0.01

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
"""A direction of a file's own frame."""


@dataclass(frozen=True)
class Origin(Record, stored_as="besman.records:Origin", later=("on_ring_m",)):
    """How the numbers of a recording's file were understood; a recording itself is in metres, z up.

    Attributes
    ----------
    format : str
        As in the table of formats; empty for what comes from no file.
    writer : str
        The program that wrote the file, as the file says; empty if it does not.
    units : str
        What its coordinates are in, such as ``mm``; empty if that is the format's rule.
    units_by : str
        How that was told: ``the file``, ``the size of a person``, ``asked for``.
    up : str
        The direction of the file's frame that points up.
    up_by : str
        How that was told; empty where nobody looked.
    notes : tuple of str
        What else was concluded, or is in the file and not in the recording; one sentence each.
    on_ring_m : pair of float, optional
        Where a ball passed a basketball ring's plane, as the file says: metres to the right of who
        throws, and away, from the ring's front.
    """

    format: str = ""
    writer: str = ""
    units: str = ""
    units_by: str = ""
    up: Axis = "z"
    up_by: str = ""
    notes: tuple[str, ...] = ()
    on_ring_m: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Recording(
    Record,
    stored_as="besman.records:Recording",
    finite=("time",),
    distinct=("names",),
    later=("origin",),
):
    """What the cameras delivered.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds, strictly rising.
    positions : array, shape (T, M, 3)
        Metres in the laboratory frame (z up); NaN where a trajectory was not seen.
    names : tuple of str or None, length M
        Names as written in the file; None for an unnamed trajectory.
    rate_hz : float
        Frames per second.
    source : str
        File name without folder.
    first_frame : int
        Frame number of row 0 (segments files count in frames).
    orientations : array, shape (T, M, 4), or None
        Unit quaternions (w, x, y, z), body2lab, of what was recorded as bodies (segments of a
        sensor suit, links of an exoskeleton); None for markers, which have none. NaN where a marker
        stands among bodies, or a body was not seen.
    origin : Origin, optional
        How the numbers of its file were understood.
    """

    time: FloatArray
    positions: FloatArray
    names: tuple[str | None, ...]
    rate_hz: float
    source: str
    first_frame: int = 1
    orientations: FloatArray | None = None
    origin: Origin | None = None

    def __post_init__(self) -> None:
        shapes: dict[str, tuple[int | str, ...]] = {"time": ("T",), "positions": ("T", "M", 3)}
        if self.orientations is not None:
            shapes["orientations"] = ("T", "M", 4)
        freeze(self, shapes)
        if len(self.names) != self.positions.shape[1]:
            raise ShapeError(
                f"Recording.names must name {self.positions.shape[1]} trajectories, "
                f"got {len(self.names)}"
            )

    def gather(self, columns: Sequence[int]) -> FloatArray:
        """Return a copy of the places of some trajectories, shape (T, K, 3), metres."""
        return np.take(self.positions, list(columns), axis=1)

    def gather_to_fill(self, columns: Sequence[int]) -> FloatArray:
        """Return places as `gather` does, to be written to where nothing is seen."""
        return self.gather(columns)

    def without_samples(self) -> Recording:
        """Return its frames alone: of the samples of an hour there are hundreds of megabytes."""
        nothing = np.empty((len(self.time), 0, 3))
        return replace(self, positions=nothing, names=(), orientations=None)

    def check(self) -> None:
        """Refuse what no camera delivers, as `besman.records.frozen.Record.check` says."""
        super().check()
        _check_sense(self)


@dataclass(frozen=True, eq=False)
class LabelledRecording(
    Record,
    stored_as="besman.records:LabelledRecording",
    finite=("time",),
    distinct=("markers",),
):
    """A recording whose trajectories carry the names of a marker set.

    Attributes
    ----------
    time : array, shape (T,)
        Seconds.
    positions : array, shape (T, M, 3)
        Metres in the laboratory frame (z up). No gaps in the required markers of the set; optional
        ones (fingers, objects) stay NaN where they were unseen for long.
    markers : tuple of str, length M
        Canonical names of the marker set, e.g. ``hand_top``.
    filled : bool array, shape (T, M)
        True where a gap was filled.
    rate_hz, source, first_frame, orientations
        As in `Recording`.
    """

    time: FloatArray
    positions: FloatArray
    markers: tuple[str, ...]
    filled: npt.NDArray[np.bool_]
    rate_hz: float
    source: str
    first_frame: int = 1
    orientations: FloatArray | None = None

    def __post_init__(self) -> None:
        shapes: dict[str, tuple[int | str, ...]] = {
            "time": ("T",),
            "positions": ("T", "M", 3),
            "filled": ("T", "M"),
        }
        if self.orientations is not None:
            shapes["orientations"] = ("T", "M", 4)
        freeze(self, shapes, filled=bool)
        if len(self.markers) != self.positions.shape[1]:
            raise ShapeError(
                f"LabelledRecording.markers must name {self.positions.shape[1]} markers, "
                f"got {len(self.markers)}"
            )

    def check(self) -> None:
        """Refuse what no camera delivers, as `besman.records.frozen.Record.check` says."""
        super().check()
        _check_sense(self)

    def marker(self, name: str) -> FloatArray:
        """Return the positions of one marker, shape (T, 3), metres."""
        if name not in self.markers:
            from besman.exceptions import LabellingError, nearest

            raise LabellingError(
                f"{self.source}: no marker {name!r}; {nearest(name, self.markers)}"
            )
        return self.positions[:, self.markers.index(name)]


def _check_sense(recording: Recording | LabelledRecording) -> None:
    """Refuse a rate, frames, coordinates or orientations that no camera has."""
    kind, (slowest, fastest) = type(recording).__name__, RATES_HZ
    if not slowest <= recording.rate_hz <= fastest:
        raise ShapeError(
            f"{kind}.rate_hz must be {slowest:g} to {fastest:g}, got {recording.rate_hz:g}"
        )
    if np.any(np.abs(recording.positions) > FARTHEST_M):
        raise ShapeError(f"{kind}.positions must be within {FARTHEST_M:g} m")
    if not 0 <= recording.first_frame <= GREATEST_FRAME - len(recording.time):
        raise ShapeError(f"{kind}.first_frame must be 0 to {GREATEST_FRAME:.0e}")
    if recording.orientations is not None:
        # What is not seen has none; what is far longer overflows.
        parts = np.clip(recording.orientations, -2.0, 2.0)
        if np.any(np.abs(np.linalg.norm(parts, axis=2) - 1.0) > _NO_UNIT):
            raise ShapeError(f"{kind}.orientations must be unit quaternions")
