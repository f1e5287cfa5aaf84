"""The compiled steps against following all segmentations one by one."""

import numpy as np
import pytest

from besman.stages.segment.online_kernel import choose_start, find_agreed


def chosen(evidence, patience=10**6, lead=np.inf):
    """Run over all ends; return what is best, where from, and how long starts lie behind."""
    n = len(evidence)
    best, previous = np.full(n + 1, -np.inf), np.zeros(n + 1, dtype=np.int64)
    behind = np.zeros(n + 1, dtype=np.int64)
    best[0] = 0.0
    for end in range(1, n + 1):
        choose_start(best, previous, behind, end, evidence[end - 1], lead, patience)
    return best, previous, behind


@pytest.mark.parametrize("seed", range(4))
def test_the_best_start_is_that_of_all_segmentations(seed):
    n, longest = 9, 4
    evidence = np.random.default_rng(seed).normal(size=(n, longest + 1))

    def best_of(end):
        if end == 0:
            return 0.0
        return max(best_of(end - k) + evidence[end - 1, k] for k in range(1, min(longest, end) + 1))

    best, previous, _ = chosen(evidence)
    for end in range(1, n + 1):
        assert best[end] == pytest.approx(best_of(end))
        assert best[end] == best[previous[end]] + evidence[end - 1, end - previous[end]]


def test_a_start_that_is_long_far_behind_is_given_up():
    evidence = np.full((6, 7), -100.0)
    evidence[:, 1] = 1.0  # one sample a segment explains all
    best, _, behind = chosen(evidence, patience=3, lead=5.0)
    assert np.isneginf(best[:3]).all()
    assert np.isfinite(best[5:]).all()
    assert behind[5] == 0


@pytest.mark.parametrize("seed", range(6))
def test_borders_agreed_on_are_those_in_the_way_of_every_candidate(seed):
    random = np.random.default_rng(seed)
    n, longest = 40, 12
    evidence = random.normal(scale=3.0, size=(n, longest + 1))
    best, previous, _ = chosen(evidence)
    ways = []
    for node in range(n + 1 - longest, n + 1):
        way = [node]
        while way[-1] > 0:
            way.append(int(previous[way[-1]]))
        ways.append(way)
    shared = set.intersection(*(set(way) for way in ways))
    agreed, next_one = find_agreed(best, previous, 0, n, longest)
    assert agreed == max(shared)
    followers = [min((b for b in way if b > agreed), default=n + 1) for way in ways]
    assert next_one == min(followers)
