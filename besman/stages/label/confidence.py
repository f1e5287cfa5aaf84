"""How sure a name is: its lead over the next best explanation, and whether it is credible."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.stages.label.fragments import FragmentPairs
from besman.stages.label.model import MarkerModel
from besman.stages.label.scores import GHOST

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_CONFIDENCE_SLOPE = 0.3
_CONTRADICTION = 0.5  # share of a distance


def measure_plausibility(
    pairs: FragmentPairs, labels: IntArray, model: MarkerModel, n_spreads: float = 4.0
) -> FloatArray:
    """Measure which share of a fragment's distances to named fragments is credible at all.

    The best explanation may be a bad one, when the marker set does not fit the person.

    Parameters
    ----------
    pairs : FragmentPairs
        Distances of fragments.
    labels : int array, shape (N,)
        Names.
    model : MarkerModel
        Marker set.
    n_spreads : float
        A distance is credible within this many standard deviations.

    Returns
    -------
    array, shape (N,)
        Weighted share, 1 for a fragment without a name or without company.
    """
    first, second = labels[pairs.first], labels[pairs.second]
    edge = np.flatnonzero((first != GHOST) & (second != GHOST) & (first != second))
    a, b, fragment = first[edge], second[edge], pairs.first[edge]
    weight = model.weight[a, b] * pairs.overlap_s[edge]
    credible = np.abs(pairs.mean[edge] - model.distance[a, b]) < n_spreads * model.spread[a, b]
    total = np.bincount(fragment, weight, len(labels))
    good = np.bincount(fragment, weight * credible, len(labels))
    # The most rigid neighbour of all, at a quite different distance: one of the two is wrong.
    nearest = model.weight[a, b] >= 1.0
    far_off = np.abs(pairs.mean[edge] / model.distance[a, b] - 1.0) > _CONTRADICTION
    good[fragment[nearest & far_off & ~credible]] = 0.0
    share: FloatArray = np.where(total > 0.0, good / np.maximum(total, 1e-12), 1.0)
    return share


def measure_margins(pairs: FragmentPairs, score: FloatArray, labels: IntArray) -> FloatArray:
    """Measure how much better each decision is than its best alternative.

    A named fragment could be a ghost, or have another name whose holders then are ghosts or take
    the name that became free. A ghost could have a name.

    Parameters
    ----------
    pairs : FragmentPairs
        Fragments seen together.
    score : array, shape (N, M)
        Worth of each name given all other names.
    labels : int array, shape (N,)
        Decision.

    Returns
    -------
    array, shape (N,)
        Not negative for an optimal assignment, up to the names of the others being fixed.
    """
    margin = np.empty(len(labels))
    for fragment, label in enumerate(labels):
        other = pairs.second[pairs.row[fragment] : pairs.row[fragment + 1]]
        holder = other[labels[other] != GHOST]
        rival = score[fragment].copy()
        kept = 0.0 if label == GHOST else score[fragment, label]
        swap = score[holder, label] if label != GHOST else np.zeros(len(holder))
        loss = score[holder, labels[holder]] - np.maximum(swap, 0.0)
        np.subtract.at(rival, labels[holder], loss)
        if label != GHOST:
            rival[label] = 0.0  # the alternative of no name at all
        margin[fragment] = kept - rival.max()
    return margin


def estimate_confidence(margin: FloatArray) -> FloatArray:
    """Turn margins into probabilities that a name is right.

    The slope was fitted by logistic regression to 8720 named fragments of subject 1 (degraded at
    2, 5 and 10 %); the length of a fragment adds nothing to its margin.
    """
    confidence: FloatArray = 1.0 / (1.0 + np.exp(-_CONFIDENCE_SLOPE * np.maximum(margin, 0.0)))
    return confidence
