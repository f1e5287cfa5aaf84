"""Recordings whose trajectories are put together of pieces of others, when they are asked for.

Of an hour at 500 Hz the places of 13 markers have 560 MB: what was named is not copied.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_runs, find_seen
from besman.geometry.row_blocks import by_rows
from besman.records import Recording
from besman.records.frozen import hand_over
from besman.stages.label.gather import LeftOver
from besman.stages.label.named_recording import NameDecision

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Frames that are put together at once: they stay near the processor.
_ROWS_AT_ONCE = 2048


class TrajectoryPiece(NamedTuple):
    """Some samples of a trajectory.

    Attributes
    ----------
    start : int
        Row of the first.
    samples : array, shape (N, 3)
        Metres; NaN where not seen. A view of what was recorded.
    """

    start: int
    samples: FloatArray

    @property
    def stop(self) -> int:
        """Row after the last."""
        return self.start + len(self.samples)

    def part(self, start: int, stop: int) -> TrajectoryPiece:
        """Return those of its samples that are in these rows."""
        first, last = max(start, self.start), min(stop, self.stop)
        return TrajectoryPiece(
            first, self.samples[first - self.start : max(first, last) - self.start]
        )

    def seen_parts(self) -> list[TrajectoryPiece]:
        """Return copies of the stretches in which there is a sample, whole or not."""
        runs = find_runs(np.asarray(np.isfinite(self.samples).any(axis=1))).tolist()
        return [TrajectoryPiece(self.start + a, self.samples[a:b].copy()) for a, b in runs]


PiecedPath = tuple[TrajectoryPiece, ...]
"""A trajectory: nothing is seen between its pieces, of which no two share a row."""


def split_path(path: PiecedPath, start: int, stop: int) -> tuple[PiecedPath, PiecedPath]:
    """Return what of a trajectory is inside rows, and what is outside."""
    inside, outside = [], []
    for piece in path:
        if piece.stop <= start or piece.start >= stop:
            outside.append(piece)
            continue
        inside.append(piece.part(start, stop))
        ends = (piece.part(piece.start, start), piece.part(stop, piece.stop))
        outside += [end for end in ends if len(end.samples)]
    return tuple(inside), tuple(outside)


def lay_out(path: PiecedPath, start: int, stop: int) -> FloatArray:
    """Return a trajectory's places in some rows, shape (stop - start, 3); NaN where not seen."""
    places = np.full((stop - start, 3), np.nan)
    for piece in split_path(path, start, stop)[0]:
        places[piece.start - start : piece.stop - start] = piece.samples
    return places


def is_seen(path: PiecedPath) -> bool:
    """Tell whether a trajectory has any sample, whole or not."""
    return any(
        np.isfinite(piece.samples[row : row + _ROWS_AT_ONCE]).any()
        for piece in path
        for row in range(0, len(piece.samples), _ROWS_AT_ONCE)
    )


class WovenRecording:
    """What a `Recording` is, with trajectories of pieces.

    Parameters
    ----------
    frames : Recording
        Its time, rate, source and first frame are those of this one.
    names : sequence of (str or None), length M
    paths : sequence of PiecedPath, length M
    orientations : array, shape (T, M, 4), optional

    Attributes
    ----------
    frames : Recording
        The one without trajectories.
    time, names, rate_hz, source, first_frame, orientations
        As of `Recording`.
    """

    def __init__(
        self,
        frames: Recording,
        names: Sequence[str | None],
        paths: Sequence[PiecedPath],
        orientations: FloatArray | None = None,
    ) -> None:
        self.frames = frames.without_samples()
        self.time, self.rate_hz = frames.time, frames.rate_hz
        self.source, self.first_frame = frames.source, frames.first_frame
        self.names, self.paths, self.orientations = tuple(names), tuple(paths), orientations
        pieces = [(column, piece) for column, path in enumerate(paths) for piece in path]
        self._samples = [piece.samples for _, piece in pieces]
        bounds = [(piece.start, piece.stop, column) for column, piece in pieces]
        self._start, self._stop, self._column = np.array(bounds, np.int64).reshape(-1, 3).T
        self._packed: tuple[tuple[int, ...], FloatArray] | None = None

    @classmethod
    def of(cls, recording: Recording) -> WovenRecording:
        """Return a recording as it is, each trajectory in one piece."""
        paths = [
            (TrajectoryPiece(0, recording.positions[:, k]),) for k in range(len(recording.names))
        ]
        return cls(recording, recording.names, paths, recording.orientations)

    def rows(
        self, start: int, stop: int, columns: Sequence[int] | None = None, step: int = 1
    ) -> FloatArray:
        """Return places in some of the frames.

        Parameters
        ----------
        start, stop : int
            Half-open rows.
        columns : sequence of int, length K, optional
            Trajectories; all if not given.
        step : int
            From one row that is returned to the next.

        Returns
        -------
        array, shape (ceil((stop - start) / step), K, 3)
            Metres; NaN where not seen.
        """
        columns = range(len(self.paths)) if columns is None else columns
        places = np.full((-(-(stop - start) // step), len(columns), 3), np.nan)
        order = {column: k for k, column in enumerate(columns)}
        for piece in self._pieces_in(start, stop):
            k = order.get(int(self._column[piece]))
            if k is None:
                continue
            begin, end = int(self._start[piece]), int(self._stop[piece])
            first = -(-max(0, begin - start) // step)
            last = -(-(min(stop, end) - start) // step)
            at = start + first * step - begin
            samples = self._samples[piece][at : min(stop, end) - begin : step]
            places[first:last, k] = samples
        return places

    def columns_in(self, start: int, stop: int) -> list[int]:
        """Return the trajectories that may be seen in some of the frames, in rising order."""
        return [int(column) for column in np.unique(self._column[self._pieces_in(start, stop)])]

    def gather(self, columns: Sequence[int]) -> FloatArray:
        """Return some trajectories, as `Recording.gather` does."""
        n_frames = len(self.time)
        places = np.empty((n_frames, len(columns), 3))
        for start in range(0, n_frames, _ROWS_AT_ONCE):
            stop = min(start + _ROWS_AT_ONCE, n_frames)
            places[start:stop] = self.rows(start, stop, columns)
        return places

    def pack(self, columns: Sequence[int]) -> WovenRecording:
        """Return the same without anything of what was recorded but what is seen.

        Parameters
        ----------
        columns : sequence of int
            Trajectories that are kept in one array, in this order, for `gather_to_fill`. Of these
            a sample without all three coordinates is not seen.
        """
        places, paths = self.gather(columns), list(self.paths)
        for column, path in enumerate(paths):
            if column not in columns:
                paths[column] = tuple(part for piece in path for part in piece.seen_parts())
        for k, column in enumerate(columns):
            runs = find_runs(by_rows(find_seen, places[:, k])).tolist()
            paths[column] = tuple(
                TrajectoryPiece(start, places[start:stop, k]) for start, stop in runs
            )
        packed = WovenRecording(self.frames, self.names, paths, self.orientations)
        packed._packed = tuple(columns), places
        return packed

    def gather_to_fill(self, columns: Sequence[int]) -> FloatArray:
        """Return places as `gather` does, to be written to where nothing is seen.

        Of those that were packed in this order it is their array itself, once: between the pieces
        of trajectories nobody looks at it.
        """
        packed, self._packed = self._packed, None
        if packed is None or packed[0] != tuple(columns):
            self._packed = packed
            return self.gather(columns)
        return packed[1]

    def whole(self) -> Recording:
        """Return the recording with all its trajectories put together."""
        return Recording(
            time=self.time,
            positions=hand_over(self.gather(range(len(self.paths)))),
            names=self.names,
            rate_hz=self.rate_hz,
            source=self.source,
            first_frame=self.first_frame,
            orientations=self.orientations,
            origin=self.frames.origin,
        )

    def _pieces_in(self, start: int, stop: int) -> list[int]:
        """Return which pieces have samples in these rows, in their order."""
        found: list[int] = np.flatnonzero((self._start < stop) & (self._stop > start)).tolist()
        return found


def weave_names(
    recording: Recording, decisions: Sequence[NameDecision], markers: Sequence[str]
) -> tuple[WovenRecording, dict[int, int]]:
    """Put the markers first, then what is left of the trajectories, as it is called.

    Parameters
    ----------
    recording : Recording
    decisions : sequence of NameDecision
        Of its fragments.
    markers : sequence of str
        Those that a name was given for.

    Returns
    -------
    WovenRecording
    dict of int to int
        Where the trajectories that have something left now stand, by where they stood.
    """
    positions, n_frames = recording.positions, len(recording.time)
    named: dict[str, list[TrajectoryPiece]] = {marker: [] for marker in markers}
    taken: dict[int, list[tuple[int, int]]] = {}
    for one in decisions:
        if one.named:
            samples = positions[one.start : one.stop, one.trajectory]
            named[one.marker].append(TrajectoryPiece(one.start, samples))
            taken.setdefault(one.trajectory, []).append((one.start, one.stop))
    left = LeftOver(recording, decisions)
    rests = []
    for column in left.columns:
        ends = [(0, 0), *sorted(taken.get(column, ())), (n_frames, n_frames)]
        rests.append(
            tuple(
                TrajectoryPiece(start, positions[start:stop, column])
                for (_, start), (stop, _) in pairwise(ends)
                if stop > start
            )
        )
    paths = [*(tuple(pieces) for pieces in named.values()), *rests]
    places = {column: len(markers) + k for k, column in enumerate(left.columns)}
    return WovenRecording(recording, (*markers, *left.names), paths), places
