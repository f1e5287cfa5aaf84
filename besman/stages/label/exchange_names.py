"""Exchange of two names over whole stretches: which of two alike markers is which."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import FragmentPairs, Fragments
from besman.stages.label.model import MarkerModel
from besman.stages.label.scores import (
    EndCompany,
    FragmentEnds,
    ScoreWeights,
    measure_company,
    measure_link,
    observations,
    score_distances,
)

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_HELD = 1e3  # log likelihood ratio against an exchange that must not be
_MOST_ORDER = 8.0  # log likelihood ratio that one observed order of distances may reach


def exchange_names(
    fragments: Fragments,
    pairs: FragmentPairs,
    ends: FragmentEnds,
    labels: IntArray,
    model: MarkerModel,
    weights: ScoreWeights,
    held: npt.NDArray[np.bool_] | None = None,
) -> tuple[IntArray, FloatArray]:
    """Exchange the names of alike markers where a whole stretch is explained better.

    Changing one fragment at a time cannot undo an exchange that lasts over many fragments. For
    each pair of alike markers the recording falls into stretches that can only be exchanged as a
    whole; the best sequence of kept and exchanged stretches is found by dynamic programming.

    Parameters
    ----------
    fragments, pairs, ends
        Fragments, their distances and ends.
    labels : int array, shape (N,)
        Present names.
    model, weights
        Marker set and what counts how much.
    held : bool array, shape (N,), optional
        Fragments that keep their names, and with them their stretches.

    Returns
    -------
    labels : int array, shape (N,)
        Names.
    margin : array, shape (N,)
        How much worse it is to exchange the stretch a fragment belongs to; infinite for names
        without one alike.
    """
    labels = labels.copy()
    margin = np.full(len(labels), np.inf)
    members = [np.flatnonzero(labels == marker) for marker in range(model.n_markers)]
    company = measure_company(fragments, ends, members)
    for a, b in model.alike:
        both = np.flatnonzero((labels == a) | (labels == b))
        if len(both) < 2:
            continue
        reach = np.maximum.accumulate(fragments.stop[both])
        stretch = np.cumsum(np.concatenate(([0], fragments.start[both[1:]] >= reach[:-1])))
        named = np.isin(labels, (a, b))
        edges = np.flatnonzero(named[pairs.first] & ~named[pairs.second])
        score = score_distances(pairs, labels, model, weights, len(labels), edges)
        exchange = np.zeros(stretch[-1] + 1)
        np.add.at(exchange, stretch, score[both, a + b - labels[both]] - score[both, labels[both]])
        exchange -= _measure_order(pairs, labels, both, stretch, int(a), int(b), model, weights)
        if held is not None:
            exchange[stretch[held[both]]] = -_HELD
        same, other = _measure_stretch_links(
            fragments, ends, company, labels, both, stretch, int(a), int(b), model, weights
        )
        exchanged, worse = _find_best_states(exchange, same, other)
        chosen = both[exchanged[stretch]]
        labels[chosen] = a + b - labels[chosen]
        margin[both] = np.minimum(margin[both], worse[stretch])
    return labels, margin


def _measure_order(
    pairs: FragmentPairs,
    labels: IntArray,
    both: IntArray,
    stretch: IntArray,
    a: int,
    b: int,
    model: MarkerModel,
    weights: ScoreWeights,
) -> FloatArray:
    """Return the evidence for the present names from which of the two is nearer to a third."""
    place = np.full(len(labels), -1, dtype=np.int64)
    place[both] = stretch
    evidence = np.zeros(stretch[-1] + 1)
    tuples = np.flatnonzero((model.swaps[:, :2] == (a, b)).all(axis=1))
    turned = np.flatnonzero((model.swaps[:, :2] == (b, a)).all(axis=1))
    sign = np.concatenate((np.ones(len(tuples)), -np.ones(len(turned))))
    tuples = np.concatenate((tuples, turned))
    for k, turn in zip(tuples, sign, strict=True):
        edge = np.flatnonzero(
            (place[pairs.first] >= 0) & (labels[pairs.second] == model.swaps[k, 2])
        )
        where, is_a = place[pairs.first[edge]], labels[pairs.first[edge]] == a
        time = np.stack(
            [
                np.bincount(where, pairs.overlap_s[edge] * chosen, len(evidence))
                for chosen in (is_a, ~is_a)
            ]
        )
        way = np.stack(
            [
                np.bincount(where, pairs.overlap_s[edge] * pairs.mean[edge] * chosen, len(evidence))
                for chosen in (is_a, ~is_a)
            ]
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            excess = np.nan_to_num(way[0] / time[0] - way[1] / time[1])
        pull = 2.0 * turn * model.excess[k] * excess / model.excess_spread[k] ** 2
        count = observations(time.min(axis=0), weights)
        evidence += np.clip(pull, -_MOST_ORDER, _MOST_ORDER) * count
    return evidence / max(len(tuples), 1)


def _measure_stretch_links(
    fragments: Fragments,
    ends: FragmentEnds,
    company: EndCompany,
    labels: IntArray,
    both: IntArray,
    stretch: IntArray,
    a: int,
    b: int,
    model: MarkerModel,
    weights: ScoreWeights,
) -> tuple[FloatArray, FloatArray]:
    """Score each step from stretch to stretch if both are in one state, or in different ones."""
    n = stretch[-1] + 1
    first = np.full((n, 2), -1, dtype=np.int64)
    last = first.copy()
    side = (labels[both] == b).astype(int)
    last[stretch, side] = both
    first[stretch[::-1], side[::-1]] = both[::-1]
    totals = np.zeros((2, n - 1))
    for state in range(2):
        for start in range(2):
            origin, target = last[:-1, start], first[1:, start ^ state]
            step = np.flatnonzero((origin >= 0) & (target >= 0))
            # Either marker may be meant; the mean of both hypotheses keeps the two states fair.
            for marker in (a, b):
                totals[state, step] += 0.5 * measure_link(
                    fragments, ends, company, origin[step], target[step],
                    marker, model, weights, (a, b),
                )  # fmt: skip
    return totals[0], totals[1]


def _find_best_states(
    exchange: FloatArray, same: FloatArray, other: FloatArray
) -> tuple[npt.NDArray[np.bool_], FloatArray]:
    """Find the best sequence of kept (False) and exchanged (True) stretches.

    Returns
    -------
    states : bool array, shape (n,)
        The sequence of greatest score.
    margin : array, shape (n,)
        By how much the best sequence with a stretch in its other state is worse.
    """
    n = len(exchange)
    own = np.stack((np.zeros(n), exchange), axis=1)
    step = np.stack((same, other, other, same), axis=1).reshape(-1, 2, 2)
    ahead, behind = own.copy(), own.copy()
    for k in range(1, n):
        ahead[k] += (ahead[k - 1][:, None] + step[k - 1]).max(axis=0)
        behind[n - 1 - k] += (step[n - 1 - k] + behind[n - k]).max(axis=1)
    best = ahead + behind - own
    return best[:, 1] > best[:, 0], np.abs(best[:, 1] - best[:, 0])
