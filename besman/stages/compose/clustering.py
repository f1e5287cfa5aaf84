"""Clusters in place of labelled building blocks, and which cluster is which."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from besman.exceptions import RecognitionError

FloatArray = npt.NDArray[np.float64]
Clusters = npt.NDArray[np.int64]

# The p-value is given from 8 points on.
_FEWEST_TESTED = 8
# From a statistic on: polynomial whose exponential is the p-value, below 0.34 one minus it.
_P_VALUES = (
    (10.0, (-2.0, -35.0)),
    (0.6, (0.0186, -5.709, 1.2937)),
    (0.34, (-1.38, -4.279, 0.9177)),
    (0.2, (-59.938, 42.796, -8.318)),
    (0.0, (-223.73, 101.14, -13.436)),
)


def cluster_k_means(vectors: npt.ArrayLike, n_clusters: int, seed: int = 0) -> Clusters:
    """Cluster vectors by k-means, the best of ten starts.

    Parameters
    ----------
    vectors : array, shape (S, F)
        Scaled features.
    n_clusters : int
        The thesis takes the number of expected classes plus one.
    seed : int

    Returns
    -------
    int array, shape (S,)
        Cluster of each vector, numbered in the order in which they occur.

    Raises
    ------
    RecognitionError
        If there are fewer vectors than clusters, or one is not finite.
    """
    values = _checked(vectors, n_clusters)
    return _in_order(_k_means(values, n_clusters, seed))


def cluster_g_means(
    vectors: npt.ArrayLike,
    seed: int = 0,
    most_clusters: int | None = None,
    significance: float = 0.01,
) -> Clusters:
    """Split clusters in two until each is Gaussian along the line between its halves.

    Parameters
    ----------
    vectors : array, shape (S, F)
        Scaled features.
    seed : int
    most_clusters : int, optional
        Stop at this number.
    significance : float
        Of the test. The paper takes 0.0001 for thousands of vectors; the blocks of a few
        demonstrations need more power.

    Returns
    -------
    int array, shape (S,)
        As of `cluster_k_means`.

    Raises
    ------
    RecognitionError
        If there are no vectors, or one is not finite.

    References
    ----------
    G. Hamerly and C. Elkan: Learning the k in k-means, NIPS 2004.
    """
    values = _checked(vectors, 1)
    clusters = np.zeros(len(values), dtype=np.int64)
    waiting, count = [0], 1
    while waiting and (most_clusters is None or count < most_clusters):
        number = waiting.pop(0)
        rows = np.flatnonzero(clusters == number)
        halves = _split(values[rows], seed, significance)
        if halves is None:
            continue
        clusters[rows[halves]] = count
        waiting += [number, count]
        count += 1
    return _in_order(clusters)


def gaussian_probability(values: npt.ArrayLike) -> float:
    """Return the p-value of the Anderson-Darling test for normality of numbers, shape (S,).

    References
    ----------
    R. D'Agostino and M. Stephens: Goodness-of-fit techniques, 1986, table 4.9; mean and variance
    unknown.
    """
    from scipy.special import log_ndtr

    ordered = np.sort(np.asarray(values, dtype=np.float64))
    n = len(ordered)
    if n < _FEWEST_TESTED or np.ptp(ordered) == 0.0:
        return 1.0
    z = (ordered - ordered.mean()) / ordered.std(ddof=1)
    ranks = 2 * np.arange(1, n + 1) - 1
    plain = -n - float(np.mean(ranks * (log_ndtr(z) + log_ndtr(-z[::-1]))))
    statistic = plain * (1.0 + 0.75 / n + 2.25 / n**2)
    for bound, power in _P_VALUES:
        if statistic >= bound:
            exponent = float(np.polyval(power, statistic))
            return float(np.exp(exponent) if bound >= 0.34 else -np.expm1(exponent))
    return 1.0


def match_clusters(
    clusters: Sequence[int] | Clusters,
    labels: Sequence[str],
    weights: npt.ArrayLike | None = None,
) -> dict[int, str]:
    """Find which cluster is which class, so that as much as possible agrees.

    Parameters
    ----------
    clusters : sequence of int, length S
    labels : sequence of str, length S
        True class of the same items; items may be segments or samples.
    weights : array, shape (S,), optional
        How much each item counts; 1 if not given.

    Returns
    -------
    dict of str
        Class of each cluster. No class has two clusters; clusters beyond the number of classes are
        not in it.

    References
    ----------
    Thesis 6.3; the assignment problem, solved exactly.
    """
    from scipy.optimize import linear_sum_assignment

    if len(clusters) != len(labels):
        raise RecognitionError(f"got {len(clusters)} clusters and {len(labels)} labels to match")
    numbers, rows = np.unique(np.asarray(clusters, dtype=np.int64), return_inverse=True)
    names, columns = np.unique(np.asarray(labels, dtype=str), return_inverse=True)
    common = np.zeros((len(numbers), len(names)))
    np.add.at(common, (rows, columns), 1.0 if weights is None else np.asarray(weights))
    pairs = linear_sum_assignment(common, maximize=True)
    return {int(numbers[row]): str(names[column]) for row, column in zip(*pairs, strict=True)}


def _checked(vectors: npt.ArrayLike, least: int) -> FloatArray:
    """Refuse too few vectors and what is no number."""
    values = np.asarray(vectors, dtype=np.float64)
    if least < 1 or values.ndim != 2 or len(values) < least:
        raise RecognitionError(
            f"cluster: got {len(values)} segments for {least} clusters; expected at least as many "
            "segments, and one cluster or more"
        )
    finite = np.isfinite(values).all(axis=1)
    if not finite.all():
        raise RecognitionError(
            f"cluster: features of segment {int(np.argmin(finite))} must be finite"
        )
    return values


def _k_means(values: FloatArray, n_clusters: int, seed: int) -> Clusters:
    from sklearn.cluster import KMeans
    from threadpoolctl import threadpool_limits

    # Sums over threads come in another order for every number of threads.
    with threadpool_limits(limits=1):
        found = KMeans(n_clusters, n_init=10, random_state=seed).fit_predict(values)
    return np.asarray(found, dtype=np.int64)


def _split(values: FloatArray, seed: int, significance: float) -> npt.NDArray[np.bool_] | None:
    """Say which vectors make the second half, or None if the whole is Gaussian."""
    if len(values) < _FEWEST_TESTED or np.ptp(values, axis=0).max() == 0.0:
        return None
    second = _k_means(values, 2, seed) == 1
    line = values[second].mean(axis=0) - values[~second].mean(axis=0)
    return None if gaussian_probability(values @ line) >= significance else second


def _in_order(clusters: Clusters) -> Clusters:
    """Give clusters numbers in the order in which they occur."""
    _, first, inverse = np.unique(clusters, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse]
