"""Clusters against known groups, scipy's test and all assignments."""

import itertools

import numpy as np
import pytest
from scipy import stats

from besman.exceptions import RecognitionError
from besman.stages.compose.clustering import (
    cluster_g_means,
    cluster_k_means,
    gaussian_probability,
    match_clusters,
)


@pytest.fixture
def groups():
    rng = np.random.default_rng(0)
    centres = np.array([[0, 0, 0], [3, 0, 0], [0, 4, 1]])
    truth = rng.permutation(np.repeat([0, 1, 2], 40))
    return rng.normal(scale=0.3, size=(120, 3)) + centres[truth], truth


@pytest.mark.parametrize("cluster", [lambda v: cluster_k_means(v, 3), cluster_g_means])
def test_finds_the_groups(groups, cluster):
    vectors, truth = groups
    found = cluster(vectors)
    names = match_clusters(found, [str(k) for k in truth])
    assert [names[k] for k in found] == [str(k) for k in truth]
    assert list(dict.fromkeys(found)) == [0, 1, 2]


def test_g_means_leaves_a_gaussian_whole_and_stops(groups):
    one = np.random.default_rng(1).normal(size=(200, 4))
    assert set(cluster_g_means(one)) == {0}
    assert len(set(cluster_g_means(groups[0], most_clusters=2))) == 2
    assert set(cluster_g_means(np.ones((20, 2)))) == {0}
    assert set(cluster_g_means(groups[0][:3])) == {0}


def test_p_value_is_uniform_under_normality():
    rng = np.random.default_rng(2)
    values = [gaussian_probability(rng.normal(3.0, 2.0, 40)) for _ in range(2000)]
    assert stats.kstest(values, "uniform").statistic < 0.05
    assert gaussian_probability(np.repeat([0.0, 1.0], 20) + rng.normal(0, 0.05, 40)) < 1e-4
    assert gaussian_probability(np.zeros(30)) == gaussian_probability([1.0, 5.0]) == 1.0


def test_assignment_is_the_best_of_all():
    rng = np.random.default_rng(3)
    clusters, labels = rng.integers(0, 4, 60), rng.choice(["a", "b", "c"], 60)
    weights = rng.random(60)
    names = match_clusters(clusters, labels, weights)
    got = sum(
        w for k, name, w in zip(clusters, labels, weights, strict=True) if names.get(k) == name
    )
    best = max(
        sum(w for k, name, w in zip(clusters, labels, weights, strict=True) if order[k] == name)
        for order in itertools.permutations(["a", "b", "c", None])
    )
    assert got == pytest.approx(best)
    assert len(names) == 3


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (lambda: cluster_k_means(np.zeros((2, 3)), 3), "got 2 segments for 3 clusters"),
        (lambda: cluster_k_means(np.zeros((2, 3)), 0), "one cluster or more"),
        (lambda: cluster_g_means(np.empty((0, 3))), "got 0 segments"),
        (lambda: cluster_g_means([[0.0], [np.nan]]), "features of segment 1 must be finite"),
        (lambda: match_clusters([1], []), "1 clusters and 0 labels"),
    ],
)
def test_bad_input(run, message):
    with pytest.raises(RecognitionError, match=message):
        run()
