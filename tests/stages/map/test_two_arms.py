import dataclasses

import numpy as np
import pytest

from besman.exceptions import MappingError, RobotError
from besman.records import HandTrajectory
from besman.robot.collision import distances_between, place_capsules
from besman.robot.kinematics import fill_frames
from besman.robot.limits import check_limits, resample_trajectory
from besman.robot.model import load_robot
from besman.stages.map.demonstration import MappingSettings
from besman.stages.map.two_arms import arms_distance, map_two_arms

RIGHT, LEFT = load_robot("rh5_right"), load_robot("rh5_left")
QUICK = MappingSettings(evaluations=40, yaw=False)


def carry(index, side, speed=1.0):
    """Both hands move a thing 0.15 m forward and up, 0.3 m apart."""
    time = np.linspace(0, 1.2 / speed, 61)
    u = time / time[-1]
    u = 10 * u**3 - 15 * u**4 + 6 * u**5
    start = np.array([0.35, 0.15 * side, -0.15 + 0.01 * index])
    path = start + np.outer(u, [0.1, 0.0, 0.12])
    poses = np.hstack([path, np.tile([1.0, 0, 0, 0], (61, 1))])
    return HandTrajectory(time, poses, f"a.tsv:{index}", "carry")


@pytest.fixture(scope="module")
def mappings():
    pairs = [[carry(index, side) for index in range(3)] for side in (-1, 1)]
    return map_two_arms((pairs[0], pairs[1]), (RIGHT, LEFT), QUICK)


def test_both_arms_do_the_same_demonstrations_at_the_same_time(mappings):
    right, left = mappings
    np.testing.assert_array_equal(right.placement, left.placement)
    assert [one.name for one in right.trajectories] == [one.name for one in left.trajectories]
    assert len(right.trajectories) == 3
    for first, second in zip(right.trajectories, left.trajectories, strict=True):
        assert first.time[-1] == pytest.approx(second.time[-1], rel=1e-6)
        apart = np.linalg.norm(first.poses[:, :3] - second.poses[:, :3], axis=1)
        np.testing.assert_allclose(apart, 0.3, atol=1e-9)
        assert arms_distance((RIGHT, LEFT), (first, second)) > 0
        for one, robot in ((first, RIGHT), (second, LEFT)):
            _, *dense = resample_trajectory(
                one.time, one.positions, one.velocities, one.accelerations
            )
            report = check_limits(robot, *dense)
            assert report.violations == report.self_collisions == 0


def test_distance_between_arms_agrees_with_points_on_the_capsules():
    rng = np.random.default_rng(0)
    rows = [
        rng.uniform(robot.limits.position_min, robot.limits.position_max, (5, robot.n))
        for robot in (RIGHT, LEFT)
    ]
    got = distances_between(RIGHT.chain, rows[0], LEFT.chain, rows[1])
    for moment in range(5):
        clouds = [
            surface(robot, angles[moment])
            for robot, angles in zip((RIGHT, LEFT), rows, strict=True)
        ]
        expected = min(
            np.linalg.norm(a[:, None] - b[None], axis=2).min() - r - s
            for a, r in clouds[0]
            for b, s in clouds[1]
        )
        assert got[moment] == pytest.approx(expected, abs=5e-3)
        assert got[moment] <= expected + 1e-12


def surface(robot, angles):
    """Points along the axis of every moving capsule, and its radius."""
    chain = robot.chain
    rotations, origins = np.empty((robot.n, 3, 3)), np.empty((robot.n, 3))
    placed = np.empty((len(chain.capsule_joints), 2, 3))
    fill_frames(chain.placements, chain.axes, angles, rotations, origins)
    place_capsules(chain.capsule_joints, chain.capsule_ends, rotations, origins, placed)
    share = np.linspace(0, 1, 101)[:, None]
    return [
        (ends[0] + share * (ends[1] - ends[0]), radius)
        for joint, ends, radius in zip(
            chain.capsule_joints, placed, chain.capsule_radii, strict=True
        )
        if joint >= 0
    ]


def test_arms_that_touch_each_other_are_a_failure_with_its_reason():
    same = [carry(0, 0.0)]
    with pytest.raises(MappingError, match=r"rh5_right and rh5_left; the first: a.tsv:0: "):
        map_two_arms((same, same), (RIGHT, LEFT), QUICK)


def test_demonstrations_that_do_not_belong_together():
    stranger = dataclasses.replace(carry(0, 1), name="b.tsv:0")
    with pytest.raises(MappingError, match="the two arms have no demonstration in common"):
        map_two_arms(([carry(0, -1)], [stranger]), (RIGHT, LEFT), QUICK)


def test_arms_at_different_moments_are_not_compared():
    with pytest.raises(RobotError, match=r"got positions of \(2,\) and \(3,\) moments"):
        distances_between(RIGHT.chain, np.zeros((2, 7)), LEFT.chain, np.zeros((3, 7)))
