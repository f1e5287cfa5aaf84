"""Names at one instant, found without knowing any: beam search over the fragments seen then."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import FragmentPairs, Fragments
from besman.stages.label.model import MarkerModel, corner_volumes
from besman.stages.label.scores import ScoreWeights, log_t1, observations

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

HIDDEN = -1
_HIDDEN_COST = 2.0
_LEAST_SIDE = -8.0  # a single wrong handedness or order never speaks more strongly
# Pulls from which on the least side is meant, and from which on log 2 is, to the last bit.
_SURE_PULL = (-8.7, 38.0)


@dataclass(frozen=True, eq=False)
class Anchor:
    """A named instant.

    Attributes
    ----------
    frame : int
        Where.
    fragments, markers : int array, shape (A,)
        Fragments seen then that have a name, and the marker that each is.
    score : float
        Log likelihood ratio of the best explanation.
    """

    frame: int
    fragments: IntArray
    markers: IntArray
    score: float


def choose_anchor_frames(fragments: Fragments, n_markers: int, n_anchors: int) -> IntArray:
    """Choose instants at which many fragments live long, one in each stretch of the recording.

    Returns
    -------
    int array, shape (n_anchors,)
        Frames, those with most to see first; fewer where a stretch shows nothing at all.
    """
    worth = np.minimum(fragments.n_samples / fragments.rate_hz, 2.0) + 0.2
    steps = np.zeros(fragments.n_frames + 1)
    np.add.at(steps, fragments.start, worth)
    np.add.at(steps, fragments.stop, -worth)
    total = np.cumsum(steps)[:-1]
    seen = np.zeros(fragments.n_frames + 1, dtype=int)
    np.add.at(seen, fragments.start, 1)
    np.add.at(seen, fragments.stop, -1)
    total[np.cumsum(seen)[:-1] == 0] = 0.0
    bounds = np.linspace(0, fragments.n_frames, n_anchors + 1).astype(int)
    frames = np.array(
        [
            begin + int(np.argmax(total[begin:end]))
            for begin, end in pairwise(bounds.tolist())
            if end > begin
        ],
        dtype=int,
    )
    frames = frames[total[frames] > 0.0]
    chosen: IntArray = frames[np.argsort(-total[frames], kind="stable")]
    return chosen


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
    named = np.flatnonzero(chosen != HIDDEN)
    return Anchor(frame, alive[chosen[named]], named, score)


def _dense_pairs(
    pairs: FragmentPairs, alive: IntArray, weights: ScoreWeights
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean, variance and weight of the distances of fragments seen together, (K, K)."""
    mean = np.zeros((len(alive), len(alive)))
    variance, overlap = mean.copy(), mean.copy()
    begin, end = pairs.row[alive], pairs.row[alive + 1]
    edges = np.concatenate([np.arange(*bounds) for bounds in zip(begin, end, strict=True)])
    second = pairs.second[edges]
    place = np.minimum(np.searchsorted(alive, second), len(alive) - 1)
    hit = np.flatnonzero(alive[place] == second)
    at, edges = (np.repeat(np.arange(len(alive)), end - begin)[hit], place[hit]), edges[hit]
    mean[at] = pairs.mean[edges]
    variance[at] = pairs.variance[edges]
    overlap[at] = pairs.overlap_s[edges]
    return mean, variance, observations(overlap, weights)


class _Step(NamedTuple):
    """What the search looks at when it gives one more marker.

    Attributes
    ----------
    marker : int
    pairs : slice
        Where those of this marker are in `_Plan.pairs`.
    others : int array
        Markers that were given before it.
    quads, swaps : int array
        Which of the model's tuples it completes.
    """

    marker: int
    pairs: slice
    others: IntArray
    quads: IntArray
    swaps: IntArray


class _Plan(NamedTuple):
    """In which order a model's markers are given.

    Attributes
    ----------
    steps : tuple of _Step
    pairs : int array, shape (P, 2)
        Each step's marker with all before it, step after step.
    weight : array, shape (M, M)
        Of the markers' distances.
    """

    steps: tuple[_Step, ...]
    pairs: IntArray
    weight: FloatArray


@lru_cache(maxsize=2)
def _plan_search(model: MarkerModel) -> _Plan:
    """Order markers so that each is well tied to those before it; the same for all instants."""
    weight = np.maximum(model.weight, model.weight.T)
    tie = -weight * np.log(model.spread)
    np.fill_diagonal(tie, -np.inf)
    order = [int(place) for place in np.unravel_index(int(tie.argmax()), tie.shape)]
    rest = [m for m in range(model.n_markers) if m not in order]
    while rest:
        total = np.maximum(tie[rest][:, order], 0.0).sum(axis=1)
        order.append(rest.pop(int(total.argmax())))
    rank = np.argsort(order)
    of_quads = rank[model.quads].max(axis=1, initial=-1)
    of_swaps = rank[model.swaps].max(axis=1, initial=-1)
    steps = [
        _Step(
            marker,
            slice(k * (k - 1) // 2, k * (k + 1) // 2),
            np.array(order[:k], dtype=np.int64),
            np.flatnonzero(of_quads == k),
            np.flatnonzero(of_swaps == k),
        )
        for k, marker in enumerate(order)
    ]
    pairs = [(marker, other) for k, marker in enumerate(order) for other in order[:k]]
    return _Plan(tuple(steps), np.array(pairs, dtype=np.int64).reshape(-1, 2), weight)


def _fit_distances(
    mean: FloatArray,
    variance: FloatArray,
    count: FloatArray,
    model: MarkerModel,
    plan: _Plan,
    least_fit: float,
) -> FloatArray:
    """Return how well pairs of markers, (P, 2), fit two fragments, (P, K + 1, K).

    The first marker is the second fragment; the other one is hidden if its fragment is the last.
    """
    pairs, weight = plan.pairs, plan.weight
    n = len(mean)
    fit = np.zeros((len(pairs), n + 1, n))
    # Distances are the same both ways, and most of the time goes into their logarithms.
    i, j = np.triu_indices(n)
    distance, spread, weight = (
        table[pairs[:, 0], pairs[:, 1], None] for table in (model.distance, model.spread, weight)
    )
    squared = ((mean[i, j] - distance) ** 2 + variance[i, j]) / spread**2
    some = np.maximum(log_t1(squared, np.log(spread)), least_fit) * count[i, j] * weight
    fit[:, i, j] = some
    fit[:, j, i] = some
    return fit


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
    plan = _plan_search(model)
    fit = _fit_distances(mean, variance, count, model, plan, least_fit)
    # Markers by partial explanations: what is looked at together lies side by side.
    chosen = np.full((model.n_markers, 1), HIDDEN, dtype=np.int64)
    score, planes = np.zeros(1), np.ascontiguousarray(places.T)
    for number, step in enumerate(plan.steps):
        gain = np.zeros((chosen.shape[1], n_fragments + 1))
        gain[:, -1] = -_HIDDEN_COST
        taken = chosen[step.others]
        gain[:, :-1] = fit[step.pairs][np.arange(number)[:, None], taken].sum(axis=0)
        # What is hidden is taken any number of times.
        hidden = gain[:, -1].copy()
        gain[np.arange(len(gain)), taken] = -np.inf
        gain[:, -1] = hidden
        total = score[:, None] + gain
        # The first two markers span all pairs, otherwise the beam could lose the right one early.
        width = total.size if number < 2 else 4 * beam
        best = np.argsort(-total, axis=None, kind="stable")[:width]
        best = best[np.isfinite(total.flat[best])]
        state, fragment = np.divmod(best, n_fragments + 1)
        chosen = chosen[:, state]
        chosen[step.marker] = np.where(fragment == n_fragments, HIDDEN, fragment)
        score = total[state, fragment] + _score_sides(chosen, step, mean, planes, model)
        kept = np.argsort(-score, kind="stable")[: beam if number >= 2 else None]
        chosen, score = chosen[:, kept], score[kept]
    return chosen[:, 0], float(score[0])


def _score_sides(
    chosen: IntArray, step: _Step, mean: FloatArray, planes: FloatArray, model: MarkerModel
) -> FloatArray:
    """Score handedness and order of the tuples that a marker completes, shape (B,)."""
    pulls, members = [], []
    if step.quads.size:
        member = chosen[model.quads[step.quads].T]
        # What is hidden counts for nothing, wherever the last fragment is.
        volume = corner_volumes(np.take(planes, member, axis=1))
        pull = 2.0 * model.volume[step.quads, None] * volume
        pulls.append(pull / model.volume_spread[step.quads, None] ** 2)
        members.append(member)
    if step.swaps.size:
        member = chosen[model.swaps[step.swaps].T]
        a, b, c = member
        pull = 2.0 * model.excess[step.swaps, None] * (mean[a, c] - mean[b, c])
        pulls.append(pull / model.excess_spread[step.swaps, None] ** 2)
        members.append(member)
    if not pulls:
        return np.zeros(chosen.shape[1])
    seen = np.concatenate([(member != HIDDEN).all(axis=0) for member in members])
    # One tuple after the other: the sum's last bits depend on the order.
    return np.asarray(_compare_sides(np.concatenate(pulls), seen).sum(axis=0))


def _compare_sides(pull: FloatArray, seen: BoolArray) -> FloatArray:
    """Return log of twice the probability of the seen side against its mirror image.

    It is 0 of what is not seen.
    """
    # Beyond these the logarithm has not a bit more to say, and it takes most of the time.
    sides = np.where(pull > 0.0, np.log(2.0), _LEAST_SIDE)
    near = np.flatnonzero(seen & ~(pull >= _SURE_PULL[1]) & ~(pull <= _SURE_PULL[0]))
    odds = np.log(2.0) - np.logaddexp(0.0, -pull.flat[near])
    sides.flat[near] = np.maximum(odds, _LEAST_SIDE)
    sides[~seen] = 0.0
    return sides
