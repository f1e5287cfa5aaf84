import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from besman.evaluation import approximate_ik as benchmark
from besman.evaluation.approximate_ik import (
    GOAL,
    LIMIT_RAD,
    OBSTACLES,
    START,
    VIA_POINTS,
    ArmFunction,
    end_angles,
    iiwa14,
    obstacle_rewards,
    via_point_rewards,
)
from besman.robot.kinematics import forward_kinematics


def test_the_arm_is_the_published_one():
    """Angles and lengths by a second way: rotations one after another."""
    random = np.random.default_rng(0)
    for angles in random.uniform(-1, 1, (20, 7)) * LIMIT_RAD:
        pose, place = Rotation.identity(), np.zeros(3)
        lengths = (0.1575, 0.2025, 0.2045, 0.2155, 0.1845, 0.2155, 0.081)
        signs = (1, 1, 1, -1, 1, 1, 1)
        for angle, length, axis, sign in zip(angles, lengths, "zyzyzyz", signs, strict=True):
            place = place + pose.apply([0, 0, length])
            pose = pose * Rotation.from_euler(axis, sign * angle)
        found = forward_kinematics(iiwa14(), angles)
        np.testing.assert_allclose(found[:3, 3], place, atol=1e-12)
        np.testing.assert_allclose(found[:3, :3], pose.as_matrix(), atol=1e-12)
    assert forward_kinematics(iiwa14(), np.zeros(7))[2, 3] == pytest.approx(0.36 + 0.42 + 0.481)


def test_the_ends_are_reached_within_the_limits():
    for angles, pose in zip(end_angles(), (START, GOAL), strict=True):
        found = forward_kinematics(iiwa14(), angles)
        np.testing.assert_allclose(found[:3, 3], pose[:3], atol=1e-4)
        np.testing.assert_allclose(found[:3, :3], np.diag([1, -1, -1]), atol=1e-3)
        assert (np.abs(angles) <= LIMIT_RAD).all()


def brute_rates(positions, velocity, acceleration):
    cost, before, speed_before = 0.0, positions[0], np.zeros(positions.shape[1])
    for here in positions:
        speed = (here - before) / 0.01
        cost += velocity * np.linalg.norm(speed)
        cost += acceleration * np.linalg.norm((speed - speed_before) / 0.01)
        before, speed_before = here, speed
    return cost


def test_rewards_term_by_term():
    random = np.random.default_rng(1)
    positions, tips = random.normal(size=(2, 101, 7)), random.normal(size=(2, 101, 3))
    via, obstacles = via_point_rewards(positions, tips), obstacle_rewards(positions, tips)
    for at in range(2):
        missed = sum(
            np.linalg.norm(tips[at, index] - point)
            for index, point in zip((0, 10, 45, 55, 100), VIA_POINTS, strict=True)
        )
        assert via[at] == pytest.approx(-100 * missed - brute_rates(positions[at], 1e-4, 1e-5))
        entered = sum(
            max(0, 1 - np.linalg.norm(tip - centre) / 0.17)
            for tip in tips[at]
            for centre in OBSTACLES
        )
        cost = 100 * np.linalg.norm(tips[at, -1] - GOAL[:3]) + 10 * entered
        assert obstacles[at] == pytest.approx(-cost - brute_rates(positions[at], 0.01, 1e-5))
    assert OBSTACLES.shape == (9, 3)


@pytest.mark.parametrize("policy", ["cartesian", "joint"])
def test_without_weights_the_arm_goes_from_start_to_goal(policy):
    function = ArmFunction("via_points", policy)
    assert function.dimension == {"cartesian": 300, "joint": 350}[policy]
    positions = function.move(np.zeros((1, function.dimension)))
    tips = forward_kinematics(iiwa14(), positions[0])[:, :3, 3]
    np.testing.assert_allclose(tips[0], START[:3], atol=1e-3)
    # The spring lags behind by a centimetre.
    np.testing.assert_allclose(tips[-1], GOAL[:3], atol=0.011)


def test_inverse_kinematics_cares_for_the_position_first():
    function = ArmFunction("via_points", "cartesian")
    point = np.zeros((1, 300))
    point[0, 150:] = 100 * np.random.default_rng(0).standard_normal(150)
    positions = function.move(point)
    tips = forward_kinematics(iiwa14(), positions[0])[:, :3, 3]
    straight = forward_kinematics(iiwa14(), function.move(np.zeros((1, 300)))[0])[:, :3, 3]
    # Where it must choose, an orientation that is wrong by 1 rad is worth a millimetre or two.
    assert np.abs(tips - straight).max() < 0.03


@pytest.mark.parametrize("policy", ["cartesian", "joint"])
def test_each_reward_is_what_it_is_alone_and_limits_hold(policy):
    function = ArmFunction("obstacles", policy)
    points = 300 * np.random.default_rng(2).standard_normal((3, function.dimension))
    together = function(points)
    np.testing.assert_allclose([function(one[None])[0] for one in points], together, rtol=1e-9)
    assert (np.abs(function.move(points)) <= LIMIT_RAD + 1e-12).all()


@pytest.mark.slow
def test_the_bar_of_the_via_points():
    from besman.evaluation.refinement import evaluate_refinement
    from besman.evaluation.refinement_problems import load_problem

    (row,) = evaluate_refinement([load_problem("via_points")], ["cma_es"], [100])["rows"]
    reached = row["final_reward"]["mean"]
    assert reached > -5.5
    (_, _), (public, error) = benchmark.PUBLIC["via_points", "cartesian"]
    assert reached > public + error
