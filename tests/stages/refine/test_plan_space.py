from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from besman.motion.dmp import roll_out
from besman.motion.dmp_fit import fit_weights
from besman.motion.rollout import least_duration
from besman.robot.limits import check_limits
from besman.stages.refine.plan_space import PlanSpace, Units

ALL = ("start", "goal", "duration", "weights")


def test_the_origin_is_the_imitation(robot, make_plan):
    plan = make_plan(0.9)
    space = PlanSpace(plan, robot.limits, ALL, 3)
    assert space.dimension == 6 + 6 + 1 + 18
    same = space.plan_at(np.zeros(31))
    np.testing.assert_array_equal(same.weights, plan.weights)
    np.testing.assert_array_equal(same.goal, plan.goal)
    assert same.duration == plan.duration


@given(st.integers(0, 10_000), st.floats(0.1, 30))
@example(1629, 1.0)
@settings(max_examples=15, deadline=None)
def test_every_plan_keeps_velocity_and_acceleration(robot, make_plan, seed, spread):
    space = PlanSpace(make_plan(0.1), robot.limits, ALL, 6)
    point = spread * np.random.default_rng(seed).normal(size=space.dimension)
    # Slower than need be is what a point above asks for.
    slower = space.coordinates(("duration",))
    point[slower] = -np.abs(point[slower])
    plan = space.plan_at(point)
    time = np.arange(0, plan.duration + 1e-3, 1e-3)
    movement = roll_out(plan.weights, plan.start, plan.goal, plan.duration, time)
    report = check_limits(robot, *movement)
    assert (report.velocity, report.acceleration) == (0, 0)
    # No slower than need be: a little faster would be beyond a limit.
    if plan.duration > 1.0:
        faster = 0.99 * plan.duration
        movement = roll_out(plan.weights, plan.start, plan.goal, faster, np.arange(0, faster, 1e-3))
        report = check_limits(robot, *movement)
        assert max(report.velocity_ratio, report.acceleration_ratio) > 1


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_every_plan_starts_and_ends_at_rest(robot, make_plan, seed):
    space = PlanSpace(make_plan(0.6), robot.limits, ALL, 4)
    plan = space.plan_at(3 * np.random.default_rng(seed).normal(size=space.dimension))
    ends = np.array([0, plan.duration])
    assert np.abs(plan.start - make_plan(0.6).start).min() > 0
    q, v, a = roll_out(plan.weights, plan.start, plan.goal, plan.duration, ends)
    np.testing.assert_allclose(q, [plan.start, plan.goal], atol=1e-8)
    np.testing.assert_allclose(v, 0, atol=1e-7)
    np.testing.assert_allclose(a, 0, atol=1e-4)


def test_another_movement_is_projected_to_a_plan_that_is_like_it(robot, make_plan):
    """Whatever its number of weights; one of the space itself to its own point."""
    space = PlanSpace(make_plan(3.0), robot.limits, ALL, 4)
    point = 0.3 * np.random.default_rng(0).normal(size=space.dimension)
    moved = space.plan_at(point)
    np.testing.assert_allclose(space.project(moved), point, atol=1e-8)
    time = np.linspace(0, moved.duration, 200)
    path = roll_out(moved.weights, moved.start, moved.goal, moved.duration, time)[0]
    finer = replace(moved, weights=fit_weights(time, path, 30))
    np.testing.assert_allclose(space.project(finer), point, atol=1e-2)


def test_start_and_goal_moved_alike_move_all_of_the_movement(robot, make_plan):
    plan = make_plan(0.9)
    space = PlanSpace(plan, robot.limits, ("start", "goal"), 1, Units(start_rad=0.2, goal_rad=0.2))
    change = np.arange(6.0) / 10
    moved = space.plan_at(np.concatenate([change, change]))
    time = np.linspace(0, 0.9, 101)
    paths = [roll_out(x.weights, x.start, x.goal, 0.9, time)[0] for x in (plan, moved)]
    np.testing.assert_allclose(paths[1] - paths[0], np.tile(0.2 * change, (101, 1)), atol=1e-10)


@given(st.integers(0, 10_000), st.sampled_from([("start", "goal", "duration"), ALL]))
@settings(max_examples=30, deadline=None)
def test_what_could_keep_its_limits_keeps_them(robot, make_plan, seed, parts):
    plan = make_plan(0.9)
    low, high = plan.start.min() - 0.4, plan.start.max() + 0.6
    limits = replace(robot.limits, position_min=np.full(6, low), position_max=np.full(6, high))
    space = PlanSpace(plan, limits, parts, 2)
    point = 4 * np.random.default_rng(seed).normal(size=space.dimension)
    moved = space.plan_at(point)
    time = np.linspace(0, moved.duration, 2001)
    path = roll_out(moved.weights, moved.start, moved.goal, moved.duration, time)[0]
    fits = np.ptp(path, axis=0) < high - low - 0.005
    assert fits.any()
    assert (path[:, fits] > low).all()
    assert (path[:, fits] < high).all()
    # The movement itself is as it would be without limits.
    free = PlanSpace(
        plan,
        replace(limits, position_min=np.full(6, -99.0), position_max=np.full(6, 99.0)),
        parts,
        2,
    ).plan_at(point)
    same = roll_out(free.weights, free.start, free.goal, moved.duration, time)[0]
    np.testing.assert_allclose(np.diff(path, axis=0), np.diff(same, axis=0), atol=1e-9)


def test_a_goal_beyond_a_limit_comes_back_where_the_start_is_fixed(robot, make_plan):
    plan = make_plan(0.9)
    high = np.maximum(plan.start, plan.goal) + 0.2
    limits = replace(robot.limits, position_max=high)
    point = np.full(6, 5.0)
    moved = PlanSpace(plan, limits, ("goal",), 1, Units(goal_rad=0.1)).plan_at(point)
    np.testing.assert_array_equal(moved.start, plan.start)
    assert (moved.goal < high).all()
    assert (moved.goal > plan.goal).all()


def test_units(robot, make_plan):
    plan = make_plan(0.9)
    units = Units(goal_rad=0.2, log_duration=0.3, shape_rad=0.05)
    point = np.zeros(7)
    point[[0, 6]] = 1, 1
    goal_first = PlanSpace(plan, robot.limits, ("goal", "duration"), 1, units).plan_at(point)
    np.testing.assert_allclose(goal_first.goal - plan.goal, [0.2, 0, 0, 0, 0, 0])
    assert goal_first.duration == pytest.approx(0.9 * np.exp(0.3))
    space = PlanSpace(plan, robot.limits, ("weights",), 1, units)
    bent = space.plan_at(np.eye(6)[2])
    time = np.linspace(0, 0.9, 901)
    bent_path = roll_out(bent.weights, bent.start, bent.goal, bent.duration, time)[0]
    path = roll_out(plan.weights, plan.start, plan.goal, bent.duration, time)[0]
    moved = np.sqrt(np.mean((bent_path - path) ** 2, axis=0))
    np.testing.assert_allclose(moved, [0, 0, 0.05, 0, 0, 0], atol=5e-4)


def test_least_duration_of_a_minimum_jerk_movement(robot, make_plan):
    x = np.linspace(0, 1, 201)
    start, goal = np.zeros(6), np.array([1.0, 0.5, -0.2, 0.1, 0.0, -0.9])
    weights = fit_weights(x, np.outer(10 * x**3 - 15 * x**4 + 6 * x**5, goal), 30)
    change = np.abs(goal)
    exact = max(
        (1.875 * change / robot.limits.velocity).max(),
        np.sqrt((10 / np.sqrt(3) * change / robot.limits.acceleration).max()),
    )
    plan = replace(make_plan(), weights=weights, start=start, goal=goal)
    assert least_duration(plan, robot.limits) == pytest.approx(exact, rel=5e-3)


def test_what_its_limits_slow_down_is_slowed_down_further_at_once(robot, make_plan):
    """No stretch of the coordinate in which nothing happens; below its floor nothing does."""
    hasty = make_plan(0.2)
    least = least_duration(hasty, robot.limits)
    assert least > 1.2 * hasty.duration
    space = PlanSpace(hasty, robot.limits, ("duration",), 1, Units(log_duration=0.1))
    for asked in (0.0, 0.5, 1.0):
        assert space.plan_at([asked]).duration == pytest.approx(least * np.exp(0.1 * asked))
    np.testing.assert_array_equal(space.floor, [0.0])
    slow = make_plan(2.0 * least)
    unhurried = PlanSpace(slow, robot.limits, ("goal", "duration"), 1, Units(log_duration=0.1))
    floor = unhurried.floor
    assert np.isneginf(floor[:-1]).all()
    np.testing.assert_allclose(floor[-1], 10.0 * np.log(0.5), rtol=1e-6)
    at_floor = np.append(np.zeros(len(floor) - 1), floor[-1])
    beyond = at_floor - np.append(np.zeros(len(floor) - 1), 2.0)
    shortest = unhurried.plan_at(at_floor).duration
    assert shortest == pytest.approx(least)
    assert unhurried.plan_at(beyond).duration == pytest.approx(shortest)
