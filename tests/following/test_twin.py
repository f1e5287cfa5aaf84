"""The twin is where the hand is, and slows down where it cannot be."""

import numpy as np
import pytest

from besman.following.hand_placement import HandPlacement
from besman.following.twin import JointFilter, Twin
from besman.robot.inverse_kinematics import IkWeights
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits

pytest.importorskip("ruckig")


@pytest.fixture(scope="module")
def placement(robot):
    """The hand is the tool: what is asked of the one is asked of the other."""
    start = robot.home[None]
    return HandPlacement(np.eye(3), np.zeros(3), 1.0, np.eye(4), start, IkWeights(), False)


def poses_of(robot, positions):
    return forward_kinematics(robot.chain, positions)


def follow(twin, poses, step_s=0.01):
    given, away = [], []
    for pose in poses:
        twin.follow(pose, step_s)
        away.append(twin.away_m)
        given.append(twin.advance(round(1000 * step_s)))
    return [np.concatenate(parts) for parts in zip(*given, strict=True)], np.array(away)


def test_a_movement_that_the_arm_can_do_is_followed_closely(robot, placement):
    at = np.arange(300) * 0.01
    swing = np.outer(0.4 * (1 - np.cos(2 * np.pi * at / 3.0)), [1.0, 0.5, -0.5, 0.3, 0.3, 0.2])
    poses = poses_of(robot, robot.home + swing)
    samples, away = follow(Twin(robot, placement, poses[0]), poses)
    assert check_limits(robot, *samples).kept
    assert np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).max() / 0.01 > 0.25
    # While it moves at 0.3 m/s.
    assert away.max() < 2e-3


def test_what_the_arm_cannot_reach_is_pointed_at(robot, placement):
    start = poses_of(robot, robot.home[None])[0]
    far = np.tile(start, (250, 1, 1))
    far[:, :3, 3] += np.outer(np.linspace(0, 1, 250), [0.0, -2.0, 0.4])
    twin = Twin(robot, placement, start)
    samples, away = follow(twin, far)
    assert check_limits(robot, *samples).kept
    assert away[-1] > 0.5
    # And comes back.
    _, away = follow(twin, np.concatenate([far[::-1], np.tile(start, (100, 1, 1))]))
    assert away[-1] < 0.01


def test_what_would_touch_is_slid_along(robot, placement):
    """Into its pedestal and out again: the arm stays clear of it, goes along it and comes back."""
    start = poses_of(robot, robot.home[None])[0]
    way = np.tile(start, (400, 1, 1))
    at = np.interp(np.arange(400), [0, 150, 250, 400], [0, 1, 1, 0])[:, None]
    way[:, :3, 3] += at * ([0.0, 0.0, 0.7] - start[:3, 3])
    twin = Twin(robot, placement, start)
    aimed, given = [], []
    for pose in np.concatenate([way, np.tile(start, (50, 1, 1))]):
        aimed.append(twin.follow(pose, 0.01))
        given.append(twin.advance(10))
    assert np.mean(aimed) > 0.95
    report = check_limits(robot, *(np.concatenate(parts) for parts in zip(*given, strict=True)))
    assert report.kept
    assert report.least_distance < 0.02
    assert twin.away_m < 0.01


def test_the_filter_tells_the_speed_of_what_moves_evenly():
    joints = JointFilter(0.02)
    speed = np.array([0.5, -1.0])
    for k in range(60):
        place, found = joints.update(k * 0.01 * speed, 0.01)
    np.testing.assert_allclose(place, 59 * 0.01 * speed, atol=1e-6)
    np.testing.assert_allclose(found, speed, atol=1e-6)


def test_the_filter_takes_noise_away():
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(2000, 1))
    joints = JointFilter(0.02)
    kept = np.array([joints.update(one, 0.01)[0] for one in noise])
    # Brookner's variance reduction of a critically damped g-h filter, equation (1.2-21).
    theta = np.exp(-0.5)
    expected = (1 - theta) / (1 + theta) ** 3 * (1 + 4 * theta + 5 * theta**2)
    assert kept[100:].var() == pytest.approx(expected, rel=0.15)
