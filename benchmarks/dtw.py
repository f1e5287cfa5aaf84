"""Nearest neighbours under dynamic time warping, beside tslearn, dtaidistance and aeon.

    python benchmarks/dtw.py [--points 50] [--channels 3] [--band 5] [--pairs 2000]

Every library finds the nearest of 100 examples for each sequence, one process, one thread, best of
seven; libraries that are not installed are said so. Distances are held against ours.
"""

from __future__ import annotations

import argparse
import timeit
from collections.abc import Callable
from importlib import import_module

import numpy as np

from besman.classifiers.dtw_kernel import nearest_warped

N_EXAMPLES = 100
Find = Callable[[np.ndarray, np.ndarray, int], np.ndarray]


def ours(sequences: np.ndarray, examples: np.ndarray, band: int) -> np.ndarray:
    return nearest_warped(sequences, examples, band)[1]


def by_tslearn() -> Find:
    metrics = import_module("tslearn.metrics")
    return lambda sequences, examples, band: metrics.cdist_dtw(
        sequences, examples, global_constraint="sakoe_chiba", sakoe_chiba_radius=band
    ).min(axis=1)


def by_dtaidistance() -> Find:
    ndim = import_module("dtaidistance.dtw_ndim")

    def find(sequences: np.ndarray, examples: np.ndarray, band: int) -> np.ndarray:
        every = list(np.concatenate([sequences, examples]))
        n = len(sequences)
        block = ((0, n), (n, len(every)))
        apart = ndim.distance_matrix(
            every, ndim=sequences.shape[2], window=band + 1, block=block, use_c=True, parallel=False
        )
        return np.asarray(apart[:n, n:]).min(axis=1)

    return find


def by_aeon() -> Find:
    distances = import_module("aeon.distances")

    def find(sequences: np.ndarray, examples: np.ndarray, band: int) -> np.ndarray:
        # Channels first; the distance is squared; the band is a share of the length.
        first, second = (np.ascontiguousarray(x.swapaxes(1, 2)) for x in (sequences, examples))
        share = band / sequences.shape[1]
        return np.sqrt(distances.dtw_pairwise_distance(first, second, window=share).min(axis=1))

    return find


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=50)
    parser.add_argument("--channels", type=int, default=3)
    parser.add_argument("--band", type=int, default=5)
    parser.add_argument("--pairs", type=int, default=2000)
    options = parser.parse_args()
    random = np.random.default_rng(0)
    shape = (options.pairs // N_EXAMPLES + N_EXAMPLES, options.points, options.channels)
    every = random.normal(size=shape).cumsum(axis=1)
    sequences, examples = every[N_EXAMPLES:], every[:N_EXAMPLES]
    expected = ours(sequences, examples, options.band)
    own_s = 0.0
    for name, make in (
        ("besman", lambda: ours),
        ("tslearn", by_tslearn),
        ("dtaidistance", by_dtaidistance),
        ("aeon", by_aeon),
    ):
        try:
            find = make()
        except ImportError:
            print(f"{name:14}not installed")
            continue
        found = find(sequences, examples, options.band)
        spent = min(
            timeit.repeat(lambda f=find: f(sequences, examples, options.band), number=1, repeat=7)
        )
        own_s = own_s or spent
        apart = np.abs(found / expected - 1).max()
        each = 1e6 * spent / (len(sequences) * N_EXAMPLES)
        print(f"{name:14}{each:8.2f} us a pair{spent / own_s:8.1f} times, differs by {apart:.1e}")


if __name__ == "__main__":
    main()
