"""Refinement of plans that move at their goal, and of Cartesian plans."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.geometry.frames import rotation_to_quaternion
from besman.geometry.quaternions import conjugate, multiply, rotation_vector
from besman.io.exports import read_joint_csv
from besman.motion.cartesian_dmp import fit_poses
from besman.motion.dmp import roll_out
from besman.motion.rollout import roll_out_plans, sample_plan
from besman.motion.velocity_dmp import fit_velocity_weights
from besman.records import CartesianPlan, MotionPlan
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.simulation.tasks.kinds import load_task
from besman.simulation.trial import try_plans
from besman.stages.export.motion_exports import write_exports
from besman.stages.refine.plan_space import CartesianPlanSpace, PlanSpace, Units, plan_space
from besman.stages.refine.stage import CmaEsConfig

ALL = ("start", "goal", "duration", "weights")
KINDS = ("joint_dmp_velocity", "cartesian_dmp")
THROW = load_task("stick_throw")


def as_velocity_plan(plan):
    """Cut a throw where it is fastest: what follows is the lead."""
    time = np.linspace(0, 0.65 * plan.duration, 80)
    q, v, _ = roll_out(plan.weights, plan.start, plan.goal, plan.duration, time)
    zero = np.zeros(len(plan.start))
    return replace(
        plan,
        weights=fit_velocity_weights(time, q, zero, v[-1], 12),
        goal=q[-1],
        goal_velocity=v[-1],
        duration=time[-1] + 0.2,
        lead_out_s=0.2,
        kind="joint_dmp_velocity",
    )


def as_cartesian_plan(robot, plan):
    time = np.linspace(0, plan.duration, 120)
    q, _, _ = roll_out(plan.weights, plan.start, plan.goal, plan.duration, time)
    pose = forward_kinematics(robot.chain, q)
    poses = np.column_stack([pose[:, :3, 3], rotation_to_quaternion(pose[:, :3, :3])])
    weights, start, goal = fit_poses(time, poses, 14)
    return CartesianPlan(
        weights, start, goal, plan.duration, q[0], plan.joint_names, 0.1, False, 0.0,
        plan.goal_pose, plan.target, plan.name, plan.label,
    )  # fmt: skip


@pytest.fixture(scope="module")
def plans(robot, make_plan):
    plan = make_plan(0.6)
    return {
        "joint_dmp_velocity": as_velocity_plan(plan),
        "cartesian_dmp": as_cartesian_plan(robot, plan),
    }


@pytest.mark.parametrize("kind", KINDS)
def test_the_origin_is_the_plan_slowed_down_to_the_limits(robot, plans, kind):
    plan = replace(plans[kind], duration=5.0)
    space = plan_space(plan, robot, ALL, 3)
    assert space.dimension == 6 + 6 + 1 + 18
    same = space.plan_at(np.zeros(31))
    for name in ("weights", "start", "goal"):
        np.testing.assert_allclose(getattr(same, name), getattr(plan, name), atol=1e-12)
    assert same.duration == 5.0
    assert isinstance(space, PlanSpace if kind == "joint_dmp_velocity" else CartesianPlanSpace)


@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 10_000), spread=st.floats(0.1, 5))
@settings(max_examples=15, deadline=None)
def test_every_plan_keeps_velocity_and_acceleration_from_rest_to_rest(
    robot, plans, kind, seed, spread
):
    space = plan_space(plans[kind], robot, ALL, 4)
    point = spread * np.random.default_rng(seed).normal(size=space.dimension)
    plan = space.plan_at(point)
    _, q, v, a = sample_plan(plan, robot)
    report = check_limits(robot, q, v, a)
    assert report.velocity == report.acceleration == 0
    _, v, a = roll_out_plans([plan], [0, plan.duration], robot)
    np.testing.assert_allclose(v, 0, atol=1e-6)
    np.testing.assert_allclose(a, 0, atol=1e-3)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("parts", [ALL, ("goal", "duration", "weights")])
@pytest.mark.parametrize("duration", [5.0, 0.3])  # with room, and slowed down by the limits
def test_a_plan_of_a_space_is_projected_to_its_point(robot, plans, kind, parts, duration):
    space = plan_space(replace(plans[kind], duration=duration), robot, parts, 3)
    point = 0.2 * np.random.default_rng(1).normal(size=space.dimension)
    point[space.coordinates(["duration"])] = 0.3
    np.testing.assert_allclose(space.project(space.plan_at(point)), point, atol=1e-6)


def test_units_of_a_cartesian_plan(robot, plans):
    plan = replace(plans["cartesian_dmp"], duration=3.0)
    units = Units(goal_rad=0.2, log_duration=0.3, shape_rad=0.05, goal_m=0.03, shape_m=0.02)
    moved = CartesianPlanSpace(plan, robot, ("goal", "duration"), 1, units).plan_at(
        [1.0, 0, 0, 0, 1, 0, 1]
    )
    np.testing.assert_allclose(moved.goal[:3] - plan.goal[:3], [0.03, 0, 0], atol=1e-15)
    turned = rotation_vector(multiply(moved.goal[3:], conjugate(plan.goal[3:])))
    np.testing.assert_allclose(turned, [0, 0.2, 0], atol=1e-12)
    assert moved.duration == pytest.approx(3 * np.exp(0.3))
    bent = CartesianPlanSpace(plan, robot, ("weights",), 1, units).plan_at([0, 1, 0, 0, 0, 1.0])
    change = roll_out(bent.weights - plan.weights, np.zeros(6), np.zeros(6), 1.0, np.linspace(0, 1))
    spread = np.sqrt(np.mean(change[0] ** 2, axis=0))
    np.testing.assert_allclose(spread, [0, 0.02, 0, 0, 0, 0.05], atol=1e-3)


def test_where_the_arm_would_jump_a_point_stands_for_one_nearer_to_the_origin(robot, plans):
    plan = plans["cartesian_dmp"]
    space = CartesianPlanSpace(plan, robot, ("goal",), 1)
    origin = space.plan_at(np.zeros(6))
    ways = np.random.default_rng(0).normal(size=(20, 6))
    shares = []
    for way in ways:
        # Three tenths of a metre and a radian away, much of which is out of reach.
        found = space.plan_at(10 * way)
        assert found.duration <= 3.0 * origin.duration
        shares.append((found.goal[:3] - plan.goal[:3]) / (0.3 * way[:3]))
    np.testing.assert_allclose(np.std(shares, axis=1), 0, atol=1e-9)
    powers = np.log2(np.array(shares)[:, 0])
    np.testing.assert_allclose(powers, np.rint(powers), atol=1e-9)
    assert powers.min() < -0.5


def test_a_goal_that_is_passed_needs_no_other_weights(robot, plans):
    plan = plans["joint_dmp_velocity"]
    moved = PlanSpace(plan, robot.limits, ("goal",), 1).plan_at(np.ones(6))
    np.testing.assert_array_equal(moved.weights, plan.weights)
    np.testing.assert_allclose(moved.goal, plan.goal + 0.1)
    assert isinstance(moved, MotionPlan)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_throws_land_on_their_targets_and_what_is_exported_is_the_plans_own_rollout(
    robot, plans, kind, tmp_path
):
    (trial,) = try_plans(
        robot, THROW, [CmaEsConfig().set_up(plans[kind], robot, THROW).propose()[0]]
    )
    assert not trial.failure
    plan = replace(plans[kind], target=trial.outcome + np.array([-0.09, 0.06, 0]), name="x:1")
    (motion,) = CmaEsConfig(episodes=200).run((plan,), robot, THROW)
    assert motion.success
    assert motion.plan.kind == kind
    assert motion.miss < motion.miss_before
    for got, expected in zip(
        (motion.time, motion.positions, motion.velocities, motion.accelerations),
        sample_plan(motion.plan, robot),
        strict=True,
    ):
        np.testing.assert_array_equal(got, expected)
    report = check_limits(robot, motion.positions, motion.velocities, motion.accelerations)
    assert report.violations == report.self_collisions == 0
    write_exports((motion,), robot, tmp_path)
    np.testing.assert_allclose(read_joint_csv(tmp_path / "x_1.csv")[1], motion.positions, atol=1e-8)


@pytest.mark.slow
def test_threads_change_nothing(robot, plans):
    plan = replace(plans["cartesian_dmp"], target=np.array([1.4, -0.5, 0.0]))
    space = plan_space(plan, robot, ALL, 2)
    points = np.random.default_rng(0).normal(size=(12, space.dimension))
    tried = [space.plan_at(point) for point in points]
    one, two = (try_plans(robot, THROW, tried, jobs) for jobs in (1, 2))
    assert [trial.reward for trial in one] == [trial.reward for trial in two]
