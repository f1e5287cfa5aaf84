"""Trajectory fragments: what the cameras saw without a break, and how far apart they were."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.geometry.gaps import find_seen
from besman.geometry.row_blocks import by_rows
from besman.stages.label.pair_distances import average_distances

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Fragments:
    """Unbroken pieces of trajectories, sorted by their first frame.

    Attributes
    ----------
    start, stop : int array, shape (N,)
        Half-open range of frames.
    column : int array, shape (N,)
        Trajectory of the recording that the fragment was cut from.
    offset : int array, shape (N,)
        Row of the fragment's first sample in `samples`.
    samples : array, shape (S, 3)
        The positions that the fragments are pieces of, metres, laboratory frame: frame after frame.
    step : int
        Rows from one sample of a fragment to the next.
    n_frames : int
        Length of the recording.
    rate_hz : float
        Frames per second.
    """

    start: IntArray
    stop: IntArray
    column: IntArray
    offset: IntArray
    samples: FloatArray
    step: int
    n_frames: int
    rate_hz: float

    @property
    def n_fragments(self) -> int:
        """Number of fragments."""
        return len(self.start)

    @property
    def n_samples(self) -> IntArray:
        """Number of samples of each fragment, shape (N,)."""
        return self.stop - self.start

    def position(self, fragment: IntArray, frame: IntArray) -> FloatArray:
        """Return the positions of fragments at frames inside them, shape (..., 3), metres."""
        after = frame - self.start[fragment]
        positions: FloatArray = self.samples[self.offset[fragment] + self.step * after]
        return positions


@dataclass(frozen=True, eq=False)
class FragmentPairs:
    """Distances of every two fragments that are seen at one time; each pair occurs both ways.

    Attributes
    ----------
    first, second : int array, shape (E,)
        The two fragments; sorted by `first`.
    row : int array, shape (N + 1,)
        Pairs of fragment ``f`` are ``row[f]:row[f + 1]``.
    mean, variance : array, shape (E,)
        Of their distance over the common frames, metres and metres squared.
    overlap_s : array, shape (E,)
        Common time, seconds.
    """

    first: IntArray
    second: IntArray
    row: IntArray
    mean: FloatArray
    variance: FloatArray
    overlap_s: FloatArray


def split_fragments(positions: FloatArray, rate_hz: float) -> Fragments:
    """Cut trajectories at every gap.

    Parameters
    ----------
    positions : array, shape (T, C, 3)
        Trajectories, NaN where not seen, metres.
    rate_hz : float
        Frames per second.

    Returns
    -------
    Fragments
        Sorted by first frame, then by trajectory.
    """
    n_frames = len(positions)
    seen = by_rows(find_seen, positions)
    edges = np.zeros((n_frames + 1, seen.shape[1]), dtype=np.int8)
    edges[:-1] = seen
    edges[1:] -= seen
    column, start = np.nonzero(edges.T == 1)
    _, stop = np.nonzero(edges.T == -1)
    order = np.lexsort((column, start))
    start, stop, column = start[order], stop[order], column[order]
    # Of an hour they have hundreds of megabytes, so that no sample is copied.
    n_columns = positions.shape[1]
    samples = np.ascontiguousarray(positions).reshape(-1, 3)
    offset = start * n_columns + column
    return Fragments(start, stop, column, offset, samples, n_columns, n_frames, rate_hz)


def measure_pairs(fragments: Fragments, stride_s: float = 0.05) -> FragmentPairs:
    """Measure the distances of all fragments that share a frame.

    Parameters
    ----------
    fragments : Fragments
        Sorted by first frame.
    stride_s : float
        Time between two compared instants, seconds.

    Returns
    -------
    FragmentPairs
        Both ways round, sorted by the first of the two.
    """
    n = fragments.n_fragments
    index = np.arange(n)
    n_later = np.searchsorted(fragments.start, fragments.stop, side="left") - index - 1
    first = np.repeat(index, n_later)
    within = np.arange(len(first)) - np.repeat(np.cumsum(n_later) - n_later, n_later)
    second = first + 1 + within
    mean, variance = average_distances(
        first,
        second,
        fragments.start,
        fragments.stop,
        fragments.offset,
        fragments.samples,
        fragments.step,
        max(1, round(stride_s * fragments.rate_hz)),
    )
    overlap = np.minimum(fragments.stop[first], fragments.stop[second]) - fragments.start[second]
    both_first = np.concatenate((first, second))
    order = np.argsort(both_first, kind="stable")
    row = np.searchsorted(both_first[order], np.arange(n + 1))
    return FragmentPairs(
        both_first[order],
        np.concatenate((second, first))[order],
        row,
        np.tile(mean, 2)[order],
        np.tile(variance, 2)[order],
        np.tile(overlap, 2)[order] / fragments.rate_hz,
    )
