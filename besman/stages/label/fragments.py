"""Trajectory fragments: what the cameras saw without a break, and how far apart they were."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

# A pair of fragments is compared at no more instants than this, so that cost is linear in time.
_MAX_SAMPLES = 48


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
        Positions of all fragments one after the other, metres, laboratory frame.
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
        positions: FloatArray = self.samples[self.offset[fragment] + frame - self.start[fragment]]
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
    seen = np.isfinite(positions).all(axis=2)
    edges = np.zeros((n_frames + 1, seen.shape[1]), dtype=np.int8)
    edges[:-1] = seen
    edges[1:] -= seen
    column, start = np.nonzero(edges.T == 1)
    _, stop = np.nonzero(edges.T == -1)
    order = np.lexsort((column, start))
    start, stop, column = start[order], stop[order], column[order]
    length = stop - start
    offset = np.concatenate(([0], np.cumsum(length)))
    owner = np.repeat(np.arange(len(start)), length)
    frame = np.arange(offset[-1]) - offset[owner] + start[owner]
    return Fragments(
        start, stop, column, offset[:-1], positions[frame, column[owner]], n_frames, rate_hz
    )


def _sum_distances_plain(
    first: IntArray,
    second: IntArray,
    start: IntArray,
    stop: IntArray,
    offset: IntArray,
    samples: FloatArray,
    stride: int,
) -> tuple[FloatArray, FloatArray]:
    """Return mean and variance of the distance of each pair; compiled below."""
    mean = np.empty(len(first))
    variance = np.empty(len(first))
    for pair in range(len(first)):
        i, j = first[pair], second[pair]
        begin = max(start[i], start[j])
        common = min(stop[i], stop[j]) - begin
        n = min(common, max(4, min(_MAX_SAMPLES, common // stride)))
        row_i = offset[i] + begin - start[i]
        row_j = offset[j] + begin - start[j]
        total = 0.0
        squares = 0.0
        for k in range(n):
            frame = (2 * k + 1) * common // (2 * n)
            square = 0.0
            for axis in range(3):
                square += (samples[row_i + frame, axis] - samples[row_j + frame, axis]) ** 2
            squares += square
            total += square**0.5
        mean[pair] = total / n
        variance[pair] = max(squares / n - mean[pair] ** 2, 0.0)
    return mean, variance


@cache
def _compile_kernel() -> Callable[..., tuple[FloatArray, FloatArray]]:
    """Compile the loop over pairs; numba is only loaded when it is needed."""
    import numba

    compiled: Callable[..., tuple[FloatArray, FloatArray]] = numba.njit(cache=True)(
        _sum_distances_plain
    )
    return compiled


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
    mean, variance = _compile_kernel()(
        first,
        second,
        fragments.start,
        fragments.stop,
        fragments.offset,
        fragments.samples,
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
