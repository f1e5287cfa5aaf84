"""Recipe that turns a named recording into what cameras deliver: gaps, ghosts, no names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

GHOST = -1


@dataclass(frozen=True)
class DegradeRecipe:
    """How a recording is spoilt.

    Attributes
    ----------
    missing : float
        Share of marker samples missing in the end, what the recording lacks already included.
    ghosts_per_frame : float
        Mean number of ghosts seen in a frame.
    gap_mean_s, gap_max_s : float
        Gaps last an exponentially distributed time, one frame at least.
    shadow : float
        Share of gaps that hide the nearest marker too (the occluder is larger than a marker),
        beginning and ending up to a quarter of the gap's length earlier or later.
    ghost_mean_s, ghost_max_s : float
        Ghosts last an exponentially distributed time, one frame at least.
    ghost_near : float
        Share of ghosts that accompany a marker at `ghost_offset_m`; the others drift slowly
        anywhere in the captured volume.
    ghost_offset_m : tuple of float
        Least and greatest distance from the accompanied marker, metres.
    """

    missing: float
    ghosts_per_frame: float = 0.0
    gap_mean_s: float = 0.25
    gap_max_s: float = 2.0
    shadow: float = 0.3
    ghost_mean_s: float = 0.2
    ghost_max_s: float = 2.0
    ghost_near: float = 0.5
    ghost_offset_m: tuple[float, float] = (0.02, 0.15)


@dataclass(frozen=True, eq=False)
class Degraded:
    """A spoilt recording with its truth.

    Attributes
    ----------
    positions : array, shape (T, C, 3)
        Unnamed trajectories; fragments are packed into columns in shuffled order with at least
        one empty frame between two fragments.
    truth : int array, shape (T, C)
        Index of the marker each sample belongs to, `GHOST` for a ghost or an empty sample.
    """

    positions: FloatArray
    truth: IntArray


def degrade_recording(
    positions: FloatArray, rate_hz: float, recipe: DegradeRecipe, seed: int
) -> Degraded:
    """Add gaps and ghosts, break trajectories at every gap, take the names away.

    Parameters
    ----------
    positions : array, shape (T, M, 3)
        Named markers, NaN where not seen, metres.
    rate_hz : float
        Frames per second.
    recipe : DegradeRecipe
        What to add.
    seed : int
        Of the random generator.

    Returns
    -------
    Degraded
        Unnamed trajectories with truth.
    """
    random = np.random.default_rng(seed)
    spoilt = positions.copy()
    _cut_gaps(spoilt, rate_hz, recipe, random)
    ghosts = _make_ghosts(positions, rate_hz, recipe, random)
    pieces = [
        (begin, spoilt[begin:end, marker], marker)
        for marker in range(spoilt.shape[1])
        for begin, end in _find_runs(np.isfinite(spoilt[:, marker, 0]))
    ]
    pieces += [(begin, track, GHOST) for begin, track in ghosts]
    return _pack_pieces(pieces, len(positions), random)


def _find_runs(seen: npt.NDArray[np.bool_]) -> IntArray:
    """Return the half-open ranges where a flag is set, shape (R, 2)."""
    return np.flatnonzero(np.diff(np.concatenate(([0], seen.astype(np.int8), [0])))).reshape(-1, 2)


def _cut_gaps(
    spoilt: FloatArray, rate_hz: float, recipe: DegradeRecipe, random: np.random.Generator
) -> None:
    """Remove samples in place until the share of the recipe is missing."""
    n_frames, n_markers = spoilt.shape[:2]
    some = spoilt[:: max(1, n_frames // 200)]
    apart = np.nanmedian(np.linalg.norm(some[:, :, None] - some[:, None], axis=-1), axis=0)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.argmin(axis=1)
    missing = int(np.isnan(spoilt[:, :, 0]).sum())
    while missing < recipe.missing * n_frames * n_markers:
        length = min(random.exponential(recipe.gap_mean_s), recipe.gap_max_s)
        n_gap = max(1, round(length * rate_hz))
        begin = int(random.integers(-n_gap + 1, n_frames))
        marker = int(random.integers(n_markers))
        spoilt[max(begin, 0) : max(begin + n_gap, 0), marker] = np.nan
        if random.random() < recipe.shadow:
            early, late = np.round(random.uniform(-0.25, 0.25, 2) * n_gap).astype(int)
            spoilt[max(begin + early, 0) : max(begin + n_gap + late, 0), nearest[marker]] = np.nan
        missing = int(np.isnan(spoilt[:, :, 0]).sum())


def _make_ghosts(
    positions: FloatArray, rate_hz: float, recipe: DegradeRecipe, random: np.random.Generator
) -> list[tuple[int, FloatArray]]:
    """Draw ghost tracks: first frame and positions (n, 3) of each."""
    n_frames, n_markers = positions.shape[:2]
    low, high = np.nanmin(positions, axis=(0, 1)) - 0.1, np.nanmax(positions, axis=(0, 1)) + 0.1
    ghosts: list[tuple[int, FloatArray]] = []
    n_wanted = recipe.ghosts_per_frame * n_frames
    n_made = 0
    while n_made < n_wanted:
        length = min(random.exponential(recipe.ghost_mean_s), recipe.ghost_max_s)
        n = max(1, round(length * rate_hz))
        begin = int(random.integers(-n + 1, n_frames))
        begin, n = max(begin, 0), min(begin + n, n_frames) - max(begin, 0)
        drift = random.normal(0.0, 0.05, 3) * np.arange(n)[:, None] / rate_hz
        marker = int(random.integers(n_markers))
        track = positions[begin : begin + n, marker]
        near = random.random() < recipe.ghost_near and bool(np.isfinite(track).all())
        direction = random.normal(size=3)
        reach = random.uniform(*recipe.ghost_offset_m)
        place = random.uniform(low, high)
        if near:
            place = track + reach * direction / np.linalg.norm(direction)
        jitter = random.normal(0.0, 0.0005, (n, 3))
        ghosts.append((begin, place + drift + jitter))
        n_made += n
    return ghosts


def _pack_pieces(
    pieces: list[tuple[int, FloatArray, int]], n_frames: int, random: np.random.Generator
) -> Degraded:
    """Put each piece into the first free column, then shuffle the columns."""
    pieces = [pieces[k] for k in random.permutation(len(pieces))]
    pieces.sort(key=lambda piece: piece[0])
    column_end: list[int] = []
    columns: list[int] = []
    for begin, track, _ in pieces:
        free = [c for c, end in enumerate(column_end) if end < begin]
        column = free[int(random.integers(len(free)))] if free else len(column_end)
        if not free:
            column_end.append(0)
        column_end[column] = begin + len(track)
        columns.append(column)
    positions = np.full((n_frames, len(column_end), 3), np.nan)
    truth = np.full((n_frames, len(column_end)), GHOST, dtype=np.int64)
    for (begin, track, marker), column in zip(pieces, columns, strict=True):
        positions[begin : begin + len(track), column] = track
        truth[begin : begin + len(track), column] = marker
    shuffled = random.permutation(len(column_end))
    return Degraded(positions[:, shuffled], truth[:, shuffled])
