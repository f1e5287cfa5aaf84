import numpy as np
import pytest

from besman.person.marker_set import load_marker_set
from besman.stages.label.model import adapt_marker_model, signed_volumes, weigh_neighbours
from besman.stages.label.model_from_pose import model_from_pose


def test_volumes_are_determinants():
    positions = np.random.default_rng(0).normal(size=(7, 5, 3))
    quads = np.array([[0, 1, 2, 3], [4, 2, 0, 1]])
    expected = [
        [np.linalg.det([frame[k] - frame[quad[0]] for k in quad[1:]]) for quad in quads]
        for frame in positions
    ]
    np.testing.assert_allclose(signed_volumes(positions, quads), expected, atol=1e-12)


def test_the_most_rigid_neighbour_counts_most_and_a_loose_one_nothing():
    spread = np.array([[0.0, 0.01, 0.02, 0.9], [0.01, 0.0, 0.03, 0.9], [0.02, 0.03, 0.0, 0.9]])
    spread = np.vstack([spread, [0.9, 0.9, 0.9, 0.0]])
    weight = weigh_neighbours(spread)
    assert weight[0].tolist() == pytest.approx([0.0, 1.0, 0.5 ** (1 / 3), 0.0])
    assert weight[2].argmax() == 0
    assert not weight[3].any()
    assert not np.diag(weight).any()


def test_distances_go_over_to_those_seen_the_longer_the_more():
    model = model_from_pose(load_marker_set("right_arm"))
    n = model.n_markers
    seen = model.distance * 1.1
    seen[0, 1] = seen[1, 0] = np.nan
    means = []
    for seconds in (0.0, 1.0, 1000.0):
        adapted = adapt_marker_model(model, seen, np.full((n, n), 1e-6), np.full((n, n), seconds))
        assert adapted.distance[0, 1] == model.distance[0, 1]
        means.append(adapted.distance[0, 2])
    assert means[0] == model.distance[0, 2]
    assert means[1] == pytest.approx(0.5 * (model.distance[0, 2] + seen[0, 2]))
    assert means[2] == pytest.approx(seen[0, 2], rel=1e-3)
    np.testing.assert_array_equal(adapted.weight, weigh_neighbours(adapted.spread))
