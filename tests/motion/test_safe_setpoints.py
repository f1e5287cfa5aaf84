"""Set-points of an arm that follows what nobody can foresee: within all limits, and never stuck."""

import sys

import numpy as np
import pytest

from besman.exceptions import RobotError
from besman.motion.safe_setpoints import SafeSetPoints
from besman.robot.limits import check_limits
from besman.robot.mujoco_model import arm_spec

pytest.importorskip("ruckig")


@pytest.fixture
def setpoints(robot):
    return SafeSetPoints(robot, robot.home)


def follow(setpoints, goals, speeds=None, step_ms=10):
    """Aim at one goal after the other; return all samples, and which goals were aimed at."""
    speeds = np.zeros_like(goals) if speeds is None else speeds
    given, aimed = [setpoints.now], []
    for goal, speed in zip(goals, speeds, strict=True):
        aimed.append(setpoints.aim(goal, speed))
        given.append(setpoints.advance(step_ms))
    return [np.concatenate(parts) for parts in zip(*given, strict=True)], aimed


def jumping_goals(robot, n, seed):
    """Goals all over the joints' ranges that jump now and then, and speeds that fit nothing."""
    rng = np.random.default_rng(seed)
    goals = robot.home + rng.uniform(-2.5, 2.5, (n // 7 + 1, robot.n)).repeat(7, axis=0)[:n]
    return goals, rng.uniform(-5.0, 5.0, goals.shape)


@pytest.mark.parametrize("seed", [0, 1])
def test_no_sample_is_beyond_a_limit_whatever_is_asked(robot, setpoints, seed):
    samples, aimed = follow(setpoints, *jumping_goals(robot, 150, seed))
    assert any(aimed)
    assert check_limits(robot, *samples).kept


def test_it_stops_before_what_it_would_touch(robot, setpoints):
    goal = robot.home.copy()
    goal[2] = robot.limits.position_max[2] - 0.01
    samples, aimed = follow(setpoints, np.tile(goal, (100, 1)))
    assert aimed[0]
    assert not any(aimed[-20:])
    report = check_limits(robot, *samples)
    assert report.kept
    assert report.least_distance < 0.02
    assert np.all(samples[1][-1] == 0.0)
    # And goes away from there again.
    assert follow(setpoints, robot.home[None])[1] == [True]


def test_speed_and_acceleration_are_those_of_the_positions(robot, setpoints):
    """By differences: what is said of the samples is what an arm that goes through them does."""
    (positions, velocities, accelerations), _ = follow(setpoints, *jumping_goals(robot, 60, 2))
    step = 1e-3
    middle = (velocities[1:] + velocities[:-1]) / 2
    np.testing.assert_allclose(np.diff(positions, axis=0) / step, middle, atol=2e-4)
    assert np.abs(np.diff(velocities, axis=0) / step).max(axis=0) == pytest.approx(
        np.abs(accelerations).max(axis=0), rel=0.05
    )
    assert np.all(np.abs(np.diff(positions, axis=0)) / step <= robot.limits.velocity * (1 + 1e-6))


def test_torques_are_within_the_limits_by_another_dynamics(robot, setpoints):
    import mujoco

    (positions, velocities, accelerations), _ = follow(setpoints, *jumping_goals(robot, 60, 3))
    spec, _ = arm_spec(robot, 1e-3)
    model = spec.compile()
    data = mujoco.MjData(model)
    for q, v, a in zip(positions[::5], velocities[::5], accelerations[::5], strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_inverse(model, data)
        assert np.all(np.abs(data.qfrc_inverse) <= robot.limits.torque * (1 + 1e-6))


def test_nobody_aims_and_the_arm_comes_to_rest(robot, setpoints):
    follow(setpoints, np.tile(robot.home + 0.5, (6, 1)))
    assert not setpoints.rests
    samples = setpoints.advance(600)
    assert setpoints.rests
    assert np.all(samples.velocities[-1] == 0.0)
    assert check_limits(robot, *samples).kept
    np.testing.assert_array_equal(
        setpoints.advance(5).positions, samples.positions[-1:].repeat(5, 0)
    )


def test_a_goal_that_moves_evenly_is_met(robot, setpoints):
    speed = np.full(robot.n, 0.3)
    goals = robot.home + np.outer(np.arange(100) * 0.01, speed)
    samples, aimed = follow(setpoints, goals, np.tile(speed, (100, 1)))
    assert all(aimed)
    np.testing.assert_allclose(samples[0][-11], goals[-1], atol=1e-4)
    np.testing.assert_allclose(samples[1][-11], speed, atol=1e-2)


def test_goals_beyond_a_joints_range_are_cut_to_it(robot, setpoints):
    goal = robot.home.copy()
    goal[5] += 40.0
    samples, _ = follow(setpoints, np.tile(goal, (400, 1)))
    assert samples[0][-1, 5] == pytest.approx(robot.limits.position_max[5], abs=0.05)


def test_it_begins_at_rest_where_the_arm_can(robot):
    touching = robot.home.copy()
    touching[2] = robot.limits.position_max[2] - 0.01
    with pytest.raises(RobotError, match=r"ur5: cannot rest at \[.*m from itself or the floor"):
        SafeSetPoints(robot, touching)


def test_without_ruckig_it_says_what_to_install(robot, monkeypatch):
    monkeypatch.setitem(sys.modules, "ruckig", None)
    with pytest.raises(RobotError, match=r"besman mirror: .*besman\[mirror\]"):
        SafeSetPoints(robot, robot.home)
