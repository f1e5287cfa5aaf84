import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.geometry.rigid_bodies import fill_cluster, learn_shape, place_shape

SHAPES = {
    3: np.array([[0.04, 0.0, 0.0], [-0.02, 0.03, 0.0], [-0.02, -0.03, 0.0]]),
    4: np.array([[0.04, 0.0, 0.01], [-0.02, 0.03, 0.0], [-0.02, -0.03, 0.0], [0.0, 0.0, 0.05]]),
}


def swing(n, n_frames=300, noise=0.0):
    """A body that turns a lot about changing axes while it travels."""
    t = np.arange(n_frames) / 100
    turn = Rotation.from_euler("xyz", np.stack([1.5 * np.sin(2 * t), t, np.cos(3 * t)], axis=1))
    path = np.stack([0.5 * np.sin(3 * t), 0.4 * np.cos(2 * t), 0.2 * t], axis=1)
    body = np.einsum("tij,kj->tki", turn.as_matrix(), SHAPES[n]) + path[:, None]
    return body + np.random.default_rng(0).normal(scale=noise, size=body.shape)


@pytest.mark.parametrize(("n", "limit_m"), [(4, 1e-6), (3, 0.008)])
def test_a_hidden_marker_is_where_its_body_says(n, limit_m):
    body = swing(n)
    gap = body.copy()
    gap[100:150, 1] = np.nan
    filled, mask = fill_cluster(gap, 100)
    np.testing.assert_array_equal(np.flatnonzero(mask[:, 1]), np.arange(100, 150))
    error = np.linalg.norm(filled - body, axis=2).max()
    assert error < limit_m
    # Two markers leave only the turn about their line open: distances to them are kept.
    for mate in (0, 2):
        apart = np.linalg.norm(filled[:, 1] - filled[:, mate], axis=1)
        np.testing.assert_allclose(apart, apart[0], atol=2e-5)


def test_noise_does_not_break_continuity():
    gap = swing(3, noise=3e-4)
    gap[100:150, 2] = np.nan
    filled, _ = fill_cluster(gap, 100)
    step = np.linalg.norm(np.diff(filled[:, 2], axis=0), axis=1)
    assert step[98:152].max() < 1.5 * step.max()
    assert np.isfinite(filled).all()


def test_what_is_left_alone():
    body = swing(3)
    gap = body.copy()
    gap[100:150, :2] = np.nan  # a single mate says nothing
    gap[:20, 2] = np.nan  # nor is there a turn to start from
    gap[200:290, 0] = np.nan
    filled, mask = fill_cluster(gap, 80)
    assert not mask.any()
    np.testing.assert_array_equal(filled, gap)
    _, two = fill_cluster(gap[:, :2], 80)
    assert not two.any()
    never = body.copy()
    never[::2, 0] = np.nan
    never[1::2, 1] = np.nan
    assert not fill_cluster(never, 80)[1].any()


def test_shape_is_recovered_and_placed():
    body = swing(4)
    shape = learn_shape(body)
    placed = place_shape(shape, body, np.ones(4))
    np.testing.assert_allclose(placed, body, atol=1e-9)
