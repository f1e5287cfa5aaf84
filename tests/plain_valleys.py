"""The default segmentation as its equations are written: every pair of valleys, one by one."""

from itertools import pairwise

import numpy as np
from scipy.special import logsumexp

from besman.stages.segment.valleys import _find_rests, typical_speed


def evaluate_all(evidence, starts, ends, sure, given=()):
    """Evaluate all movements, shape (V, V), by ridge regression on every bell."""
    n_valleys = len(starts)
    values = np.full((n_valleys, n_valleys), -np.inf)
    for i in range(n_valleys):
        for k in range(i + 1, n_valleys):
            if ends[k] - starts[i] >= len(evidence.factor):
                break
            if ends[k] - starts[i] >= 2:
                values[i, k] = evaluate_one(evidence, starts[i], ends[k])
    for k, value in dict(given).items():
        values[k - 1, k] = value
    for i in range(n_valleys):
        for k in range(i + 1, n_valleys):
            if any(sure[i + 1 : k]):
                values[i, k] = -np.inf
    return values


def evaluate_one(evidence, start, end):
    """Evaluate one movement: the noise is what a fit leaves, not a difference of sums."""
    model, speeds = evidence.model, evidence.speeds[start:end]
    n, s = speeds.shape
    # All bells at once, as rows of stacks.
    c = np.arange(1, model.n_centres + 1)[:, None]
    place = np.arange(n) / (n - 1)
    basis = np.ones((model.n_centres, n, 2))
    basis[..., 0] = np.exp(-(((place - c / (model.n_centres + 1)) / model.bell_width) ** 2))
    precision = basis.mT @ basis + np.eye(2) / model.speed_weight_variance
    weights = np.linalg.solve(precision, basis.mT @ speeds)
    left = speeds - basis @ weights
    noise = left.mT @ left + weights.mT @ weights / model.speed_weight_variance
    noise += model.noise_scale * np.eye(s)
    values = -0.5 * s * np.linalg.slogdet(precision)[1]
    values -= 0.5 * (n + model.nu(s)) * np.linalg.slogdet(noise)[1]
    values[(weights[:, 0] < 0).any(axis=1)] = -np.inf
    return values.max() + evidence.factor[n]


def search(movement, rest):
    """Return the most probable way through the valleys, and its log-probability."""
    best = np.full(len(rest), -np.inf)
    best[0] = 0.0
    previous = np.zeros(len(rest), dtype=np.int64)
    for k in range(1, len(rest)):
        values = best[:k] + movement[:k, k]
        previous[k] = np.argmax(values)
        best[k] = rest[k] + values.max()
    way = [len(rest) - 1]
    while way[-1] > 0:
        way.append(int(previous[way[-1]]))
    return way[::-1], best[-1]


def weigh(movement, rest):
    """Return the posterior probability of every valley."""
    n = len(rest)
    forward, backward = np.full(n, -np.inf), np.full(n, -np.inf)
    forward[0] = backward[-1] = 0.0
    for k in range(1, n):
        forward[k] = rest[k] + logsumexp(forward[:k] + movement[:k, k])
    for k in range(n - 2, -1, -1):
        backward[k] = logsumexp(backward[k + 1 :] + rest[k + 1 :] + movement[k, k + 1 :])
    if not np.isfinite(forward[-1]):
        return np.zeros(n)
    return np.minimum(np.exp(forward + backward - forward[-1]), 1.0)


def find_valleys(speed, shape, ahead=None, typical=None):
    """Find the valleys; of all hills and minima that are left, the one to go is looked for anew."""
    steady, speed = speed, speed if ahead is None else ahead
    inner = (speed[1:-1] <= speed[:-2]) & (speed[1:-1] < speed[2:])
    minima = list(np.flatnonzero(inner) + 1)
    if speed.size < 2 or not speed.any():
        return []
    least = shape.hill * typical_speed(steady)
    while minima:
        peaks = [max(speed[a : b + 1]) for a, b in pairwise([0, *minima, len(speed) - 1])]
        hill = int(np.argmin(peaks))
        if peaks[hill] >= least:
            break
        beside = [k for k in (hill - 1, hill) if 0 <= k < len(minima)]
        minima.pop(max(beside, key=lambda k: speed[minima[k]]))
    while minima:
        peaks = [max(speed[a : b + 1]) for a, b in pairwise([0, *minima, len(speed) - 1])]
        share = [speed[at] / min(pair) for at, pair in zip(minima, pairwise(peaks), strict=True)]
        if max(share) < shape.depth:
            break
        minima.pop(int(np.argmax(share)))
    return _find_rests(steady, np.array(minima, dtype=np.int64), shape)
