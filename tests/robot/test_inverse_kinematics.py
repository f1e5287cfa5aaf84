import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from besman.exceptions import RobotError
from besman.robot.inverse_kinematics import IkWeights, follow_all, joint_box, solve_path
from besman.robot.kinematics import forward_kinematics, jacobian
from besman.robot.model import load_robot

ROBOT = load_robot("ur5", "stick_holder")


def push(start=(0.2, -0.4, 1.2), way=(0.35, 0.1, 0.15), n_poses=40):
    u = np.linspace(0, 1, n_poses)
    u = 10 * u**3 - 15 * u**4 + 6 * u**5
    poses = np.tile(np.eye(4), (n_poses, 1, 1))
    poses[:, :3, 3] = np.array(start) + np.outer(u, way)
    poses[:, :3, :3] = Rotation.from_rotvec(
        np.radians(60 + 40 * u)[:, None] * [0, 1, 0]
    ).as_matrix()
    return poses


def test_a_reachable_path_is_followed_without_jumps():
    path = solve_path(ROBOT, push())
    assert path.position_error.max() < 1e-4
    assert np.degrees(path.orientation_error.max()) < 0.2
    assert np.abs(np.diff(path.positions, axis=0)).max() < 0.3
    reached = forward_kinematics(ROBOT.chain, path.positions)
    error = np.linalg.norm(reached[:, :3, 3] - push()[:, :3, 3], axis=1)
    np.testing.assert_allclose(error, path.position_error, atol=1e-12)


def test_the_spin_about_the_tool_can_be_free():
    turned = push()
    spin = Rotation.from_rotvec(np.linspace(0, 6, len(turned))[:, None] * [0, 0, 1]).as_matrix()
    turned[:, :3, :3] = turned[:, :3, :3] @ spin
    path = solve_path(ROBOT, turned, free_spin=True)
    plain = solve_path(ROBOT, push(), free_spin=True)
    np.testing.assert_allclose(path.positions, plain.positions, atol=1e-4)
    reached = forward_kinematics(ROBOT.chain, path.positions)
    cosine = np.sum(reached[:, :3, 2] * turned[:, :3, 2], axis=1)
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1)).max()) < 0.2


def test_position_comes_before_orientation_when_both_cannot_be_had():
    # At the end of its reach the arm cannot turn the tool back towards the base.
    poses = push(start=(1.0, 0.0, 1.1), way=(0.03, 0.0, 0.0))
    poses[:, :3, :3] = Rotation.from_euler("y", -90, degrees=True).as_matrix()
    even = solve_path(ROBOT, poses, weights=IkWeights(orientation=1.0))
    careful = solve_path(ROBOT, poses, weights=IkWeights(orientation=0.03))
    assert careful.position_error.max() < 0.3 * even.position_error.max()
    assert careful.orientation_error.max() > even.orientation_error.max()
    assert careful.position_error.max() < 0.02


def test_the_answer_is_a_minimum_as_another_solver_finds_it():
    weights = IkWeights()
    target = np.eye(4)
    target[:3, 3] = [1.3, 0.2, 1.4]
    target[:3, :3] = Rotation.from_euler("y", 70, degrees=True).as_matrix()
    low, high = joint_box(ROBOT)

    def residuals(angles):
        pose = forward_kinematics(ROBOT.chain, angles)
        turn = Rotation.from_matrix(target[:3, :3] @ pose[:3, :3].T).as_rotvec()
        away = weights.home * (angles - ROBOT.home)
        return np.r_[target[:3, 3] - pose[:3, 3], weights.orientation * turn, away]

    found, _ = follow_all(
        ROBOT, target[None, None], ROBOT.home[None], 0, weights, False, rounds=200, tolerance=0.0
    )
    cost = np.sum(residuals(found[0, 0, 0]) ** 2)
    peer = least_squares(residuals, ROBOT.home, bounds=(low, high), xtol=1e-14, ftol=1e-14)
    assert cost <= 2 * peer.cost * (1 + 1e-3)
    assert cost > 0.01


def test_joint_limits_hold():
    low, high = joint_box(ROBOT)
    far = push(start=(-0.6, 0.6, 0.4), way=(1.0, -1.0, 0.8))
    path = solve_path(ROBOT, far)
    assert np.all(path.positions >= low)
    assert np.all(path.positions <= high)


def test_the_same_path_gives_the_same_answer():
    first, second = solve_path(ROBOT, push()), solve_path(ROBOT, push())
    np.testing.assert_array_equal(first.positions, second.positions)


def test_faster_branches_are_preferred_when_time_matters():
    poses = push()
    calm = solve_path(ROBOT, poses, step_s=0.01, weights=IkWeights(stretch=1.0))
    any_branch = solve_path(ROBOT, poses)
    speed = [np.abs(np.diff(path.positions, axis=0)).max() for path in (calm, any_branch)]
    assert speed[0] <= speed[1] + 1e-9


def test_half_a_turn_away_is_found():
    poses = push()[:1]
    start = solve_path(ROBOT, poses).positions[0]
    axis = forward_kinematics(ROBOT.chain, start)
    flipped = axis.copy()
    flipped[:3, :3] = axis[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    for free_spin in (False, True):
        _, errors = follow_all(
            ROBOT, flipped[None, None], start[None], 0, IkWeights(), free_spin,
            rounds=300, tolerance=0.0,
        )  # fmt: skip
        assert errors[0, 0, 0, 1] < np.pi - 0.5
    assert np.linalg.matrix_rank(jacobian(ROBOT.chain, start)) == 6


def test_poses_that_cannot_be_used():
    with pytest.raises(RobotError, match=r"must have shape \(T, 4, 4\) .* got \(3, 7\)"):
        solve_path(ROBOT, np.zeros((3, 7)))
    bad = push()
    bad[3, 0, 3] = np.nan
    with pytest.raises(RobotError, match="poses must be finite"):
        solve_path(ROBOT, bad)
