import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from besman.exceptions import PlanError
from besman.geometry.quaternions import from_rotation_vector, multiply
from besman.motion import adapt_plan
from besman.motion.adapt_plan import retarget_plan
from besman.motion.dmp_fit import shape_directions
from besman.motion.rollout import roll_out_plans, sample_plan
from besman.robot.dynamics import inverse_dynamics
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits

ROBOTS = ("ur5", "iiwa7", "compi")
KINDS = ("joint_dmp", "joint_dmp_velocity", "cartesian_dmp")


def check(plan, robot):
    """Check a plan at 1 kHz against everything that its arm may not do."""
    _, *movement = sample_plan(plan, robot)
    report = check_limits(robot, *movement)
    assert report.violations == 0
    assert report.self_collisions == 0
    torque = np.abs(inverse_dynamics(robot, *movement)) / robot.limits.torque
    assert torque.max() <= 1
    return movement, max(report.velocity_ratio, report.acceleration_ratio, torque.max())


def near(plan, which, random, spread):
    values = np.array(getattr(plan, which))
    if plan.kind != "cartesian_dmp":
        return values + spread * random.normal(size=len(values))
    turned = from_rotation_vector(spread * random.normal(size=3))
    position = values[:3] + 0.5 * spread * random.normal(size=3)
    return np.concatenate([position, multiply(turned, values[3:])])


@pytest.mark.parametrize("kind", KINDS)
@given(
    robot=st.sampled_from(ROBOTS),
    seed=st.integers(0, 10_000),
    spread=st.floats(0, 0.6),
    duration=st.none() | st.floats(0.02, 5),
    ends=st.sampled_from(["goal", "start", "both", "neither"]),
)
@example(robot="compi", seed=3437, spread=0.021484375, duration=1.0, ends="start")
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_what_comes_out_violates_nothing(
    robots, plan_of, kind, robot, seed, spread, duration, ends
):
    arm, plan, random = robots[robot], plan_of(kind, robot, seed % 3), np.random.default_rng(seed)
    wanted = {
        which: near(plan, which, random, spread)
        for which in ("goal", "start")
        if ends in (which, "both")
    }
    try:
        new = retarget_plan(plan, arm, **wanted, duration=duration)
    except PlanError as error:
        reason = str(error)
    else:
        reason = ""
    if reason:
        known = "a: (goal|start): (joint|out of reach)|a: the arm would|a: joint .* would"
        assert re.match(known, reason)
        return
    _, ratio = check(new, arm)
    assert new.kind == kind
    # No slower than asked for and needed.
    if new.duration > 1.0001 * (duration or plan.duration) and ratio <= 0.99:
        # A short peak lies between the samples of 1 kHz.
        _, *dense = sample_plan(new, arm, rate_hz=10_000)
        assert check_limits(arm, *dense).acceleration_ratio > 0.99
    for which, value in wanted.items():
        same = getattr(new, which)
        np.testing.assert_allclose(same[:3], value[:3], atol=1e-12)
        if kind == "cartesian_dmp":
            assert abs(same[3:] @ value[3:]) == pytest.approx(1)
        else:
            np.testing.assert_array_equal(same, value)


@given(seed=st.integers(0, 10_000), robot=st.sampled_from(ROBOTS))
@settings(max_examples=15, deadline=None)
def test_anywhere_in_the_range_of_the_joints_even_at_its_border(robots, plan_of, seed, robot):
    arm, plan, random = robots[robot], plan_of("joint_dmp", robot), np.random.default_rng(seed)
    low, high = arm.limits.position_min, arm.limits.position_max
    share = np.clip(random.uniform(-0.3, 1.3, arm.n), 0, 1)
    goal = np.clip(low + share * (high - low), low, high)
    # Much of a shape, so that it has to be scaled down.
    shapes = shape_directions(plan.weights.shape[1])[:4]
    wild = replace(plan, weights=plan.weights + random.normal(size=(arm.n, 4)) @ shapes)
    try:
        new = retarget_plan(wild, arm, goal=goal)
    except PlanError as error:
        assert "would touch itself" in str(error)  # noqa: PT017
        return
    movement, _ = check(new, arm)
    np.testing.assert_allclose(movement[0][-1], goal, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_asked_for_changes_nothing_that_fits(robots, plan_of, kind):
    plan = plan_of(kind)
    slow = retarget_plan(plan, robots["ur5"], duration=8.0)
    again = retarget_plan(slow, robots["ur5"])
    assert slow.duration == again.duration == 8.0
    for name in ("weights", "start", "goal"):
        np.testing.assert_allclose(getattr(again, name), getattr(plan, name), atol=1e-9)
    before = sample_plan(plan, robots["ur5"], 800 / plan.duration)[1]
    after = sample_plan(again, robots["ur5"], 100)[1]
    np.testing.assert_allclose(after, before, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_goal_and_start_are_reached_and_the_goal_pose_follows(robots, plan_of, kind):
    arm, plan, random = robots["ur5"], plan_of(kind), np.random.default_rng(3)
    start, goal = near(plan, "start", random, 0.05), near(plan, "goal", random, 0.05)
    new = retarget_plan(plan, arm, start=start, goal=goal)
    _, q, v, _ = sample_plan(new, arm)
    ends = forward_kinematics(arm.chain, q[[0, -1]])
    np.testing.assert_allclose(v[[0, -1]], 0, atol=1e-6)
    if kind == "cartesian_dmp":
        np.testing.assert_allclose(ends[:, :3, 3], [start[:3], goal[:3]], atol=1e-4)
        np.testing.assert_array_equal(new.goal_pose, new.goal)
        return
    if kind == "joint_dmp":
        np.testing.assert_allclose(q[[0, -1]], [start, goal], atol=1e-9)
    pose = forward_kinematics(arm.chain, goal)
    np.testing.assert_allclose(new.goal_pose[:3], pose[:3, 3])


def test_a_goal_is_passed_with_another_velocity(robots, plan_of):
    arm, plan = robots["ur5"], plan_of("joint_dmp_velocity")
    velocity = np.array([0.1, -0.2, 0.3, 0.0, 0.2, -0.1])
    new = retarget_plan(plan, arm, goal=plan.goal + 0.1, goal_velocity=velocity)
    assert new.duration == plan.duration
    time = np.array([plan.duration - plan.lead_out_s])
    q, v, _ = roll_out_plans([new], time)
    np.testing.assert_allclose(q[0, 0], plan.goal + 0.1, atol=1e-9)
    np.testing.assert_allclose(v[0, 0], velocity, atol=1e-7)
    # Too fast: slowed down evenly, and so is the goal's velocity.
    fast = retarget_plan(plan, arm, goal_velocity=8 * velocity)
    np.testing.assert_allclose(
        fast.goal_velocity * fast.duration, 8 * velocity * plan.duration, rtol=1e-12
    )
    check(fast, arm)


def test_a_demonstrated_shape_is_scaled_down_only_where_and_as_far_as_needed(robots, plan_of):
    arm, plan = robots["ur5"], plan_of("joint_dmp", seed=1)
    limits = arm.limits
    narrow = replace(plan, weights=plan.weights.copy())
    _, q, _, _ = sample_plan(narrow)
    ends = np.maximum(plan.start, plan.goal)
    # The range of the first joint ends halfway between its ends and its movement's highest point.
    top = 0.5 * (ends[0] + q[:, 0].max())
    assert q[:, 0].max() > ends[0] + 0.01
    high = limits.position_max.copy()
    high[0] = top
    small = replace(arm, limits=replace(limits, position_max=high))
    new = retarget_plan(plan, small)
    np.testing.assert_array_equal(new.weights[1:], plan.weights[1:])
    highest = sample_plan(new)[1][:, 0].max()
    assert top - 2e-3 < highest <= top


def test_loads_that_no_duration_helps(robots, plan_of):
    arm, plan = robots["ur5"], plan_of("joint_dmp")
    weak = replace(arm, limits=replace(arm.limits, torque=arm.limits.torque / 50))
    with pytest.raises(PlanError, match=r"a: joint \w+ would need \d+\.\d Nm to hold the arm, all"):
        retarget_plan(plan, weak)


def test_torque_lengthens_a_plan(robots, plan_of):
    arm, plan = robots["ur5"], plan_of("joint_dmp")
    still = retarget_plan(plan, arm, duration=8.0)
    _, q, v, a = sample_plan(still)
    least = np.abs(inverse_dynamics(arm, q, v, a)).max(axis=0) * 1.02
    weak = replace(arm, limits=replace(arm.limits, torque=np.maximum(least, 1e-2)))
    new = retarget_plan(plan, weak, duration=0.1)
    assert new.duration > retarget_plan(plan, arm, duration=0.1).duration
    assert check(new, weak)[1] > 0.99


@pytest.mark.parametrize(
    ("kind", "wanted", "message"),
    [
        ("joint_dmp", {"goal": np.zeros(5)}, r"goal must be finite, shape \(6,\), got \[0.0"),
        ("joint_dmp", {"start": np.full(6, np.nan)}, "start must be finite"),
        ("joint_dmp", {"goal": np.full(6, 7.0)}, r"goal: joint shoulder_pan_joint: got 7.0000 rad"),
        ("joint_dmp", {"goal_velocity": np.zeros(6)}, "a joint_dmp ends at rest; expected"),
        ("cartesian_dmp", {"goal_velocity": np.zeros(6)}, "a cartesian_dmp ends at rest"),
        ("joint_dmp_velocity", {"goal_velocity": np.zeros(2)}, r"goal_velocity must be finite"),
        ("cartesian_dmp", {"goal": np.zeros(6)}, r"goal of a Cartesian plan must be finite, shape"),
        ("cartesian_dmp", {"goal": np.zeros(7)}, "goal: got a quaternion of length 0, expected 1"),
        ("cartesian_dmp", {"goal": [9.0, 0, 1, 1, 0, 0, 0]}, r"goal: out of reach of ur5 by \d+ m"),
        ("cartesian_dmp", {"start": [9.0, 0, 1, 1, 0, 0, 0]}, "start: out of reach of ur5"),
        ("joint_dmp", {"duration": 0.0}, "duration: got 0 s, expected more than 0"),
        ("joint_dmp", {"duration": np.nan}, "duration: got nan s"),
        ("joint_dmp", {"goal": [0, -1.5, 3.1, 0, 0, 0]}, "the arm would touch itself"),
    ],
)
def test_what_cannot_be(robots, plan_of, kind, wanted, message):
    with pytest.raises(PlanError, match=f"^a: .*{message}"):
        retarget_plan(plan_of(kind), robots["ur5"], **wanted)


def test_another_arm(robots, plan_of):
    with pytest.raises(PlanError, match=r"a: plan for joints shoulder.*; robot iiwa7 has joint_1"):
        retarget_plan(plan_of("joint_dmp"), robots["iiwa7"])


def test_no_room_for_the_lead(robots, plan_of):
    arm, plan = robots["compi"], plan_of("joint_dmp_velocity", "compi")
    goal = np.array(plan.goal)
    goal[5] = arm.limits.position_max[5]
    with pytest.raises(PlanError, match=r"a: joint joint_6 would leave its range \[-2.0.* by 0\."):
        retarget_plan(plan, arm, goal=goal, goal_velocity=np.full(6, 2.0))


def test_a_jump(robots, plan_of):
    arm, plan = robots["ur5"], plan_of("joint_dmp")
    slow = replace(arm, limits=replace(arm.limits, velocity=arm.limits.velocity / 1000))
    with pytest.raises(PlanError, match=r"a: the arm would have to jump: .* takes \d+ s, allowed"):
        retarget_plan(plan, slow)


def test_a_shape_that_is_none_is_taken_away_whole(robots, plan_of):
    arm, plan = robots["ur5"], plan_of("joint_dmp_velocity")
    plain = replace(plan, weights=np.zeros_like(plan.weights))
    assert np.all(adapt_plan._fit_shape(plain, arm, 1.0).weights == 0.0)
    one = replace(plan, weights=plan.weights * (np.arange(6) == 2)[:, None])
    assert np.all(adapt_plan._fit_shape(one, arm, 1.0).weights == 0.0)
