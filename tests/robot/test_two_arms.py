"""Two arms of one robot: one world for both, and one in the way of the other."""

import numpy as np

from besman.robot.collision import distances
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot

LEFT, RIGHT = load_robot("rh5_left", "none"), load_robot("rh5_right", "none")
MIRROR = np.diag([1.0, -1.0, 1.0])


def mirrored(angles):
    """Turns about x and z change their sense in a mirror at y = 0, turns about y do not."""
    return angles * np.where(LEFT.chain.axes[:, 1] != 0, 1.0, -1.0)


def test_the_arms_are_mirror_images_in_one_world():
    rng = np.random.default_rng(0)
    limits = LEFT.limits
    angles = rng.uniform(limits.position_min, limits.position_max, (50, 7))
    left = forward_kinematics(LEFT.chain, angles)
    right = forward_kinematics(RIGHT.chain, mirrored(angles))
    np.testing.assert_allclose(right[:, :3, 3], left[:, :3, 3] @ MIRROR, atol=1e-12)
    assert LEFT.base_height == RIGHT.base_height


def test_the_published_lengths():
    shoulder, elbow, wrist = (
        LEFT.chain.placements[:count, :3, 3].sum(axis=0) for count in (1, 4, 6)
    )
    np.testing.assert_allclose(shoulder, [0, 0.313, 1.35])
    np.testing.assert_allclose(np.linalg.norm(elbow - shoulder), 0.355)
    np.testing.assert_allclose(np.linalg.norm(wrist - elbow), 0.386)


def test_the_other_arm_is_in_the_way():
    # The upper arm hangs turned in, the forearm forward and across the body, then further down.
    across = np.radians([0, -15, 0, -20, 0, 0, 0])
    free = np.radians([0, 20, 0, -20, 0, 0, 0])
    names = LEFT.chain.capsule_links
    others = {frozenset((names[a], names[b])) for a, b in LEFT.chain.capsule_pairs}
    assert frozenset(("left_wrist_yaw_link", "right_wrist_yaw_link")) in others
    assert distances(LEFT.chain, free)[0] > distances(LEFT.chain, across)[0]
