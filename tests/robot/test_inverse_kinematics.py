import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from besman.exceptions import RobotError
from besman.robot.collision import distances
from besman.robot.inverse_kinematics import IkWeights, follow_all, joint_box, solve_path
from besman.robot.kinematics import forward_kinematics, jacobian
from besman.robot.model import load_robot
from besman.robot.path_refinement import refine_path

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


def smooth_joints(rng, robot, n_poses=100):
    """A smooth path in joint space within the limits, clear of itself, ways of up to 1.5 rad."""
    low, high = joint_box(robot)
    u = np.linspace(0, 1, n_poses)
    shapes = np.stack([np.ones_like(u), u, np.sin(2 * u + 1), np.cos(3 * u)], axis=1)
    while True:
        joints = shapes @ rng.uniform(-0.5, 0.5, (4, robot.n)) + robot.home
        clear = distances(robot.chain, joints).min() > 0.03
        if clear and np.all((joints > low) & (joints < high)):
            return joints


@pytest.mark.parametrize("name", ["ur5", "ur10", "compi", "iiwa7"])
@pytest.mark.parametrize("free_spin", [False, True])
def test_random_smooth_paths_are_followed_without_jumps(name, free_spin):
    robot = load_robot(name, "stick_holder")
    rng = np.random.default_rng(1)
    low, high = joint_box(robot)
    for _ in range(4):
        joints = smooth_joints(rng, robot)
        path = solve_path(robot, forward_kinematics(robot.chain, joints), free_spin=free_spin)
        assert path.position_error.max() < 2e-3
        assert path.orientation_error.max() < 0.03
        asked = np.abs(np.diff(joints, axis=0)).max()
        assert np.abs(np.diff(path.positions, axis=0)).max() < max(0.12, 4 * asked)
        assert np.all((path.positions >= low) & (path.positions <= high))


@pytest.mark.parametrize("closest", [0.0, 0.003, 0.03])
def test_a_path_past_a_singular_wrist_does_not_jump(closest):
    # Joint 5 goes through zero or turns just before it.
    u = np.linspace(-1, 1, 101)
    joints = np.tile([0.2, -1.4, 1.5, -0.7, 0.0, 0.3], (101, 1))
    joints[:, 4] = 0.5 * u if closest == 0.0 else np.hypot(0.5 * u, closest)
    joints[:, 0] += 0.4 * u
    poses = forward_kinematics(ROBOT.chain, joints)
    path = solve_path(ROBOT, poses, step_s=0.02)
    assert path.position_error.max() < 5e-3
    assert path.orientation_error.max() < 0.1
    assert np.abs(np.diff(path.positions, axis=0)).max() < 0.15


def test_what_cannot_be_turned_to_does_not_draw_the_position_off():
    # COMPI's wrist turns by 120 degrees: a tool that points back at the arm is out of its range.
    robot = load_robot("compi", "gripper")
    start = forward_kinematics(robot.chain, robot.home)
    poses = np.tile(start, (30, 1, 1))
    poses[:, 1, 3] += np.linspace(-0.1, 0.1, 30)
    turn = Rotation.from_rotvec(np.linspace(0, 2.8, 30)[:, None] * start[:3, 0]).as_matrix()
    poses[:, :3, :3] = turn @ start[:3, :3]
    path = solve_path(robot, poses, step_s=0.05)
    assert path.orientation_error.max() > 0.3
    assert path.position_error.max() < 0.02
    np.testing.assert_array_equal(path.positions, solve_path(robot, poses, step_s=0.05).positions)


def test_the_refined_path_is_a_minimum_as_another_solver_finds_it():
    from besman.robot import path_smoothness as smoothness
    from besman.robot.path_refinement import LINEAR_RAD

    rng = np.random.default_rng(4)
    joints = smooth_joints(rng, ROBOT, 8)
    poses = forward_kinematics(ROBOT.chain, joints)
    poses[3, :3, 3] += 0.02
    speed, pull = ROBOT.limits.velocity, ROBOT.limits.acceleration
    low, high = joint_box(ROBOT)
    weights = np.array([1.0, 0.1, 1e-3])
    found, errors = refine_path(
        ROBOT.chain, poses, joints, (low, high), weights, ROBOT.home, False, (speed, pull),
        rounds=300, tolerance=0.0,
    )  # fmt: skip

    def residuals(flat):
        angles = flat.reshape(8, 6)
        reached = forward_kinematics(ROBOT.chain, angles)
        turn = poses[:, :3, :3] @ np.swapaxes(reached[:, :3, :3], 1, 2)
        return np.concatenate(
            [
                (poses[:, :3, 3] - reached[:, :3, 3]).ravel(),
                (0.1 * Rotation.from_matrix(turn).as_rotvec()).ravel(),
                (1e-3 * (angles - ROBOT.home)).ravel(),
                (smoothness._SPEED_M * np.diff(angles, axis=0) / speed).ravel(),
                (smoothness._PULL_M * np.diff(angles, 2, axis=0) / pull).ravel(),
            ]
        )

    # Nothing here is fast or near enough, nor turned so far, that other terms would count.
    assert errors[:, 1].max() < LINEAR_RAD
    peer = least_squares(residuals, joints.ravel(), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    cost = np.sum(residuals(found.ravel()) ** 2)
    assert cost == pytest.approx(2 * peer.cost, rel=1e-4)
    np.testing.assert_allclose(found, peer.x.reshape(8, 6), atol=1e-3)


def test_an_arm_is_kept_clear_of_itself():
    # The stick holder comes to the upper arm on this way; the joints themselves touch.
    robot = load_robot("compi", "gripper")
    joints = np.tile(robot.home, (40, 1))
    joints[:, 2] = np.radians(np.linspace(-90, -168, 40))
    poses = forward_kinematics(robot.chain, joints)
    assert distances(robot.chain, joints).min() < 0
    path = solve_path(robot, poses, step_s=0.05)
    assert distances(robot.chain, path.positions).min() > 0
