"""The compiled solver against scipy's rotations and against the arm's own forward kinematics."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.robot.ik_kernel import follow_paths, pose_error, remove_spin
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot

ROBOT = load_robot("iiwa7")
CHAIN = ROBOT.chain
LOW, HIGH = np.array(ROBOT.limits.position_min), np.array(ROBOT.limits.position_max)
WEIGHTS = np.array([1.0, 0.2, 1e-6])
ARM = CHAIN.placements, CHAIN.axes, CHAIN.tip, LOW, HIGH


def pose(seed):
    random = np.random.default_rng(seed)
    result = np.eye(4)
    result[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    result[:3, 3] = random.normal(size=3)
    return result


@pytest.mark.parametrize("seed", range(5))
def test_the_error_is_the_way_and_the_rotation_vector_between_poses(seed):
    here, there, error = pose(seed), pose(seed + 50), np.empty(6)
    pose_error(here, there, False, error)
    np.testing.assert_allclose(error[:3], there[:3, 3] - here[:3, 3])
    turn = Rotation.from_matrix(there[:3, :3] @ here[:3, :3].T).as_rotvec()
    np.testing.assert_allclose(error[3:], turn, atol=1e-9)


def test_without_spin_only_the_angle_of_the_tools_axes_counts():
    here, there, error = pose(1), pose(2), np.empty(6)
    pose_error(here, there, True, error)
    between = np.arccos(here[:3, 2] @ there[:3, 2])
    assert np.linalg.norm(error[3:]) == pytest.approx(between)
    np.testing.assert_allclose(
        Rotation.from_rotvec(error[3:]).apply(here[:3, 2]), there[:3, 2], atol=1e-9
    )
    spun = there.copy()
    spun[:3, :3] = there[:3, :3] @ Rotation.from_rotvec([0, 0, 1.1]).as_matrix()
    again = np.empty(6)
    pose_error(here, spun, True, again)
    np.testing.assert_allclose(again, error, atol=1e-12)


def test_half_a_turn_is_no_rest():
    here, there, error = np.eye(4), np.diag([1.0, -1.0, -1.0, 1.0]), np.empty(6)
    pose_error(here, there, False, error)
    assert np.linalg.norm(error[3:]) == pytest.approx(np.pi)


def test_spin_is_taken_out_of_a_jacobian():
    here, jacobian = pose(3), np.random.default_rng(0).normal(size=(6, 7))
    before = jacobian.copy()
    remove_spin(jacobian, here)
    axis = here[:3, 2]
    np.testing.assert_allclose(axis @ jacobian[3:], 0.0, atol=1e-12)
    np.testing.assert_allclose(
        before[3:] - jacobian[3:], np.outer(axis, axis @ before[3:]), atol=1e-12
    )
    np.testing.assert_array_equal(jacobian[:3], before[:3])


def test_a_pose_is_met_from_nearby():
    goal = ROBOT.home + np.random.default_rng(1).uniform(-0.4, 0.4, ROBOT.n)
    target = forward_kinematics(CHAIN, goal)[None, None]
    home = np.array(ROBOT.home)
    positions, errors = follow_paths(
        *ARM, home, WEIGHTS, False, target, home[None].copy(), 0, 100, 1e-12
    )
    assert errors.max() < 1e-3
    np.testing.assert_allclose(forward_kinematics(CHAIN, positions[0, 0]), target[0], atol=1e-4)
    assert (positions >= LOW).all()
    assert (positions <= HIGH).all()


def test_a_path_is_followed_from_its_anchor_to_both_ends_without_a_jump():
    ways = np.linspace(-0.3, 0.3, 11)[:, None] * np.linspace(1.0, 0.2, ROBOT.n)
    targets = forward_kinematics(CHAIN, ROBOT.home + ways)
    positions, errors = follow_paths(
        *ARM, np.array(ROBOT.home), WEIGHTS, False, targets[None], ROBOT.home[None].copy(), 5,
        60, 1e-10,
    )  # fmt: skip
    assert positions.shape == (1, 1, 11, ROBOT.n)
    assert errors.max() < 1e-3
    np.testing.assert_allclose(forward_kinematics(CHAIN, positions[0, 0]), targets, atol=1e-3)
    assert np.abs(np.diff(positions[0, 0], axis=0)).max() < 0.2


def test_a_pose_that_is_met_well_enough_is_left_there():
    ways = np.sin(np.linspace(-1.0, 1.0, 60))[:, None] * np.linspace(0.5, 0.2, ROBOT.n)
    targets = forward_kinematics(CHAIN, ROBOT.home + ways)
    start = (ROBOT.home + ways[:1]).copy()
    # As good as no pull towards home, which is no error of the pose.
    weights = np.array([1.0, 0.1, 1e-6])
    greatest = []
    for enough in (0.0, 1e-4):
        _, errors = follow_paths(
            *ARM, np.array(ROBOT.home), weights, False, targets[None], start, 0, 60, 1e-10, enough
        )
        greatest.append(np.linalg.norm(errors, axis=-1).max())
    assert greatest[0] < 1e-6 < greatest[1] <= 1e-4
