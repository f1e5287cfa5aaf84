from dataclasses import replace

import numpy as np
import pytest

from besman.exceptions import PlanError
from besman.motion.joint_move import join_movements, least_time, move_straight
from besman.motion.rollout import least_duration, sample_plan
from besman.robot.collision import distances
from besman.robot.limits import check_limits


def with_jerk(robot, jerk):
    limits = replace(robot.limits, jerk=np.full(robot.n, float(jerk)))
    return replace(robot, limits=limits)


def is_derivative(values, rates, step_s=1e-3):
    """Hold rates against central differences, relative to the greatest."""
    middle = (values[2:] - values[:-2]) / (2 * step_s)
    return np.abs(middle - rates[1:-1]).max() < 1e-3 * max(np.abs(rates).max(), 1.0)


def test_a_move_is_one_from_rest_to_rest_within_its_limits(robots):
    robot = with_jerk(robots["ur5"], 60)
    goal = robot.home + np.array([0.8, -0.2, 0.3, 0.4, -0.5, 1.0])
    time, q, v, a = move_straight(robot, robot.home, goal, share=1.0)
    np.testing.assert_array_equal(q[0], robot.home)
    np.testing.assert_allclose(q[-1], goal, atol=1e-12)
    np.testing.assert_allclose([v[0], v[-1], a[0], a[-1]], 0, atol=1e-12)
    assert is_derivative(q, v)
    assert is_derivative(v, a)
    report = check_limits(robot, q, v, a)
    assert report.kept
    assert max(report.velocity_ratio, report.acceleration_ratio, report.jerk_ratio) > 0.97
    np.testing.assert_allclose(np.diff(time), 1e-3)


@pytest.mark.parametrize("jerk", [20, 500, 1e5])
def test_a_move_is_not_much_slower_than_the_fastest(robots, jerk):
    """The fastest, by ruckig: of a quintic 15/8 of it where the velocity decides, else less."""
    ruckig = pytest.importorskip("ruckig")
    robot, random = with_jerk(robots["ur5"], jerk), np.random.default_rng(0)
    for _ in range(10):
        way = random.uniform(-1, 1, robot.n)
        wanted = ruckig.InputParameter(robot.n)
        wanted.current_position, wanted.target_position = [0.0] * robot.n, list(way)
        wanted.max_velocity = list(robot.limits.velocity)
        wanted.max_acceleration = list(robot.limits.acceleration)
        wanted.max_jerk = list(robot.limits.jerk)
        wanted.synchronization = ruckig.Synchronization.Phase
        fastest = ruckig.Trajectory(robot.n)
        assert ruckig.Ruckig(robot.n).calculate(wanted, fastest) == ruckig.Result.Working
        assert 1.0 <= least_time(robot, way) / fastest.duration < 15 / 8 + 1e-6


def test_a_straight_move_touches_nothing_or_is_refused(robots):
    """By the distances of a look that is as dense as the samples at 1 kHz."""
    robot, random, n_refused = robots["ur5"], np.random.default_rng(1), 0
    for _ in range(12):
        goal = random.uniform(-np.pi, np.pi, robot.n)
        line = robot.home + np.linspace(0, 1, 2000)[:, None] * (goal - robot.home)
        least = distances(robot.chain, line).min()
        try:
            movement = move_straight(robot, robot.home, goal)
        except PlanError as error:
            assert "ur5 would touch itself, its pedestal or the floor, first after" in str(error)  # noqa: PT017
            assert least < 0.003
            n_refused += 1
            continue
        assert least > 0
        np.testing.assert_allclose(movement[1][[0, -1]], [robot.home, goal], atol=1e-12)
        assert check_limits(robot, *movement[1:]).kept
    assert 0 < n_refused < 12


def test_joined_movements_do_not_stop_and_keep_the_limits(robots, plan_of):
    robot = robots["ur5"]
    movements = [sample_plan(plan_of("joint_dmp", seed=seed)) for seed in (0, 1, 2)]
    (time, *joined), starts = join_movements(robot, movements, blend_s=0.2)
    (_, *apart), _ = join_movements(robot, movements, blend_s=0.0)
    assert len(joined[0]) < len(apart[0])
    assert check_limits(robot, *joined).kept
    assert is_derivative(joined[0], joined[1])
    speed = np.abs(joined[1]).max(axis=1)
    assert speed[50:-250].min() > np.abs(apart[1]).max(axis=1)[50:-250].min()
    np.testing.assert_allclose([joined[1][0], joined[1][-1]], 0, atol=1e-9)
    for start, movement in zip(starts, movements, strict=True):
        # Apart from its blended ends a movement is as it was.
        rows = round(1e3 * start) + np.arange(250, len(movement[0]) - 250)
        np.testing.assert_allclose(joined[0][rows], movement[1][250:-250], atol=1e-9)
    np.testing.assert_allclose(np.diff(time), 1e-3)


@pytest.mark.parametrize("kind", ["joint_dmp", "joint_dmp_velocity", "cartesian_dmp"])
def test_a_plan_keeps_the_jerk_that_a_robot_states(robots, plan_of, kind):
    plan, robot = plan_of(kind), with_jerk(robots["ur5"], 30)
    least = least_duration(plan, robot.limits, robot)
    assert least > least_duration(plan, robots["ur5"].limits, robot)
    if kind != "joint_dmp_velocity":
        slow = replace(plan, duration=1.01 * least)
        report = check_limits(robot, *sample_plan(slow, robot)[1:])
        assert report.jerk == 0
        assert report.jerk_ratio > 0.8
        fast = replace(plan, duration=0.9 * least)
        assert check_limits(robot, *sample_plan(fast, robot)[1:]).jerk > 0
