import numpy as np
import pytest

from besman.robot.collision import distances, place_capsules
from besman.robot.kinematics import fill_frames
from besman.robot.model import load_robot
from besman.robot.path_refinement import fill_slope

SAFE_M = 0.015


def shortfall_and_slope(robot, angles):
    chain, n = robot.chain, robot.n
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    placed = np.empty((len(chain.capsule_joints), 2, 3))
    fill_frames(chain.placements, chain.axes, angles, rotations, origins)
    place_capsules(chain.capsule_joints, chain.capsule_ends, rotations, origins, placed)
    slope = np.full(n, np.nan)
    short = fill_slope(
        chain.axes, chain.capsule_joints, chain.capsule_radii, chain.capsule_pairs,
        rotations, origins, placed, slope,
    )  # fmt: skip
    return short, slope


def by_distances(robot, angles):
    return max(0.0, 1.0 - distances(robot.chain, angles).min() / SAFE_M)


@pytest.mark.parametrize("name", ["ur5", "iiwa7", "compi"])
def test_the_slope_of_nearness_is_that_of_finite_differences(name):
    robot = load_robot(name, "stick_holder")
    low, high = robot.limits.position_min, robot.limits.position_max
    rows = np.random.default_rng(0).uniform(low, high, (3000, robot.n))
    own, floor = distances(robot.chain, rows).T
    touching = rows[(own < SAFE_M) & (own < floor)][:15]
    assert len(touching) == 15
    step = 1e-7
    for angles in touching:
        short, slope = shortfall_and_slope(robot, angles)
        assert short == pytest.approx(by_distances(robot, angles), abs=1e-12)
        expected = [
            (by_distances(robot, angles + way) - by_distances(robot, angles - way)) / (2 * step)
            for way in step * np.eye(robot.n)
        ]
        np.testing.assert_allclose(slope, expected, rtol=1e-3, atol=1e-3)


def test_the_slope_near_the_floor():
    robot = load_robot("ur5", "stick_holder")
    # Stretched out, with its tool a centimetre above the floor or in it.
    angles = np.array(robot.home)
    for shoulder in np.linspace(-np.pi, np.pi, 2000):
        angles = np.array([0.3, shoulder, 0.05, 0.1, 0.2, 0.1])
        own, floor = distances(robot.chain, angles)
        if floor < own and 0.0 < floor < SAFE_M:
            break
    else:
        pytest.fail("no such pose")
    _, slope = shortfall_and_slope(robot, angles)
    ways = 1e-7 * np.eye(robot.n)
    expected = [
        (by_distances(robot, angles + way) - by_distances(robot, angles - way)) / 2e-7
        for way in ways
    ]
    np.testing.assert_allclose(slope, expected, rtol=1e-3, atol=1e-3)


def test_far_from_itself_there_is_no_slope():
    robot = load_robot("ur5", "stick_holder")
    short, slope = shortfall_and_slope(robot, np.array(robot.home))
    assert short == 0.0
    np.testing.assert_array_equal(slope, 0.0)
