r"""Probabilistic segmentation (ProbS) after Lioutikov 2017, with DMPs as movement primitives.

An over-segmentation gives cuts; which of them are borders is hidden. A segment between two cuts
was made by one of k primitives. A primitive is a Gaussian over the end point and the weights w of
a dynamical movement primitive on normalised time (thesis 4.4.2; the paper has ProMPs), so that the
samples y of a segment, from its start, are

.. math::

    y = \Phi w + e, \quad w \sim N(\mu_k, \mathrm{diag}(\sigma_k^2)), \quad e \sim N(0, s^2 I)

for each axis. Expectation maximisation weighs every pair of cuts by its probability, from forward
and backward messages over the cuts, and refits the primitives. The number of primitives is chosen
by the Bayesian information criterion.

It finds borders only among the cuts, prefers few long segments wherever one DMP can follow the
movement, and ends in a local optimum: the thesis reports the same of its own version.

References
----------
R. Lioutikov, G. Neumann, G. Maeda, J. Peters: Learning movement primitive libraries through
probabilistic segmentation. International Journal of Robotics Research 36(8), 2017,
doi:10.1177/0278364917713116
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.exceptions import SegmentationError
from besman.motion.dmp import roll_out

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Noise and spread below this share of the movement's size are rounding.
_FLOOR = 1e-4


class ProbsResult(NamedTuple):
    """The most probable segmentation.

    Attributes
    ----------
    borders : tuple of int array, shape (S + 1,)
        One array for each recording, some of its cuts.
    primitives : tuple of int array, shape (S,)
        Which primitive made each segment.
    log_probability : float
        Log-probability of the data, borders and primitives summed out.
    """

    borders: tuple[IntArray, ...]
    primitives: tuple[IntArray, ...]
    log_probability: float


class _Candidates(NamedTuple):
    """All pairs of cuts that may be a segment, C in all.

    recording, first, last : index of the recording and of the two cuts.
    gram : (C, p, p), Phi' Phi; moment : (C, p, a), Phi' y; square : (C,), y'y; n : (C,).
    """

    recording: IntArray
    first: IntArray
    last: IntArray
    gram: FloatArray
    moment: FloatArray
    square: FloatArray
    n: FloatArray


class _Library(NamedTuple):
    """Primitives: shares (k,), means and variances (k, a, p), variance of the noise."""

    shares: FloatArray
    means: FloatArray
    variances: FloatArray
    noise: float


def segment_with_primitives(
    series: Sequence[npt.ArrayLike],
    cuts: Sequence[npt.ArrayLike],
    longest: int,
    n_weights: int = 5,
    most_primitives: int = 8,
    n_iterations: int = 50,
    seed: int = 0,
    progress: Callable[[float], None] = lambda done: None,
) -> ProbsResult:
    """Choose borders among the cuts of all recordings, and a library of primitives for them.

    Parameters
    ----------
    series : sequence of array, shape (T_i, a)
        Positions of every recording.
    cuts : sequence of int array, shape (C_i,)
        Rising sample indices, first 0 and last T_i.
    longest : int
        Greatest length of a segment, samples; the next cut is always allowed.
    n_weights : int
        Weights of a DMP for each axis, at least 2.
    most_primitives : int
        Greatest number of primitives that is tried.
    n_iterations : int
        Greatest number of iterations of expectation maximisation.
    seed : int
        Of the start.
    progress : callable
        Called with the share done.

    Returns
    -------
    ProbsResult

    Raises
    ------
    SegmentationError
        If shapes do not fit, values are not finite, or cuts do not span a recording.
    """
    arrays = [np.asarray(values, dtype=np.float64) for values in series]
    borders = [np.asarray(values, dtype=np.int64) for values in cuts]
    _check(arrays, borders)
    size = float(np.sqrt(np.mean([np.var(y, axis=0).sum() for y in arrays])))
    if size == 0.0:
        raise SegmentationError("probs: nothing moves in any of the recordings")
    candidates = _fit_candidates([y / size for y in arrays], borders, longest, n_weights)
    best, lowest = None, np.inf
    rng = np.random.default_rng(seed)
    counts = [len(edges) for edges in borders]
    for k in range(1, most_primitives + 1):
        library = _start(candidates, k, rng)
        value = -np.inf
        for _ in range(n_iterations):
            new, library = _iterate(candidates, counts, library)
            converged = new - value < 1e-5 * abs(new)
            value = new
            if converged:
                break
        n_segments = sum(count - 1 for count in counts)
        n_parameters = k - 1 + library.means.size + library.variances.size
        criterion = -2.0 * value + n_parameters * np.log(n_segments)
        if criterion < lowest:
            best, lowest = (library, value), criterion
        progress(k / most_primitives)
    assert best is not None
    found, primitives = _decode(candidates, borders, best[0])
    return ProbsResult(found, primitives, best[1])


def _check(arrays: list[FloatArray], borders: list[IntArray]) -> None:
    if not arrays or len(arrays) != len(borders):
        raise SegmentationError(
            f"probs: got {len(arrays)} series and cuts of {len(borders)}; expected as many, at "
            "least 1"
        )
    for index, (y, edges) in enumerate(zip(arrays, borders, strict=True)):
        if y.ndim != 2 or len(y) < 2 or y.shape[1:] != arrays[0].shape[1:]:
            raise SegmentationError(
                f"probs: series {index} must have shape (T, a), T >= 2, got {y.shape}"
            )
        if not np.isfinite(y).all():
            row = int(np.argmin(np.isfinite(y).all(axis=1)))
            raise SegmentationError(f"probs: series {index} must be finite; sample {row} is not")
        spans = len(edges) >= 2 and edges[0] == 0 and edges[-1] == len(y)
        if not spans or (np.diff(edges) < 1).any():
            raise SegmentationError(
                f"probs: cuts of series {index} must rise from 0 to {len(y)}, got {edges.tolist()}"
            )


def _fit_candidates(
    arrays: list[FloatArray], borders: list[IntArray], longest: int, n_weights: int
) -> _Candidates:
    """Gather what the evidence of every possible segment needs."""
    rows: list[tuple[int, int, int]] = []
    sums: list[tuple[FloatArray, FloatArray, float, int]] = []
    responses: dict[int, FloatArray] = {}
    for index, (y, edges) in enumerate(zip(arrays, borders, strict=True)):
        for first in range(len(edges) - 1):
            for last in range(first + 1, len(edges)):
                n = int(edges[last] - edges[first])
                if n > longest and last > first + 1:
                    break
                if n not in responses:
                    responses[n] = _respond(n, n_weights)
                phi = responses[n]
                # From the sample before: the step into a segment belongs to it.
                before = max(int(edges[first]) - 1, 0)
                part = y[edges[first] : edges[last]] - y[before]
                rows.append((index, first, last))
                sums.append((phi.T @ phi, phi.T @ part, float((part**2).sum()), n))
    recording, start, end = np.array(rows).T
    gram, moment, square, count = zip(*sums, strict=True)
    return _Candidates(
        recording,
        start,
        end,
        np.stack(gram),
        np.stack(moment),
        np.array(square),
        np.array(count, dtype=np.float64),
    )


def _respond(n: int, n_weights: int) -> FloatArray:
    """Movement of a DMP from 0 for a unit goal and for unit weights, shape (n, K + 1)."""
    unit = np.eye(n_weights + 2)
    time = (np.arange(n) + 1.0) / n
    positions, _, _ = roll_out(unit[:, 2:], unit[:, 0], unit[:, 1], 1.0, time)
    # Weights of one size move the arm by one size: their spread is then comparable to the goal's.
    scale = roll_out(unit[:, 2:], unit[:, 0], unit[:, 1], 1.0, np.linspace(0, 1, 101))[0]
    scaled: FloatArray = positions[:, 1:] / np.sqrt(np.mean(scale[:, 1:] ** 2, axis=0))
    return scaled


def _start(candidates: _Candidates, k: int, rng: np.random.Generator) -> _Library:
    """Start from single pieces: k of them, far from each other, and the spread of all."""
    single = np.flatnonzero(candidates.last == candidates.first + 1)
    p = candidates.gram.shape[1]
    ridge = candidates.gram[single] + 1e-2 * np.eye(p)
    fitted = np.swapaxes(np.linalg.solve(ridge, candidates.moment[single]), 1, 2)
    chosen = [int(rng.integers(len(single)))]
    for _ in range(k - 1):
        gaps = fitted[:, np.newaxis] - fitted[chosen]
        distance = (gaps**2).sum(axis=(2, 3)).min(axis=1)
        share = distance / distance.sum() if distance.sum() else None
        chosen.append(int(rng.choice(len(single), p=share)))
    spread = fitted.var(axis=0) + _FLOOR
    n = candidates.n[single].sum() * fitted.shape[1]
    rest = candidates.square[single].sum()
    rest -= np.einsum("cpa,cap->", candidates.moment[single], fitted)
    noise = max(rest / n, _FLOOR**2)
    return _Library(np.full(k, 1.0 / k), fitted[chosen], np.stack([spread] * k), noise)


def _evaluate(
    candidates: _Candidates, library: _Library
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log-evidence of every segment under every primitive, (C, k), and the posterior of w.

    The posterior has means (C, k, a, p) and covariances (C, k, a, p, p).
    """
    n_axes = library.means.shape[1]
    mean, variance = library.means, library.variances
    precision = np.einsum("kap,pq->kapq", 1.0 / variance, np.eye(mean.shape[2]))
    inverse = precision + candidates.gram[:, np.newaxis, np.newaxis] / library.noise
    moment = np.swapaxes(candidates.moment, 1, 2)[:, np.newaxis]
    residual = moment - np.einsum("cpq,kaq->ckap", candidates.gram, mean)
    covariance = np.linalg.inv(inverse)
    shift = np.einsum("ckapq,ckaq->ckap", covariance, residual) / library.noise
    square = candidates.square[:, np.newaxis] - 2 * np.einsum(
        "cpa,kap->ck", candidates.moment, mean
    )
    square += np.einsum("kap,cpq,kaq->ck", mean, candidates.gram, mean)
    square -= np.einsum("ckap,ckap->ck", residual, shift)
    value = -0.5 * square / library.noise
    value -= 0.5 * np.linalg.slogdet(inverse)[1].sum(axis=2)
    value -= 0.5 * np.log(variance).sum(axis=(1, 2))
    value -= 0.5 * n_axes * candidates.n[:, np.newaxis] * np.log(2 * np.pi * library.noise)
    return value, mean + shift, covariance


def _iterate(
    candidates: _Candidates, counts: list[int], library: _Library
) -> tuple[float, _Library]:
    """One step of expectation maximisation; returns the log-probability before it."""
    evidence, means, covariances = _evaluate(candidates, library)
    weighted = evidence + np.log(library.shares)
    total = np.logaddexp.reduce(weighted, axis=1)
    value, share = _share_cuts(candidates, counts, total)
    weight = np.exp(weighted - total[:, np.newaxis]) * share[:, np.newaxis]
    sizes = weight.sum(axis=0) + 1e-12
    mean = np.einsum("ck,ckap->kap", weight, means) / sizes[:, np.newaxis, np.newaxis]
    spread = (means - mean) ** 2 + np.einsum("ckapp->ckap", covariances)
    variance = np.einsum("ck,ckap->kap", weight, spread) / sizes[:, np.newaxis, np.newaxis]
    rest = candidates.square[:, np.newaxis] - 2 * np.einsum(
        "cpa,ckap->ck", candidates.moment, means
    )
    rest += np.einsum("ckap,cpq,ckaq->ck", means, candidates.gram, means)
    rest += np.einsum("cpq,ckaqp->ck", candidates.gram, covariances)
    n = (weight * candidates.n[:, np.newaxis]).sum() * mean.shape[1]
    noise = max(float((weight * rest).sum() / n), _FLOOR**2)
    return value, _Library(sizes / sizes.sum(), mean, np.maximum(variance, _FLOOR**2), noise)


def _share_cuts(
    candidates: _Candidates, counts: list[int], total: FloatArray
) -> tuple[float, FloatArray]:
    """Sum over all choices of cuts: log-probability, and the probability of every segment."""
    value, share = 0.0, np.zeros(len(total))
    for index, count in enumerate(counts):
        rows = np.flatnonzero(candidates.recording == index)
        first, last, segment = candidates.first[rows], candidates.last[rows], total[rows]
        forward, backward = np.full(count, -np.inf), np.full(count, -np.inf)
        forward[0] = backward[-1] = 0.0
        for cut in range(1, count):
            into = last == cut
            forward[cut] = np.logaddexp.reduce(forward[first[into]] + segment[into])
        for cut in range(count - 2, -1, -1):
            out = first == cut
            backward[cut] = np.logaddexp.reduce(segment[out] + backward[last[out]])
        share[rows] = np.exp(forward[first] + segment + backward[last] - forward[-1])
        value += float(forward[-1])
    return value, share


def _decode(
    candidates: _Candidates, borders: list[IntArray], library: _Library
) -> tuple[tuple[IntArray, ...], tuple[IntArray, ...]]:
    """Find the most probable cuts and primitives of every recording."""
    weighted = _evaluate(candidates, library)[0] + np.log(library.shares)
    primitive, value = weighted.argmax(axis=1), weighted.max(axis=1)
    found, made_by = [], []
    for index, edges in enumerate(borders):
        rows = np.flatnonzero(candidates.recording == index)
        best = np.full(len(edges), -np.inf)
        best[0] = 0.0
        came = np.zeros(len(edges), dtype=np.int64)
        for cut in range(1, len(edges)):
            into = rows[candidates.last[rows] == cut]
            values = best[candidates.first[into]] + value[into]
            came[cut], best[cut] = into[values.argmax()], values.max()
        path = [came[-1]]
        while candidates.first[path[-1]] > 0:
            path.append(came[candidates.first[path[-1]]])
        chosen = np.array(path[::-1])
        found.append(np.append(edges[candidates.first[chosen]], edges[-1]))
        made_by.append(primitive[chosen])
    return tuple(found), tuple(made_by)
