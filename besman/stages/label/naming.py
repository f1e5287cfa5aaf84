"""Names for whole fragments: a start, rounds of exact assignment, confidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.exceptions import LabellingError
from besman.stages.label.anchor import choose_anchor_frames, find_anchor
from besman.stages.label.assignment import assign_fragments
from besman.stages.label.confidence import (
    estimate_confidence,
    measure_margins,
    measure_plausibility,
)
from besman.stages.label.exchange_names import exchange_names
from besman.stages.label.fragments import FragmentPairs, Fragments, measure_pairs
from besman.stages.label.model import MarkerModel, adapt_marker_model
from besman.stages.label.scores import (
    GHOST,
    FragmentEnds,
    ScoreWeights,
    measure_ends,
    score_distances,
    score_links,
)
from besman.stages.label.sides import weigh_sides

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_N_TURNS = 3  # of rounds, adaptation to the person at hand in between
_MAX_ROUNDS = 60
_SHORT_BIAS = 2.0  # ghosts are mostly short
_SHORT_S = 0.15
_LONG_BIAS = 2.0  # per second: what is seen for long is hardly a ghost
_LONG_S = 1.0
_LOOSE_BIAS = 3.0  # nothing but its life speaks for a loose marker
_LOOSE_LONG_S = 4.0
_LEAST_PLAUSIBLE = 0.4
_LEAST_SIDES = -1.0  # log odds: what lies in the mirror is not named

DEFAULT_WEIGHTS = ScoreWeights()

FREE = -2
"""Of a fragment whose name is not known beforehand."""

_RULED_OUT = -1e3  # worth of a name that a fragment cannot have


@dataclass(frozen=True, eq=False)
class Assignment:
    """Names of fragments.

    Attributes
    ----------
    labels : int array, shape (N,)
        Marker of each fragment; `GHOST` where it is none or where it is not sure.
    best : int array, shape (N,)
        The best guess, sure or not.
    margin : array, shape (N,)
        How much better than the next best explanation, log likelihood ratio.
    confidence : array, shape (N,)
        Probability that `best` is right.
    """

    labels: IntArray
    best: IntArray
    margin: FloatArray
    confidence: FloatArray


def label_fragments(
    fragments: Fragments,
    model: MarkerModel,
    weights: ScoreWeights = DEFAULT_WEIGHTS,
    *,
    known: IntArray | None = None,
    start: IntArray | None = None,
    length_s: FloatArray | None = None,
    threshold: float = 0.8,
    anchor_every_s: float = 4.0,
    n_turns: int = _N_TURNS,
) -> Assignment:
    """Name the fragments of a recording.

    Parameters
    ----------
    fragments : Fragments
        Unnamed, but for what `known` says.
    model : MarkerModel
        Marker set.
    weights : ScoreWeights
        What counts how much.
    known : int array, shape (N,), optional
        Marker of each fragment that is known, `GHOST` where it is known to be none, `FREE` where
        nothing is. Those of one marker share no frame.
    start : int array, shape (N,), optional
        Names to begin with, `GHOST` where there is none yet, of fragments that were named before
        some of them were there; if not given a start is sought.
    length_s : array, shape (N,), optional
        For how long each fragment was seen, seconds, where some are parts of longer ones.
    threshold : float
        Least confidence of a name that is given.
    anchor_every_s : float
        One start is sought in each stretch of this length, seconds.
    n_turns : int
        How often all is named; fewer are enough where all but a little was named before.

    Returns
    -------
    Assignment
        Names with confidence.

    Raises
    ------
    LabellingError
        If no marker is seen in any frame.
    """
    if not fragments.n_fragments:
        raise LabellingError(
            f"nothing to name: all {fragments.n_frames} frames are empty, expected at least "
            "one frame in which a marker was seen"
        )
    if known is None:
        known = np.full(fragments.n_fragments, FREE, dtype=np.int64)
    held = known != FREE
    pairs = measure_pairs(fragments)
    labels = start
    if labels is None:
        labels = _start_labels(fragments, pairs, model, weights, anchor_every_s)
    labels = np.where(held, known, labels)
    ends = measure_ends(fragments)
    bias = _weigh_lengths(fragments, model, weights, length_s)
    score, model_now = np.zeros((len(labels), model.n_markers)), model
    for turn in range(_N_TURNS - n_turns, _N_TURNS):
        if turn:
            labels, _ = exchange_names(fragments, pairs, ends, labels, model, weights, held)
            seen = observe_distances(pairs, labels, model.n_markers)
            model_now = adapt_marker_model(model, *seen)
        labels, score = _repeat_rounds(
            fragments, pairs, ends, labels, model_now, weights, known, bias
        )
    margin = measure_margins(pairs, score, labels)
    _, exchange_margin = exchange_names(fragments, pairs, ends, labels, model, weights, held)
    margin = np.minimum(margin, exchange_margin)
    plausible = measure_plausibility(pairs, labels, model) >= _LEAST_PLAUSIBLE
    plausible &= weigh_sides(fragments, labels, model_now) > _LEAST_SIDES
    confidence = np.where(plausible, estimate_confidence(margin), 0.0)
    confidence = np.where(held, 1.0, confidence)
    sure = np.where(confidence >= threshold, labels, GHOST)
    return Assignment(sure, labels, margin, confidence)


def _repeat_rounds(
    fragments: Fragments,
    pairs: FragmentPairs,
    ends: FragmentEnds,
    labels: IntArray,
    model: MarkerModel,
    weights: ScoreWeights,
    known: IntArray,
    worth: FloatArray,
) -> tuple[IntArray, FloatArray]:
    """Score all names given the present ones and assign anew until nothing changes."""
    score = np.zeros((len(labels), model.n_markers))
    seen: set[bytes] = set()
    for _ in range(_MAX_ROUNDS):
        seen.add(labels.tobytes())
        score = score_distances(pairs, labels, model, weights, len(labels))
        score += score_links(fragments, ends, labels, model, weights) + worth
        _hold_known(score, pairs, known)
        labels = assign_fragments(fragments, score)
        if labels.tobytes() in seen:
            break
    return labels, score


def _weigh_lengths(
    fragments: Fragments, model: MarkerModel, weights: ScoreWeights, length_s: FloatArray | None
) -> FloatArray:
    """Return what the length of each fragment says for each name, shape (N, M)."""
    if length_s is None:
        length_s = fragments.n_samples / fragments.rate_hz
    bias = weights.ghost_bias + _SHORT_BIAS * np.exp(-length_s / _SHORT_S)
    long_bias = _LONG_BIAS * np.minimum(length_s, _LONG_S)
    loose_bias = _LOOSE_BIAS * np.minimum(length_s, _LOOSE_LONG_S)
    worth = np.where(model.loose, loose_bias[:, None], long_bias[:, None]) - bias[:, None]
    return np.asarray(worth)


def _hold_known(score: FloatArray, pairs: FragmentPairs, known: IntArray) -> None:
    """Leave known fragments no other name, and no other fragment theirs in the same frames."""
    score[known != FREE] = _RULED_OUT
    taken = known[pairs.first] >= 0
    score[pairs.second[taken], known[pairs.first[taken]]] = _RULED_OUT
    (named,) = np.nonzero(known >= 0)
    score[named, known[named]] = 1.0


def _start_labels(
    fragments: Fragments,
    pairs: FragmentPairs,
    model: MarkerModel,
    weights: ScoreWeights,
    anchor_every_s: float,
) -> IntArray:
    """Name what is seen at a few well visible instants; the best explained has the last word."""
    n_anchors = max(2, round(fragments.n_frames / fragments.rate_hz / anchor_every_s))
    frames = choose_anchor_frames(fragments, model.n_markers, n_anchors)
    anchors = [find_anchor(fragments, pairs, model, weights, int(frame)) for frame in frames]
    labels = np.full(fragments.n_fragments, GHOST, dtype=np.int64)
    for anchor in sorted(anchors, key=lambda anchor: anchor.score):
        labels[anchor.fragments] = anchor.markers
    return labels


def observe_distances(
    pairs: FragmentPairs, labels: IntArray, n_markers: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Pool the distances of named fragments by marker pair.

    Returns
    -------
    mean, variance, seconds : array, shape (M, M)
        NaN where two markers were never named together.
    """
    first, second = labels[pairs.first], labels[pairs.second]
    named = (first != GHOST) & (second != GHOST) & (first != second)
    key = first[named] * n_markers + second[named]
    time, mean = pairs.overlap_s[named], pairs.mean[named]

    def pool(values: FloatArray) -> FloatArray:
        table = np.bincount(key, values, n_markers**2).astype(np.float64)
        return table.reshape(n_markers, n_markers)

    seconds = pool(time)
    with np.errstate(invalid="ignore", divide="ignore"):
        average = pool(time * mean) / seconds
        variance = pool(time * (mean**2 + pairs.variance[named])) / seconds - average**2
    return average, np.maximum(variance, 0.0), seconds
