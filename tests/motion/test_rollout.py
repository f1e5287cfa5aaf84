from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from besman.exceptions import PlanError
from besman.geometry.frames import quaternion_to_rotation
from besman.motion.cartesian_dmp import fit_poses, roll_out_poses
from besman.motion.dmp import interpolate
from besman.motion.dmp_fit import fit_weights
from besman.motion.joint_path import (
    greatest_rates,
    joint_nodes,
    joint_steps,
    lay_spline,
    plan_poses,
)
from besman.motion.rollout import least_duration, roll_out_plans, sample_plan, stretch_plan
from besman.motion.velocity_dmp import fit_velocity_weights
from besman.robot.inverse_kinematics import IkWeights, solve_path
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits

KINDS = ("joint_dmp", "joint_dmp_velocity", "cartesian_dmp")


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_those_of_the_positions(robots, plan_of, kind):
    robot, plan = robots["ur5"], plan_of(kind)
    time, step = np.linspace(0.011, plan.duration - 0.011, 157), 1e-5
    before, _, _ = roll_out_plans([plan], time - step, robot)
    at, velocities, accelerations = roll_out_plans([plan], time, robot)
    after, _, _ = roll_out_plans([plan], time + step, robot)
    np.testing.assert_allclose((after - before) / (2 * step), velocities, atol=1e-5)
    np.testing.assert_allclose((after - 2 * at + before) / step**2, accelerations, atol=2e-2)


@pytest.mark.parametrize("kind", KINDS)
@given(duration=st.floats(0.05, 20))
@settings(max_examples=10, deadline=None)
def test_stretching_is_even(robots, plan_of, kind, duration):
    robot, plan = robots["ur5"], plan_of(kind)
    share = np.linspace(0, 1, 41)
    slow = stretch_plan(plan, duration)
    one = roll_out_plans([plan], share * plan.duration, robot)
    other = roll_out_plans([slow], share * duration, robot)
    for order in range(3):
        # At a border of a lead, rounding tells on which side a sample is.
        inside = slice(1, -1)
        np.testing.assert_allclose(
            other[order][:, inside] * (duration / plan.duration) ** order,
            one[order][:, inside],
            atol=1e-7,
        )


@pytest.mark.parametrize("kind", KINDS)
def test_at_its_least_duration_a_plan_is_just_within_the_limits(robots, plan_of, kind):
    robot, plan = robots["ur5"], plan_of(kind)
    duration = least_duration(plan, robot.limits, robot)
    movement = sample_plan(stretch_plan(plan, duration), robot)[1:]
    report = check_limits(robot, *movement)
    assert report.velocity == report.acceleration == 0
    assert max(report.velocity_ratio, report.acceleration_ratio) > 0.995


def test_company_changes_nothing_not_even_of_another_kind(robots, plan_of):
    robot = robots["ur5"]
    plans = [plan_of(kind, seed=seed) for kind in KINDS for seed in (0, 1)]
    time = np.arange(0, 1.2, 0.004)
    together = roll_out_plans(plans, time, robot)
    for kind in KINDS:
        rows = [row for row, plan in enumerate(plans) if plan.kind == kind]
        same_kind = roll_out_plans([plans[row] for row in rows], time, robot)
        for got, expected in zip(together, same_kind, strict=True):
            np.testing.assert_array_equal(got[rows], expected)


@pytest.mark.parametrize("name", ["ur5", "iiwa7", "compi"])
def test_the_tool_is_where_the_cartesian_plan_wants_it_also_between_the_steps(
    robots, plan_of, name
):
    robot, plan = robots[name], plan_of("cartesian_dmp", name)
    time, q, _, _ = sample_plan(plan, robot)
    reached = forward_kinematics(robot.chain, q)
    wanted = roll_out_poses(plan.weights, plan.start, plan.goal, plan.duration, time)
    assert np.abs(reached[:, :3, 3] - wanted[:, :3]).max() < 1e-4
    assert np.abs(reached[:, :3, :3] - quaternion_to_rotation(wanted[:, 3:])).max() < 1e-3
    assert (q >= robot.limits.position_min).all()
    assert (q <= robot.limits.position_max).all()


def test_inverse_kinematics_stays_on_the_plans_branch_and_is_as_good_as_a_search(robots, plan_of):
    robot, plan = robots["ur5"], plan_of("cartesian_dmp")
    positions, errors = joint_steps(plan, robot)
    np.testing.assert_allclose(positions[0], plan.joints, atol=1e-6)
    searched = solve_path(robot, plan_poses(plan), weights=IkWeights())
    assert errors[:, 0].max() < max(1e-4, searched.position_error.max())
    assert np.abs(np.diff(positions, axis=0)).max() < 0.1


def test_the_spline_passes_the_steps_and_rests_at_its_ends(robots, plan_of):
    robot, plan = robots["ur5"], plan_of("cartesian_dmp")
    steps, _ = joint_steps(plan, robot)
    q, v, a = joint_nodes(plan, robot)
    np.testing.assert_allclose(q[::4], steps, atol=1e-10)
    np.testing.assert_allclose(v[[0, -1]], 0, atol=1e-9)
    np.testing.assert_allclose(a[[0, -1]], 0, atol=1e-6)
    # A quintic at rest at both ends is its own spline.
    x = np.linspace(0, 1, 126)
    nodes = np.linspace(0, 1, 501)
    quintic = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    for order, found in enumerate(lay_spline(quintic(x)[:, None])):
        np.testing.assert_allclose(found[:, 0], quintic.deriv(order)(nodes), atol=1e-7)
    # The matrices of a short movement are the same spline.
    for found, expected in zip((q, v, a), lay_spline(steps), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())


def test_a_cartesian_plan_without_its_arm(robots, plan_of):
    plan = plan_of("cartesian_dmp")
    with pytest.raises(PlanError, match=r"a: a Cartesian plan needs its arm.*shoulder.*; got none"):
        roll_out_plans([plan], [0.0])
    with pytest.raises(PlanError, match="got joint_1, joint_2"):
        sample_plan(plan, robots["iiwa7"])


def test_the_greatest_rates_are_those_of_a_dense_look(robots, plan_of):
    """Also of a path with sharp turns, where the acceleration swings within a step."""
    robot, plan = robots["ur5"], plan_of("cartesian_dmp")
    steps, _ = joint_steps(plan, robot)
    steps = steps + 0.02 * (np.arange(len(steps)) > 60)[:, None]
    nodes = lay_spline(steps)
    speeds, pulls = greatest_rates(*nodes)
    _, dense_speeds, dense_pulls = interpolate(*nodes, np.linspace(0, 1, 100_001))
    np.testing.assert_allclose(
        np.abs(speeds).max(axis=0), np.abs(dense_speeds).max(axis=0), rtol=1e-3
    )
    np.testing.assert_allclose(
        np.abs(pulls).max(axis=0), np.abs(dense_pulls).max(axis=0), rtol=1e-5
    )


def test_plans_of_different_numbers_of_weights_are_each_what_they_are_alone(robots, plan_of):
    plan = plan_of("joint_dmp")
    long = replace(plan, weights=np.random.default_rng(1).normal(size=(len(plan.goal), 130)))
    time = np.linspace(0, 1.2 * plan.duration, 50)
    together = roll_out_plans([plan, long], time)
    for at, one in enumerate((plan, long)):
        for found, alone in zip(together, roll_out_plans([one], time), strict=True):
            np.testing.assert_array_equal(found[at], alone[0])


@pytest.mark.parametrize("kind", KINDS)
def test_more_weights_than_are_kept_everywhere_move_alike(robots, plan_of, kind):
    """A movement whose weights are said anew by 130 is the same one, with its limits."""
    robot, plan = robots["ur5"], plan_of(kind)
    time, positions, velocities, _ = sample_plan(plan, robot)
    n = 130
    if kind == "cartesian_dmp":
        at = np.linspace(0, plan.duration, 400)
        poses = roll_out_poses(plan.weights, plan.start, plan.goal, plan.duration, at)
        weights, start, goal = fit_poses(at, poses, n)
        fine = replace(plan, weights=weights, start=start, goal=goal)
    elif kind == "joint_dmp":
        fine = replace(plan, weights=fit_weights(time, positions, n))
    else:
        inner = slice(round(1e3 * plan.lead_in_s), round(-1e3 * plan.lead_out_s))
        moved = time[inner] - plan.lead_in_s, positions[inner]
        ends = plan.start_velocity, plan.goal_velocity
        fine = replace(plan, weights=fit_velocity_weights(*moved, *ends, n))
    _, again, rates, _ = sample_plan(fine, robot)
    np.testing.assert_allclose(again, positions, atol=1e-4)
    np.testing.assert_allclose(rates, velocities, atol=2e-2)
    least = least_duration(fine, robot.limits, robot)
    assert least == pytest.approx(least_duration(plan, robot.limits, robot), rel=0.03)


@pytest.mark.parametrize("kind", ["joint_dmp", "joint_dmp_velocity"])
@pytest.mark.parametrize("n_weights", [20, 40, 80, 120])
def test_the_least_duration_holds_at_1_khz_however_many_weights_there_are(
    robots, plan_of, kind, n_weights
):
    robot, plan = robots["ur5"], plan_of(kind)
    rng = np.random.default_rng(n_weights)
    roughs = [60.0 * rng.normal(size=(robot.n, n_weights)) for _ in range(4)]
    # Something that does not begin at rest: what follows it closely has to start at once.
    time = np.linspace(0.0, 1.4, 141)
    ramp = 0.3 * time[:, np.newaxis] + 0.1 * np.sin(5 * time[:, np.newaxis] + np.arange(robot.n))
    if n_weights > 20:
        roughs.append(fit_weights(time, ramp, n_weights))
    for weights in roughs:
        rough = replace(plan, weights=weights)
        slow = stretch_plan(rough, least_duration(rough, robot.limits))
        _, velocities, accelerations = roll_out_plans([slow], np.arange(0, slow.duration, 1e-3))
        assert np.all(np.abs(velocities[0]) <= robot.limits.velocity)
        assert np.all(np.abs(accelerations[0]) <= robot.limits.acceleration)
