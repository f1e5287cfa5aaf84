import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from besman.robot.branches import IkWeights, draw_starts, find_branches, joint_box
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.robot.parts import Chain
from besman.robot.ur_kinematics import N_BRANCHES, read_geometry, solve_branches

ROBOTS = {name: load_robot(name, "stick_holder") for name in ("ur5", "ur10")}
angles = st.lists(st.floats(-3.1, 3.1), min_size=6, max_size=6).map(np.array)
names = st.sampled_from(sorted(ROBOTS))


def wrapped(difference):
    return np.abs((difference + np.pi) % (2 * np.pi) - np.pi)


def solve(robot, joints):
    geometry = read_geometry(robot.chain)
    poses = forward_kinematics(robot.chain, np.atleast_2d(joints))
    return poses, *solve_branches(geometry, poses, *joint_box(robot), robot.home)


@given(names, angles)
@settings(max_examples=300, deadline=None)
def test_every_branch_reaches_the_pose_within_the_limits(name, joints):
    robot = ROBOTS[name]
    poses, found, valid = solve(robot, joints)
    assert valid.any()
    reached = forward_kinematics(robot.chain, found[valid])
    np.testing.assert_allclose(reached, np.tile(poses[0], (valid.sum(), 1, 1)), atol=1e-6)
    low, high = joint_box(robot)
    assert np.all((found[valid] >= low) & (found[valid] <= high))


@given(names, angles)
@settings(max_examples=300, deadline=None)
def test_the_configuration_that_made_the_pose_is_among_them(name, joints):
    # Not where the pose leaves a joint open: stretched out, wrist or shoulder singular.
    joints[[2, 4]] = np.where(np.abs(np.sin(joints[[2, 4]])) < 0.01, 1.0, joints[[2, 4]])
    _, found, valid = solve(ROBOTS[name], joints)
    away = wrapped(found[valid] - joints).max(axis=1)
    assert away.min() < 1e-4


def test_all_eight_branches_are_there_and_the_numeric_search_finds_no_other():
    for robot in ROBOTS.values():
        poses, found, valid = solve(robot, robot.home + np.array([0.3, 0.1, -0.2, 0.2, 0.4, -0.3]))
        assert valid.all()
        apart = wrapped(found[0][:, None] - found[0][None]).max(axis=-1)
        assert np.all(apart[~np.eye(N_BRANCHES, dtype=bool)] > 0.05)
        weights = IkWeights(home=1e-6)
        for answer in find_branches(robot, poses[0], draw_starts(robot, 3), weights, False):
            reached = forward_kinematics(robot.chain, answer)
            if np.abs(reached - poses[0]).max() < 1e-5:
                assert wrapped(found[0] - answer).max(axis=1).min() < 1e-3


@pytest.mark.parametrize("last", [2.0, -2.0])
def test_a_joint_that_the_pose_leaves_open_stays_as_beside(last):
    # Joint 5 passes zero: there only the sum of joints 4 and 6 is told.
    robot = ROBOTS["ur5"]
    joints = np.tile([0.2, -1.4, 1.5, -0.7, 0.0, last], (5, 1))
    joints[3:, 4] = [0.1, 0.2]
    poses, found, valid = solve(robot, joints)
    reached = forward_kinematics(robot.chain, found)
    np.testing.assert_allclose(reached[valid], np.repeat(poses, valid.sum(1), 0), atol=1e-6)
    branch = wrapped(found[4] - joints[4]).max(axis=1).argmin()
    assert valid[:, branch].all()
    np.testing.assert_allclose(found[:, branch], joints, atol=1e-5)
    # The other way round the open joint comes after.
    _, found, valid = solve(robot, joints[::-1])
    np.testing.assert_allclose(found[:, branch], joints[::-1], atol=1e-5)


def test_what_cannot_be_reached_has_no_branch():
    robot = ROBOTS["ur5"]
    far = np.eye(4)
    far[:3, 3] = [3.0, 0.0, 1.0]
    # The wrist on the axis of the base: the arm's lateral offset keeps it away from there.
    geometry, close = read_geometry(robot.chain), np.eye(4)
    from_tip = np.linalg.solve(geometry.tip, np.r_[geometry.points[5], 1.0])
    close[:3, 3] = robot.chain.placements[0, :3, 3] - from_tip[:3]
    for pose in (far, close):
        _, valid = solve_branches(geometry, pose[None], *joint_box(robot), robot.home)
        assert not valid.any()


def test_full_turns_are_used_within_the_limits():
    robot = ROBOTS["ur5"]
    joints = np.array([5.5, -1.4, 1.5, -0.7, 1.0, -5.0])
    geometry, pose = read_geometry(robot.chain), forward_kinematics(robot.chain, joints[None])
    low, high = joint_box(robot)
    found, valid = solve_branches(geometry, pose, low, high, joints)
    assert np.abs(found[0][valid[0]] - joints).max(axis=1).min() < 1e-6
    _, none = solve_branches(geometry, pose, joints + 0.1, joints + 0.2, robot.home)
    assert not none.any()


def test_the_geometry_tells_which_arms_are_built_like_this():
    assert read_geometry(load_robot("iiwa7").chain) is None
    assert read_geometry(load_robot("compi").chain) is None
    chain, known = ROBOTS["ur5"].chain, 0
    rng = np.random.default_rng(0)
    for joint in range(6):
        for row in range(6):
            placements = np.array(chain.placements)
            placements[joint] = placements[joint] @ nudge(row)
            bent = Chain(**{**vars(chain), "placements": placements})
            geometry = read_geometry(bent)
            if geometry is not None:
                known += 1
                poses = forward_kinematics(bent, rng.uniform(-3, 3, (20, 6)))
                wide = np.full(6, 4.0)
                found, valid = solve_branches(geometry, poses, -wide, wide, np.zeros(6))
                assert valid.any(axis=1).all()
                reached = forward_kinematics(bent, found[valid])
                np.testing.assert_allclose(reached, np.repeat(poses, valid.sum(1), 0), atol=1e-6)
    # Joints 2 to 4 may not be tilted, axes 5 and 6 not be moved apart.
    assert 20 <= known <= 32


def nudge(row):
    """A shift along an axis, or a turn about it."""
    pose = np.eye(4)
    if row < 3:
        pose[row, 3] = 0.02
    else:
        pose[:3, :3] = Rotation.from_rotvec(0.2 * np.eye(3)[row - 3]).as_matrix()
    return pose
