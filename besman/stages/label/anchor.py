"""Names at one instant, found without knowing any: beam search over the fragments seen then."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import FragmentPairs, Fragments
from besman.stages.label.model import MarkerModel, signed_volumes
from besman.stages.label.scores import GHOST, ScoreWeights, log_t1, observations

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

HIDDEN = -1
_HIDDEN_COST = 2.0
_LEAST_SIDE = -8.0  # a single wrong handedness or order never speaks more strongly


@dataclass(frozen=True, eq=False)
class Anchor:
    """A named instant.

    Attributes
    ----------
    frame : int
        Where.
    labels : int array, shape (N,)
        Marker of each fragment seen then, `GHOST` for all others.
    score : float
        Log likelihood ratio of the best explanation.
    """

    frame: int
    labels: IntArray
    score: float


def choose_anchor_frames(fragments: Fragments, n_markers: int, n_anchors: int) -> IntArray:
    """Choose instants at which many fragments live long, one in each stretch of the recording.

    Returns
    -------
    int array, shape (n_anchors,)
        Frames, those with most to see first.
    """
    worth = np.minimum(fragments.n_samples / fragments.rate_hz, 2.0) + 0.2
    steps = np.zeros(fragments.n_frames + 1)
    np.add.at(steps, fragments.start, worth)
    np.add.at(steps, fragments.stop, -worth)
    total = np.cumsum(steps)[:-1]
    bounds = np.linspace(0, fragments.n_frames, n_anchors + 1).astype(int)
    frames = np.array(
        [
            begin + int(np.argmax(total[begin:end]))
            for begin, end in pairwise(bounds.tolist())
            if end > begin
        ]
    )
    return frames[np.argsort(-total[frames], kind="stable")]


def find_anchor(
    fragments: Fragments,
    pairs: FragmentPairs,
    model: MarkerModel,
    weights: ScoreWeights,
    frame: int,
    beam: int = 100,
    n_spare: int = 12,
) -> Anchor:
    """Name the fragments seen at one frame by distances, handedness and order.

    Parameters
    ----------
    fragments, pairs
        Fragments and their distances.
    model : MarkerModel
        Marker set.
    weights : ScoreWeights
        What counts how much.
    frame : int
        Where to look.
    beam : int
        Partial explanations kept.
    n_spare : int
        Fragments looked at beyond the number of markers; the longest are taken.

    Returns
    -------
    Anchor
        Names of the fragments seen then.
    """
    alive = np.flatnonzero((fragments.start <= frame) & (frame < fragments.stop))
    order = np.argsort(-fragments.n_samples[alive], kind="stable")
    alive = np.sort(alive[order[: model.n_markers + n_spare]])
    mean, variance, count = _dense_pairs(pairs, alive, weights)
    places = fragments.position(alive, np.full(len(alive), frame))
    chosen, score = _search_beam(mean, variance, count, places, model, weights.least_fit, beam)
    labels = np.full(fragments.n_fragments, GHOST, dtype=np.int64)
    named = np.flatnonzero(chosen != HIDDEN)
    labels[alive[chosen[named]]] = named
    return Anchor(frame, labels, score)


def _dense_pairs(
    pairs: FragmentPairs, alive: IntArray, weights: ScoreWeights
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean, variance and weight of the distances of fragments seen together, (K, K)."""
    mean = np.zeros((len(alive), len(alive)))
    variance, overlap = mean.copy(), mean.copy()
    for k, fragment in enumerate(alive):
        edge = slice(pairs.row[fragment], pairs.row[fragment + 1])
        second = pairs.second[edge]
        place = np.minimum(np.searchsorted(alive, second), len(alive) - 1)
        hit = alive[place] == second
        mean[k, place[hit]] = pairs.mean[edge][hit]
        variance[k, place[hit]] = pairs.variance[edge][hit]
        overlap[k, place[hit]] = pairs.overlap_s[edge][hit]
    return mean, variance, observations(overlap, weights)


def _order_markers(model: MarkerModel, weight: FloatArray) -> IntArray:
    """Order markers so that each is well tied to those before it."""
    tie = -weight * np.log(model.spread)
    np.fill_diagonal(tie, -np.inf)
    order = [int(place) for place in np.unravel_index(int(tie.argmax()), tie.shape)]
    rest = [m for m in range(model.n_markers) if m not in order]
    while rest:
        total = np.maximum(tie[rest][:, order], 0.0).sum(axis=1)
        order.append(rest.pop(int(total.argmax())))
    return np.array(order, dtype=np.int64)


def _fit_distances(
    mean: FloatArray,
    variance: FloatArray,
    count: FloatArray,
    model: MarkerModel,
    weight: FloatArray,
    least_fit: float,
) -> FloatArray:
    """Return how well two markers fit two fragments, (M, M, K, K + 1); the last K is hidden."""
    distance, spread = model.distance[:, :, None, None], model.spread[:, :, None, None]
    squared = ((mean - distance) ** 2 + variance) / spread**2
    fit = np.maximum(log_t1(squared, np.log(spread)), least_fit) * count * weight[:, :, None, None]
    return np.pad(fit, ((0, 0), (0, 0), (0, 0), (0, 1)))


def _search_beam(
    mean: FloatArray,
    variance: FloatArray,
    count: FloatArray,
    places: FloatArray,
    model: MarkerModel,
    least_fit: float,
    beam: int,
) -> tuple[IntArray, float]:
    """Return the fragment (K) of each marker, `HIDDEN` for none, and the score."""
    n_fragments = len(places)
    weight = np.maximum(model.weight, model.weight.T)
    order = _order_markers(model, weight)
    rank = np.argsort(order)
    fit = _fit_distances(mean, variance, count, model, weight, least_fit)
    chosen = np.full((1, model.n_markers), HIDDEN, dtype=np.int64)
    score = np.zeros(1)
    for step, marker in enumerate(order):
        gain = np.zeros((len(chosen), n_fragments + 1))
        gain[:, -1] = -_HIDDEN_COST
        for other in order[:step]:
            gain[:, :-1] += np.take(fit[marker, other], chosen[:, other], axis=1).T
        taken = np.where(chosen == HIDDEN, n_fragments, chosen)
        used = np.zeros((len(chosen), n_fragments + 1), dtype=bool)
        np.put_along_axis(used, taken, True, axis=1)
        gain[:, :-1][used[:, :-1]] = -np.inf
        total = score[:, None] + gain
        # The first two markers span all pairs, otherwise the beam could lose the right one early.
        width = total.size if step < 2 else 4 * beam
        best = np.argsort(-total, axis=None, kind="stable")[:width]
        best = best[np.isfinite(total.flat[best])]
        state, fragment = np.unravel_index(best, total.shape)
        chosen = chosen[state]
        chosen[:, marker] = np.where(fragment == n_fragments, HIDDEN, fragment)
        score = total[state, fragment] + _score_sides(chosen, marker, rank, mean, places, model)
        kept = np.argsort(-score, kind="stable")[: beam if step >= 2 else None]
        chosen, score = chosen[kept], score[kept]
    return chosen[0], float(score[0])


def _score_sides(
    chosen: IntArray,
    marker: int,
    rank: IntArray,
    mean: FloatArray,
    places: FloatArray,
    model: MarkerModel,
) -> FloatArray:
    """Score handedness and order of the tuples that `marker` completes, shape (B,)."""
    score = np.zeros(len(chosen))
    quads = np.flatnonzero(rank[model.quads].max(axis=1, initial=-1) == rank[marker])
    if quads.size:
        member = chosen[:, model.quads[quads]]
        volume = signed_volumes(places, np.maximum(member, 0).reshape(-1, 4))
        pull = 2.0 * model.volume[quads] * volume.reshape(len(chosen), -1)
        _add_sides(score, member, pull / model.volume_spread[quads] ** 2)
    swaps = np.flatnonzero(rank[model.swaps].max(axis=1, initial=-1) == rank[marker])
    if swaps.size:
        member = chosen[:, model.swaps[swaps]]
        a, b, c = np.moveaxis(np.maximum(member, 0), 2, 0)
        pull = 2.0 * model.excess[swaps] * (mean[a, c] - mean[b, c])
        _add_sides(score, member, pull / model.excess_spread[swaps] ** 2)
    return score


def _add_sides(score: FloatArray, member: IntArray, pull: FloatArray) -> None:
    """Add what tuples, fragments (B, Q, ...) with pulls (B, Q), say where all are seen."""
    sides = np.where((member != HIDDEN).all(axis=2), _compare_sides(pull), 0.0)
    # One after the other: the sum's last bits depend on the order.
    for side in sides.T:
        score += side


def _compare_sides(pull: FloatArray) -> FloatArray:
    """Return log of twice the probability of the seen side against its mirror image."""
    log_odds: FloatArray = np.maximum(np.log(2.0) - np.logaddexp(0.0, -pull), _LEAST_SIDE)
    return log_odds
