"""What is known of a marker set before naming: distances, how fast they change, handedness."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

EDGE_S = 0.05  # velocity at the end of a fragment is measured over this time
_LOOSE_M = 0.5
VELOCITY_DECAY_S = 0.3  # a velocity tells less and less of where a marker is after a gap


@dataclass(frozen=True, eq=False)
class MarkerModel:
    """Statistics of a marker set.

    Attributes
    ----------
    markers : tuple of str, length M
        Names.
    distance, spread : array, shape (M, M)
        Mean distance of two markers and its standard deviation, metres.
    lags_s : array, shape (L,)
        Gap lengths for which the two following are known, seconds.
    change : array, shape (L, M, M)
        Root mean square change of a distance over a lag, metres.
    jump : array, shape (L, M)
        Root mean square error per axis of predicting a marker over a lag from the velocities on
        both sides, metres.
    speed : array, shape (M,)
        Root mean square speed of each marker, metres per second.
    weight : array, shape (M, M)
        How much the distance of marker a (row) to marker b counts for naming a. The most rigid
        neighbours count most, because distances to many neighbours are not independent.
    quads : int array, shape (Q, 4)
        Markers a, b, c, d whose handedness is known.
    volume, volume_spread : array, shape (Q,)
        Mean and standard deviation of det(b - a, c - a, d - a), cubic metres.
    swaps : int array, shape (W, 3)
        Markers a, b, c for which ``|a - c| - |b - c|`` tells a from b.
    excess, excess_spread : array, shape (W,)
        Mean and standard deviation of that difference, metres.
    alike : int array, shape (A, 2)
        Pairs of markers that their distances to the others hardly tell apart.
    """

    markers: tuple[str, ...]
    distance: FloatArray
    spread: FloatArray
    lags_s: FloatArray
    change: FloatArray
    jump: FloatArray
    speed: FloatArray
    weight: FloatArray
    quads: IntArray
    volume: FloatArray
    volume_spread: FloatArray
    swaps: IntArray
    excess: FloatArray
    excess_spread: FloatArray
    alike: IntArray

    @property
    def n_markers(self) -> int:
        """Number of markers."""
        return len(self.markers)

    @property
    def loose(self) -> npt.NDArray[np.bool_]:
        """Markers whose distances to no other tell anything, shape (M,)."""
        return np.asarray(~self.weight.any(axis=1))


def weigh_neighbours(spread: FloatArray) -> FloatArray:
    """Weigh the neighbours of each marker by the rank of their rigidity, shape (M, M).

    A distance that takes any value, as to an object that is let go, tells nothing.
    """
    masked = spread + np.where(np.eye(len(spread), dtype=bool), np.inf, 0.0)
    rank = masked.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable")
    weight = 0.5 ** (rank / 3.0)
    weight[spread > _LOOSE_M] = 0.0
    np.fill_diagonal(weight, 0.0)
    return weight


def adapt_marker_model(
    model: MarkerModel, distance: FloatArray, variance: FloatArray, seconds: FloatArray
) -> MarkerModel:
    """Draw the distances of a model towards those seen in the recording at hand.

    Parameters
    ----------
    model : MarkerModel
        What was learnt from another recording.
    distance, variance : array, shape (M, M)
        Mean and variance of the distances seen, metres and metres squared; NaN where none.
    seconds : array, shape (M, M)
        For how long each was seen.

    Returns
    -------
    MarkerModel
        Its spread is that of the recording at hand, no longer that between persons.
    """
    trust = np.where(np.isfinite(distance), seconds / (seconds + 1.0), 0.0)
    seen = np.where(np.isfinite(distance), distance, model.distance)
    own = np.where(np.isfinite(variance), variance, model.spread**2)
    mean = (1 - trust) * model.distance + trust * seen
    least = np.minimum(model.spread, 0.0008 + 0.005 * model.distance)
    between = (1 - trust) * model.spread**2 + trust * own
    spread = np.maximum(np.sqrt(between), least)
    return replace(model, distance=mean, spread=spread, weight=weigh_neighbours(spread))


def signed_volumes(positions: FloatArray, quads: IntArray) -> FloatArray:
    """Return det(b - a, c - a, d - a) of marker quadruples, shape (..., Q), cubic metres."""
    # A coordinate and a corner at a time, so that what is multiplied lies side by side.
    planes = np.ascontiguousarray(np.moveaxis(positions, -1, 0))
    return corner_volumes(np.moveaxis(np.take(planes, quads.T, axis=-1), -2, 1))


def corner_volumes(corners: FloatArray) -> FloatArray:
    """Return det(b - a, c - a, d - a) of corners a, b, c, d, (3, 4, ...): shape (...)."""
    (bx, cx, dx), (by, cy, dy), (bz, cz, dz) = corners[:, 1:] - corners[:, :1]
    # As np.cross and np.sum do it, which take longer to begin than to compute a few hundred.
    volume: FloatArray = (
        (by * cz - bz * cy) * dx + (bz * cx - bx * cz) * dy + (bx * cy - by * cx) * dz
    )
    return volume
