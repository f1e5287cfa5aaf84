import numpy as np
from scipy.spatial.transform import Rotation

from besman.geometry.rigid_groups import find_rigid_groups

SHAPE = np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.07, 0], [0.03, 0.02, 0.04]])


def body(rng, n, n_markers, at):
    """Markers of a body that turns and moves, with a millimetre of noise."""
    turned = Rotation.from_rotvec(np.cumsum(rng.normal(scale=0.05, size=(n, 3)), axis=0))
    way = at + np.cumsum(rng.normal(scale=0.01, size=(n, 3)), axis=0)
    places = np.stack([turned.apply(np.tile(one, (n, 1))) for one in SHAPE[:n_markers]], axis=1)
    return places + way[:, None] + rng.normal(scale=0.001, size=places.shape)


def test_bodies_are_found_whatever_the_order_and_gaps():
    rng = np.random.default_rng(5)
    parts = [body(rng, 400, 4, 0.0), body(rng, 400, 3, 0.1), body(rng, 400, 2, 0.2)]
    positions = np.concatenate(parts, axis=1)
    positions[100:180, 1] = np.nan
    order = rng.permutation(9)
    found = find_rigid_groups(positions[:, order])
    owners = np.array([0, 0, 0, 0, 1, 1, 1, 2, 2])[order]
    expected = [tuple(np.flatnonzero(owners == one).tolist()) for one in (0, 1)]
    assert found == sorted(expected)


def test_what_is_never_seen_together_is_no_body():
    positions = np.tile(SHAPE[:3], (60, 1, 1))
    positions[:30, 0] = np.nan
    positions[30:, 1:] = np.nan
    assert find_rigid_groups(positions) == []


def test_things_that_stand_still_far_apart_are_no_body():
    assert find_rigid_groups(np.tile(SHAPE[:3] * 20, (60, 1, 1))) == []
