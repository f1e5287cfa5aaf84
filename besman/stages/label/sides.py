"""Handedness of what was named: a mirror image keeps its distances, not its sides."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import Fragments
from besman.stages.label.model import MarkerModel, signed_volumes
from besman.stages.label.scores import GHOST

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_N_FRAMES = 200  # at which volumes are looked at, spread over the recording
_MOST = 8.0  # log odds that one volume may reach


def weigh_sides(fragments: Fragments, labels: IntArray, model: MarkerModel) -> FloatArray:
    """Weigh whether the markers around each named fragment lie on the sides where they belong.

    A marker set may be nearly its own mirror image, as a person or a cluster of four is. Then
    distances tell its two halves hardly apart, but the volume that four markers span has the other
    sign in the mirror.

    Parameters
    ----------
    fragments : Fragments
    labels : int array, shape (N,)
        Names, `GHOST` for none.
    model : MarkerModel
        Adapted to the person at hand: the less rigid four markers are, the less their volume tells.

    Returns
    -------
    array, shape (N,)
        Mean log odds of the seen sides against their mirror images, over the volumes that the
        fragment is a corner of; 0 where nothing is known.
    """
    total, count = np.zeros(len(labels)), np.zeros(len(labels))
    if not len(model.quads):
        return total
    frames = np.unique(np.linspace(0, fragments.n_frames - 1, _N_FRAMES).astype(np.int64))
    holder = _find_holders(fragments, labels, model.n_markers, frames)
    there = np.maximum(holder, 0)
    inside = np.clip(
        frames[:, None], fragments.start[there], np.maximum(fragments.stop[there] - 1, 0)
    )
    places = fragments.position(there, inside)
    places[holder < 0] = np.nan
    volume = signed_volumes(places, model.quads)
    spread = np.hypot(model.volume_spread, _volume_spread(model))
    with np.errstate(invalid="ignore"):
        odds = np.clip(2.0 * model.volume * volume / spread**2, -_MOST, _MOST)
    seen = np.isfinite(odds)
    for corner in model.quads.T:
        fragment = holder[:, corner][seen]
        total += np.bincount(fragment, odds[seen], len(labels))
        count += np.bincount(fragment, minlength=len(labels))
    return total / np.maximum(count, 1.0)


def _find_holders(
    fragments: Fragments, labels: IntArray, n_markers: int, frames: IntArray
) -> IntArray:
    """Return the fragment of each marker at some frames, shape (F, M); -1 where it is hidden."""
    holder = np.full((len(frames), n_markers), -1, dtype=np.int64)
    for fragment in np.flatnonzero(labels != GHOST):
        first, last = np.searchsorted(frames, (fragments.start[fragment], fragments.stop[fragment]))
        holder[first:last, labels[fragment]] = fragment
    return holder


def _volume_spread(model: MarkerModel) -> FloatArray:
    """Return by how much the volumes change while distances do, shape (Q,), cubic metres."""
    a, b, c, d = model.quads.T
    pairs = ((a, b), (a, c), (a, d), (b, c), (b, d), (c, d))
    loose = np.max([model.spread[i, j] / model.distance[i, j] for i, j in pairs], axis=0)
    size = model.distance[a, b] * model.distance[a, c] * model.distance[a, d]
    spread: FloatArray = loose * size
    return spread
