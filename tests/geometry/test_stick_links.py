import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree

from besman.geometry.stick_links import find_links


def test_points_that_stand_still_are_joined_by_the_shortest_tree():
    points = np.random.default_rng(1).random((12, 3)) * 0.3
    links = find_links(np.repeat(points[None], 20, axis=0), longest_m=1.0)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    assert len(links) == 11
    length = sum(apart[first, second] for first, second in links)
    np.testing.assert_allclose(length, minimum_spanning_tree(apart).sum())


def test_what_is_far_apart_moves_apart_or_is_never_seen_together_is_not_joined():
    positions = np.zeros((50, 5, 3))
    positions[:, 1, 0] = 0.2
    positions[:, 2, 0] = 3.0
    positions[:, 3, 1] = np.linspace(0.1, 0.6, 50)
    positions[:, 4] = np.nan
    assert find_links(positions) == [(0, 1)]


def test_a_limb_that_keeps_its_length_is_preferred_to_one_that_does_not():
    t = np.linspace(0, 6, 80)
    positions = np.zeros((80, 3, 3))
    positions[:, 1] = 0.3 * np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)  # turns about the first
    positions[:, 2, 0] = 0.28  # nearer to the second now and then
    assert (0, 1) in find_links(positions)
