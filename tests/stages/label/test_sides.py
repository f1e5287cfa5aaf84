"""Sides beside a mirror: what lies in it is told by its volumes."""

import numpy as np
from scipy.spatial.transform import Rotation

from besman.stages.label.fragments import split_fragments
from besman.stages.label.learning import learn_marker_model
from besman.stages.label.scores import GHOST
from besman.stages.label.sides import weigh_sides


def turning_body(seed, n=300):
    """Six markers on a rigid body that turns about; near to its own mirror image."""
    rng = np.random.default_rng(seed)
    half = np.array([[0.15, 0.1, 0.0], [0.0, 0.12, 0.15], [-0.1, 0.08, -0.12]])
    body = np.concatenate((half, half * np.array([1.0, -1.0, 1.0])))
    time = np.arange(n)[:, np.newaxis] / 100
    turn = Rotation.from_rotvec(time * rng.normal(size=3)).as_matrix()
    return np.einsum("tij,kj->tki", turn, body) + rng.normal(scale=2e-4, size=(n, 6, 3))


def test_the_mirror_is_told_from_the_body():
    mirrored = np.array([3, 4, 5, 0, 1, 2])
    for seed in range(6):
        positions = turning_body(seed)
        model = learn_marker_model(positions[:100], 100.0, tuple("abcdef"))
        fragments = split_fragments(positions, 100.0)
        right = fragments.column
        assert (weigh_sides(fragments, right, model) > 1.0).all()
        assert (weigh_sides(fragments, mirrored[right], model) < -1.0).all()


def test_without_names_or_volumes_nothing_is_known():
    positions = turning_body(0)
    model = learn_marker_model(positions, 100.0, tuple("abcdef"))
    fragments = split_fragments(positions, 100.0)
    none = np.full(fragments.n_fragments, GHOST)
    np.testing.assert_array_equal(weigh_sides(fragments, none, model), 0.0)
    flat = learn_marker_model(positions * [1.0, 1.0, 0.0], 100.0, tuple("abcdef"))
    assert len(flat.quads) == 0
    np.testing.assert_array_equal(weigh_sides(fragments, fragments.column, flat), 0.0)
