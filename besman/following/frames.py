"""The last frames of a stream, as recordings to cut blocks from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.records import LabelledRecording
from besman.stages.label.hold_last_sighting import HeldSample

IntArray = npt.NDArray[np.int64]


class FrameBuffer:
    """Keeps frames until they are forgotten; rows count from the first frame of the stream.

    Parameters
    ----------
    markers : sequence of str, length M
    rate_hz : float
        Frames per second.
    source : str
        Name of the stream.
    first_frame : int
        Frame number of row 0.
    width : int
        Values of a marker: 3 of its position (metres), or 7 with a quaternion (w, x, y, z).
    """

    def __init__(
        self,
        markers: Sequence[str],
        rate_hz: float,
        source: str,
        first_frame: int,
        width: int = 3,
    ) -> None:
        self.markers = tuple(markers)
        self.rate_hz, self.source, self.first_frame = rate_hz, source, first_frame
        self.n_rows = 0
        self._first = 0
        self.width = width
        self._values = np.empty((256, len(self.markers), width))
        self._filled = np.empty((256, len(self.markers)), dtype=bool)
        # Of each marker, half-open rows in which it was lost; few, so that none is forgotten.
        self._lost: list[list[list[int]]] = [[] for _ in self.markers]

    def add(self, sample: HeldSample) -> None:
        """Add one frame."""
        held = self.n_rows - self._first
        if held == len(self._values):
            for name in ("_values", "_filled"):
                old = getattr(self, name)
                setattr(self, name, np.concatenate([old, np.empty_like(old)]))
        self._values[held], self._filled[held] = sample.values, sample.filled
        for column in np.flatnonzero(sample.lost):
            runs = self._lost[column]
            if runs and runs[-1][1] == self.n_rows:
                runs[-1][1] += 1
            else:
                runs.append([self.n_rows, self.n_rows + 1])
        self.n_rows += 1

    @property
    def first_row(self) -> int:
        """The first row that is held."""
        return self._first

    def forget(self, before: int) -> None:
        """Drop the frames before a row, once they are most of what is held."""
        gone, held = before - self._first, self.n_rows - self._first
        if 2 * gone > held:
            for array in (self._values, self._filled):
                array[: held - gone] = array[gone:held].copy()
            self._first = before

    def columns(self, names: Sequence[str]) -> IntArray:
        """Return the columns of markers."""
        return np.array([self.markers.index(name) for name in names], dtype=np.int64)

    def cut(self, start: int, end: int, columns: IntArray | None = None) -> LabelledRecording:
        """Return rows `start` to `end` - 1 as a recording of their own, maybe of some markers."""
        rows = slice(start - self._first, end - self._first)
        chosen = np.arange(len(self.markers)) if columns is None else columns
        values = self._values[rows][:, chosen]
        return LabelledRecording(
            np.arange(start, end) / self.rate_hz,
            values[..., :3],
            tuple(self.markers[column] for column in chosen),
            self._filled[rows][:, chosen],
            self.rate_hz,
            self.source,
            self.first_frame + start,
            values[..., 3:] if self.width > 3 else None,
        )

    def was_lost(self, start: int, end: int, columns: IntArray) -> bool:
        """Tell whether one of the markers was lost in rows `start` to `end` - 1."""
        return any(
            first < end and last > start for column in columns for first, last in self._lost[column]
        )
