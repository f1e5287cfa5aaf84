import numpy as np
import pytest
from pydantic import ValidationError

from besman.config.stage import Config, Truth, Work
from besman.exceptions import PlanError
from besman.geometry.frames import rotation_to_quaternion
from besman.motion.dmp import roll_out
from besman.motion.rollout import roll_out_plans
from besman.records import JointTrajectory
from besman.report.terminal import outcome_lines
from besman.robot.kinematics import forward_kinematics
from besman.stages.imitate.methods import ImitateStage
from besman.stages.imitate.stage import (
    CartesianDmpConfig,
    ImitateConfig,
    VelocityDmpConfig,
    imitate_results,
)


def trajectory(name="a", moving_end=0.3):
    time = np.linspace(0, 0.6, 61)
    x = time / 0.6
    blend = 10 * x**3 - 15 * x**4 + 6 * x**5
    rate = (30 * x**2 - 60 * x**3 + 30 * x**4) / 0.6
    positions = np.column_stack([blend + moving_end * x, -blend])
    velocities = np.column_stack([rate + moving_end / 0.6, -rate])
    return JointTrajectory(
        time=time,
        positions=positions,
        velocities=velocities,
        accelerations=np.zeros((61, 2)),
        joint_names=("one", "two"),
        poses=np.tile([0.5, 0, 1, 1, 0, 0, 0], (61, 1)),
        position_error=np.zeros(61),
        orientation_error=np.zeros(61),
        time_stretch=1.0,
        target=np.array([2.0, 0, 0]),
        name=name,
        label="throw",
    )


def test_plan_follows_the_demonstration_between_its_leads():
    demonstration = trajectory()
    (plan,) = ImitateConfig(n_weights=20).run((demonstration,))
    assert plan.duration == pytest.approx(0.9)
    assert (plan.name, plan.label, plan.joint_names) == ("a", "throw", ("one", "two"))
    np.testing.assert_array_equal(plan.target, demonstration.target)
    np.testing.assert_array_equal(plan.goal_pose, demonstration.poses[-1])
    q, v, _ = roll_out(plan.weights, plan.start, plan.goal, plan.duration, demonstration.time + 0.1)
    assert np.sqrt(np.mean((q - demonstration.positions) ** 2)) == pytest.approx(plan.rmse)
    assert plan.rmse < 1e-3
    np.testing.assert_allclose(v, demonstration.velocities, atol=0.1)


def test_without_leads_the_plan_has_the_demonstrations_ends():
    demonstration = trajectory(moving_end=0.0)
    (plan,) = ImitateConfig(n_weights=20, lead_in_s=0, lead_out_s=0).run((demonstration,))
    np.testing.assert_array_equal(plan.start, demonstration.positions[0])
    np.testing.assert_array_equal(plan.goal, demonstration.positions[-1])
    assert plan.duration == pytest.approx(0.6)
    assert plan.rmse < 1e-3


def test_results_and_progress():
    done = []
    plans = ImitateConfig(n_weights=20).run(
        (trajectory("a"), trajectory("b", 0.5)), work=Work(progress=done.append)
    )
    assert done == [0.5, 1.0]
    errors = [plan.rmse for plan in plans]
    assert imitate_results(plans, 1.0) == {
        "rmse_rad": {"mean": pytest.approx(np.mean(errors)), "max": max(errors)},
        "position_error_m": {"rms": None, "max": None},
        "n_weights": {"min": 20, "max": 20},
        "wanted_error_m": 1e-3,
        "beyond": [],
    }


@pytest.mark.parametrize("kind", ["joint_dmp", "joint_dmp_velocity", "cartesian_dmp"])
@pytest.mark.parametrize("name", ["ur5", "compi"])
def test_every_kind_follows_the_demonstration_from_rest_to_rest(
    robots, configs, demonstrate, kind, name
):
    robot = robots[name]
    demonstration = demonstrate(robot)
    (plan,) = configs[kind].run((demonstration,), robot)
    assert (plan.kind, plan.duration) == (kind, pytest.approx(1.1))
    q, v, a = roll_out_plans([plan], demonstration.time + 0.1, robot)
    assert np.sqrt(np.mean((q[0] - demonstration.positions) ** 2)) == pytest.approx(plan.rmse)
    assert plan.rmse < 1e-3
    np.testing.assert_allclose(v[0], demonstration.velocities, atol=0.05)
    q, v, a = roll_out_plans([plan], [0, plan.duration, plan.duration + 1], robot)
    np.testing.assert_allclose(v, 0, atol=1e-6)
    np.testing.assert_allclose(a, 0, atol=1e-4)
    np.testing.assert_allclose(q[0, 1], q[0, 2], atol=1e-12)


def test_a_velocity_dmp_has_the_demonstrations_own_ends(robots, configs, demonstrate):
    demonstration = demonstrate(robots["ur5"])
    (plan,) = configs["joint_dmp_velocity"].run((demonstration,), robots["ur5"])
    np.testing.assert_array_equal(plan.goal, demonstration.positions[-1])
    np.testing.assert_array_equal(plan.goal_velocity, demonstration.velocities[-1])
    time = [plan.lead_in_s, plan.duration - plan.lead_out_s]
    q, v, _ = roll_out_plans([plan], time)
    np.testing.assert_allclose(q[0], demonstration.positions[[0, -1]], atol=1e-8)
    np.testing.assert_allclose(v[0], demonstration.velocities[[0, -1]], atol=1e-7)


def test_a_velocity_dmp_without_leads_is_at_rest(robots, demonstrate):
    config = VelocityDmpConfig(method="joint_dmp_velocity", lead_in_s=0, lead_out_s=0)
    (plan,) = config.run((demonstrate(robots["ur5"]),), robots["ur5"])
    assert not plan.start_velocity.any()
    assert not plan.goal_velocity.any()
    assert plan.duration == pytest.approx(0.8)


def test_a_cartesian_plan_needs_its_arm(robots, configs, demonstrate):
    config = configs["cartesian_dmp"]
    demonstrations = (demonstrate(robots["ur5"]),)
    with pytest.raises(PlanError, match=r"a: method cartesian_dmp needs .* shoulder.*; got none"):
        config.run(demonstrations)
    with pytest.raises(PlanError, match=r"; got iiwa7: joint_1"):
        config.run(demonstrations, robots["iiwa7"])
    with pytest.raises(PlanError, match=r"a: method joint_dmp without n_weights needs the arm"):
        ImitateConfig().run(demonstrations)


def circling(robot, turns):
    """Turn the tool in circles by the first two joints, 1.2 s each, at both ends in motion."""
    time = np.arange(round(120 * turns) + 1) / 100
    angle = 2 * np.pi * time / 1.2
    positions = np.tile(robot.home, (len(time), 1))
    velocities, rate = np.zeros_like(positions), 2 * np.pi / 1.2
    positions[:, 0] += 0.15 * np.cos(angle)
    positions[:, 1] += 0.15 * np.sin(angle)
    velocities[:, 0], velocities[:, 1] = (-0.15 * rate * np.sin(angle), 0.15 * rate * np.cos(angle))
    poses = forward_kinematics(robot.chain, positions)
    return JointTrajectory(
        time=time,
        positions=positions,
        velocities=velocities,
        accelerations=np.zeros_like(positions),
        joint_names=robot.joint_names,
        poses=np.column_stack([poses[:, :3, 3], rotation_to_quaternion(poses[:, :3, :3])]),
        position_error=np.zeros(len(time)),
        orientation_error=np.zeros(len(time)),
        time_stretch=1.0,
        target=np.full(3, np.nan),
        name=f"{turns} turns",
        label="wipe",
    )


@pytest.mark.parametrize("kind", ["joint_dmp", "joint_dmp_velocity", "cartesian_dmp"])
def test_the_weights_follow_the_movement(robots, configs, kind):
    """However long it circles, the tool is where it was at the same time, by a wanted error."""
    robot, numbers = robots["ur5"], []
    for turns in (0.5, 5):
        wanted = circling(robot, turns)
        (plan,) = configs[kind].run((wanted,), robot)
        q, _, _ = roll_out_plans([plan], 0.1 + wanted.time, robot)
        there = forward_kinematics(robot.chain, q[0])[:, :3, 3]
        distance = np.linalg.norm(there - wanted.poses[:, :3], axis=1)
        assert distance.max() == pytest.approx(plan.path_error)
        assert np.sqrt(np.mean(distance**2)) == pytest.approx(plan.path_rmse)
        assert plan.path_error < 1e-3
        numbers.append(plan.weights.shape[1])
    assert numbers[0] < 40 < numbers[1]


def test_what_was_lost_is_said(robots):
    robot, wanted = robots["ur5"], (circling(robots["ur5"], 5), circling(robots["ur5"], 0.5))
    few = ImitateConfig(n_weights=20, greatest_error_mm=None)
    plans = few.run(wanted, robot)
    found = few.figures(plans, Truth(), wanted, robot)
    assert found["beyond"] == ["5 turns"]
    assert found["position_error_m"]["max"] == plans[0].path_error > 0.05
    assert outcome_lines({"imitate": found})[0].endswith(
        "mm, 20 weights; warning: 1 beyond 1 mm: 5 turns"
    )
    with pytest.raises(
        PlanError,
        match=r"5 turns: not imitated: 20 weights for 6.3 s leave the tool up to .* mm beside the "
        r"mapped path, allowed: 50 mm \(imitate.greatest_error_mm\); more weights",
    ):
        ImitateConfig(n_weights=20).run(wanted, robot)


def test_no_more_weights_than_samples_and_the_best_of_them(robots):
    """An error that none reaches takes the nearest, and says so."""
    robot, wanted = robots["ur5"], circling(robots["ur5"], 0.5)
    config = ImitateConfig(error_mm=1e-9)
    (plan,) = config.run((wanted,), robot)
    assert plan.weights.shape[1] <= len(wanted.time)
    assert config.figures((plan,), Truth())["beyond"] == ["0.5 turns"]


class Pipeline(Config):
    imitate: ImitateStage = ImitateConfig()


@pytest.mark.parametrize(
    ("section", "kind"),
    [
        ({}, ImitateConfig),
        ({"n_weights": 8}, ImitateConfig),
        ({"method": "joint_dmp_velocity"}, VelocityDmpConfig),
        ({"method": "cartesian_dmp", "free_axis_spin": True}, CartesianDmpConfig),
    ],
)
def test_the_method_tells_the_config(section, kind):
    config = Pipeline(imitate=section)
    assert type(config.imitate) is kind
    assert Pipeline(**config.model_dump()) == config


def test_an_unknown_method_lists_the_others():
    with pytest.raises(ValidationError, match="joint_dmp', 'joint_dmp_velocity', 'cartesian_dmp"):
        Pipeline(imitate={"method": "dmp"})
