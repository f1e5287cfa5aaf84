"""Reaches whose borders are known."""

from itertools import pairwise

import numpy as np


def reach(seed=0, n_moves=5, rate_hz=100.0, pause_s=0.0):
    """Minimum-jerk reaches between random points, with pauses; the time of every border."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.2, 0.5, (n_moves + 1, 3)) * rng.choice([-1, 1], 3), axis=0)
    points[1::2, :2] *= -1
    pieces, borders, at = [], [0.0], 0.0
    for index, (start, goal) in enumerate(pairwise(points)):
        n = round(rate_hz * round(rng.uniform(0.8, 1.3), 1))
        s = np.arange(n) / n
        pieces.append(start + (goal - start) * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, np.newaxis])
        at += n / rate_hz
        borders.append(at)
        if pause_s and index < n_moves - 1:
            pieces.append(np.tile(goal, (round(pause_s * rate_hz), 1)))
            at += pause_s
            borders.append(at)
    path = np.concatenate(pieces)
    path = path + rng.normal(scale=2e-4, size=path.shape)
    return np.arange(len(path)) / rate_hz, path[:, np.newaxis], np.array(borders)
