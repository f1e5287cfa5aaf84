"""How well a name fits a fragment, given the names of the others: log likelihood ratios."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import FragmentPairs, Fragments
from besman.stages.label.model import EDGE_S, VELOCITY_DECAY_S, MarkerModel

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

GHOST = -1
_DEGREES = 4.0  # of the t distribution: tails heavy enough for a movement never seen before
_LOG_T1 = math.lgamma(2.5) - math.lgamma(2.0) - 0.5 * math.log(_DEGREES * math.pi)
_LOG_T3 = math.lgamma(3.5) - math.lgamma(2.0) - 1.5 * math.log(_DEGREES * math.pi)
_MOST_PACE = 1.5
_CHUNK = 2_000_000  # values in one temporary array, so that memory stays linear in length


@dataclass(frozen=True)
class ScoreWeights:
    """What counts how much. Chosen on recordings of one person, checked on the other.

    Attributes
    ----------
    settle_s : float
        Distances seen this much longer count as one more independent observation.
    max_observations : float
        Most independent observations a pair of fragments can give.
    link : float
        Weight of continuity across a gap.
    ghost_bias : float
        Score a fragment must exceed to be named at all.
    least_link : float
        Continuity never speaks more strongly than this against a name.
    least_fit : float
        One observed distance never speaks more strongly than this against a name: the model may
        know too little of that pair, e.g. when it was learnt while the person stood still.
    """

    settle_s: float = 0.5
    max_observations: float = 3.0
    link: float = 0.8
    ghost_bias: float = 3.0
    least_link: float = -25.0
    least_fit: float = -2.0
    least_pace: float = 0.2


def log_t1(squared: FloatArray, log_spread: FloatArray) -> FloatArray:
    """Return the log density of Student's t for a squared standardised value, in metres."""
    density: FloatArray = (
        _LOG_T1 - log_spread - 0.5 * (_DEGREES + 1.0) * np.log1p(squared / _DEGREES)
    )
    return density


def score_distances(
    pairs: FragmentPairs,
    labels: IntArray,
    model: MarkerModel,
    weights: ScoreWeights,
    n_fragments: int,
    edges: IntArray | None = None,
) -> FloatArray:
    """Score every name of every fragment by its distances to the named fragments seen with it.

    The likelihood of a distance under the model is compared with a density of 1 per metre.

    Parameters
    ----------
    pairs : FragmentPairs
        Distances of fragments.
    labels : int array, shape (N,)
        Present names, `GHOST` for none.
    model : MarkerModel
        Marker set.
    weights : ScoreWeights
        What counts how much.
    n_fragments : int
        N.
    edges : int array, optional
        The pairs that count; all by default.

    Returns
    -------
    array, shape (N, M)
        Log likelihood ratio.
    """
    n_markers = model.n_markers
    score = np.zeros((n_fragments, n_markers))
    log_spread = np.log(model.spread)
    inverse = 1.0 / model.spread**2
    known = np.arange(len(pairs.first)) if edges is None else edges
    known = known[labels[pairs.second[known]] != GHOST]
    size = max(1, _CHUNK // n_markers)
    for begin in range(0, len(known), size):
        edge = known[begin : begin + size]
        other = labels[pairs.second[edge]]
        count = observations(pairs.overlap_s[edge], weights)[:, None]
        gap = (pairs.mean[edge, None] - model.distance[other]) ** 2 + pairs.variance[edge, None]
        fit = log_t1(gap * inverse[other], log_spread[other])
        np.maximum(fit, weights.least_fit, out=fit)
        fit *= count * model.weight.T[other]
        first = pairs.first[edge]
        head = np.flatnonzero(np.diff(first, prepend=-1))
        score[first[head]] += np.add.reduceat(fit, head, axis=0)
    return score


def observations(overlap_s: FloatArray, weights: ScoreWeights) -> FloatArray:
    """Return how many independent observations a common time is worth."""
    return np.minimum(1.0 + overlap_s / weights.settle_s, weights.max_observations)


@dataclass(frozen=True, eq=False)
class FragmentEnds:
    """Positions and velocities where fragments begin and end, shape (N, 3), metres, per frame."""

    first: FloatArray
    last: FloatArray
    first_velocity: FloatArray
    last_velocity: FloatArray


def measure_ends(fragments: Fragments) -> FragmentEnds:
    """Measure the ends of all fragments."""
    index = np.arange(fragments.n_fragments)
    last_frame = fragments.stop - 1
    n_edge = np.minimum(max(1, round(EDGE_S * fragments.rate_hz)), fragments.n_samples - 1)
    first = fragments.position(index, fragments.start)
    last = fragments.position(index, last_frame)
    span = np.maximum(n_edge, 1)[:, None]
    return FragmentEnds(
        first,
        last,
        (fragments.position(index, fragments.start + n_edge) - first) / span,
        (last - fragments.position(index, last_frame - n_edge)) / span,
    )


def score_links(
    fragments: Fragments,
    ends: FragmentEnds,
    labels: IntArray,
    model: MarkerModel,
    weights: ScoreWeights,
) -> FloatArray:
    """Score every name of every fragment by continuity with that marker before and after.

    Two things are compared over the gap: where the marker was expected, and its distances to
    the markers seen on both sides.

    Parameters
    ----------
    fragments, ends
        Fragments and their ends.
    labels : int array, shape (N,)
        Present names.
    model : MarkerModel
        Marker set.
    weights : ScoreWeights
        What counts how much.

    Returns
    -------
    array, shape (N, M)
        Log likelihood ratio; 0 where the marker is not named before or after.
    """
    members = [np.flatnonzero(labels == marker) for marker in range(model.n_markers)]
    company = measure_company(fragments, ends, members)
    score = np.zeros((fragments.n_fragments, model.n_markers))
    for marker, member in enumerate(members):
        if not len(member):
            continue
        before = np.searchsorted(fragments.stop[member], fragments.start, side="right") - 1
        after = np.searchsorted(fragments.start[member], fragments.stop, side="left")
        late = np.flatnonzero(before >= 0)
        early = np.flatnonzero(after < len(member))
        from_fragment = np.concatenate((member[before[late]], early))
        to_fragment = np.concatenate((late, member[after[early]]))
        gain = measure_link(
            fragments, ends, company, from_fragment, to_fragment, marker, model, weights
        )
        np.add.at(score[:, marker], np.concatenate((late, early)), gain)
    return score


@dataclass(frozen=True, eq=False)
class EndCompany:
    """Distances to all named markers where fragments begin and end, (N, M); NaN if hidden."""

    first: FloatArray
    last: FloatArray


def measure_company(
    fragments: Fragments, ends: FragmentEnds, members: list[IntArray]
) -> EndCompany:
    """Measure the distances from the ends of all fragments to the fragments of each marker."""
    return EndCompany(
        _distances_to_named(fragments, members, fragments.start, ends.first),
        _distances_to_named(fragments, members, fragments.stop - 1, ends.last),
    )


def _distances_to_named(
    fragments: Fragments, members: list[IntArray], frame: IntArray, place: FloatArray
) -> FloatArray:
    """Return distances of places at frames to all named markers then, (N, M); NaN if hidden."""
    distance = np.full((len(frame), len(members)), np.nan)
    for marker, member in enumerate(members):
        if not len(member):
            continue
        index = np.searchsorted(fragments.start[member], frame, side="right") - 1
        holder = member[np.maximum(index, 0)]
        seen = np.flatnonzero((index >= 0) & (frame < fragments.stop[holder]))
        there = fragments.position(holder[seen], frame[seen])
        distance[seen, marker] = np.linalg.norm(there - place[seen], axis=1)
    return distance


def measure_link(
    fragments: Fragments,
    ends: FragmentEnds,
    company: EndCompany,
    origin: IntArray,
    target: IntArray,
    marker: int,
    model: MarkerModel,
    weights: ScoreWeights,
    ignored: tuple[int, ...] = (),
) -> FloatArray:
    """Score the hypothesis that two fragments in succession are one marker.

    Parameters
    ----------
    fragments, ends, company
        Fragments, their ends and who is near these.
    origin, target : int array, shape (n,)
        The earlier and the later fragment.
    marker : int
        Which marker they would be.
    model, weights
        Marker set and what counts how much.
    ignored : tuple of int
        Markers whose distances do not count.

    Returns
    -------
    array, shape (n,)
        Weighted log likelihood ratio.
    """
    gap = fragments.start[target] - fragments.stop[origin] + 1
    gap_s = gap / fragments.rate_hz
    lag = np.minimum(np.searchsorted(model.lags_s, gap_s), len(model.lags_s) - 1)
    decay = gap * np.exp(-gap_s / VELOCITY_DECAY_S)
    velocity = 0.5 * (ends.last_velocity[origin] + ends.first_velocity[target])
    error = ends.first[target] - ends.last[origin] - decay[:, None] * velocity
    # A marker at rest on both sides of a gap has hardly moved in it.
    both = np.hypot(
        np.linalg.norm(ends.last_velocity[origin], axis=1),
        np.linalg.norm(ends.first_velocity[target], axis=1),
    ) * (fragments.rate_hz / np.sqrt(2.0))
    pace = np.clip(both / model.speed[marker], weights.least_pace, _MOST_PACE)
    spread = model.jump[lag, marker] * pace + 0.0005
    squared = np.sum(error**2, axis=1) / (_DEGREES * spread**2)
    jump = _LOG_T3 - 3.0 * np.log(spread) - 0.5 * (_DEGREES + 3.0) * np.log1p(squared)
    change = model.change[lag, marker]
    moved = (company.first[target] - company.last[origin]) / change
    # The model's own density of the distance has been counted already.
    fit = log_t1(moved**2, np.log(change)) - (_LOG_T1 - np.log(model.spread[marker]) - 0.5)
    fit[:, [marker, *ignored]] = 0.0
    fit[~np.isfinite(fit)] = 0.0
    gain: FloatArray = 0.5 * jump + fit @ model.weight[marker]
    # What is taken from its place while hidden may come back anywhere: no evidence against.
    least = 0.0 if model.loose[marker] else weights.least_link
    return weights.link * np.maximum(gain, least)
