import numpy as np
import pytest

from besman.robot.body_balls import group_pairs
from besman.robot.collision import distances, first_falling, place_capsules
from besman.robot.kinematics import fill_frames
from besman.robot.model import load_robot
from besman.robot.nearest_pair import nearest_parts
from besman.robot.path_refinement import fill_slope

SAFE_M = 0.015


def shortfall_and_slope(robot, angles):
    chain, n = robot.chain, robot.n
    rotations, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    placed = np.empty((len(chain.capsule_joints), 2, 3))
    fill_frames(chain.placements, chain.axes, angles, rotations, origins)
    place_capsules(chain.capsule_joints, chain.capsule_ends, rotations, origins, placed)
    slope = np.full(n, np.nan)
    capsules = chain.capsule_joints, chain.capsule_radii, chain.capsule_pairs
    bodies = group_pairs(capsules[0], chain.capsule_ends, *capsules[1:])
    falling = first_falling(chain.placements, chain.axes)
    own, floor, pair, down = nearest_parts(
        capsules[0], placed, *capsules[1:], bodies, -1, SAFE_M, falling
    )
    short = max(0.0, 1.0 - min(own, floor) / SAFE_M)
    part = np.array([pair, -1] if own <= floor else [-1, down]) if short > 0 else np.array([-1, -1])
    fill_slope(
        chain.axes, chain.capsule_joints, chain.capsule_pairs, rotations, origins, placed, part,
        slope,
    )  # fmt: skip
    return short, slope


def by_distances(robot, angles):
    return max(0.0, 1.0 - distances(robot.chain, angles).min() / SAFE_M)


@pytest.mark.parametrize(("name", "side"), [("ur5", 0), ("iiwa7", 0), ("compi", 0), ("ur10", 1)])
def test_the_slope_of_nearness_is_that_of_finite_differences(name, side):
    robot = load_robot(name, "stick_holder")
    low, high = robot.limits.position_min, robot.limits.position_max
    rows = np.random.default_rng(0).uniform(low, high, (3000, robot.n))
    # Near to itself, or nearer to the floor.
    found = distances(robot.chain, rows)
    chosen = rows[(found.min(axis=1) < SAFE_M) & (found.argmin(axis=1) == side)][:15]
    assert len(chosen) == 15
    step = 1e-7
    for angles in chosen:
        short, slope = shortfall_and_slope(robot, angles)
        assert short == pytest.approx(by_distances(robot, angles), abs=1e-12)
        expected = [
            (by_distances(robot, angles + way) - by_distances(robot, angles - way)) / (2 * step)
            for way in step * np.eye(robot.n)
        ]
        np.testing.assert_allclose(slope, expected, rtol=1e-3, atol=1e-3)


def test_far_from_itself_there_is_no_slope():
    robot = load_robot("ur5", "stick_holder")
    short, slope = shortfall_and_slope(robot, np.array(robot.home))
    assert short == 0.0
    np.testing.assert_array_equal(slope, 0.0)
