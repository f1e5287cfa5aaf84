from dataclasses import replace

import numpy as np
import pytest

from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.robot.mujoco_model import matrix_to_quaternion
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.reach.reach import rotation_between, simulate_reaching
from besman.simulation.trial import move, try_plans

TASK = load_task("reach")
ROBOT = load_robot("ur5", "gripper")


def at_its_end(plan):
    pose = forward_kinematics(ROBOT.chain, plan.goal)
    quaternion = matrix_to_quaternion(np.ascontiguousarray(pose[:3, :3]))
    return replace(plan, goal_pose=np.concatenate([pose[:3, 3], quaternion]))


def test_arm_ends_where_the_movement_ends(make_plan):
    plan = at_its_end(make_plan(1.2))
    episodes = simulate_reaching(ROBOT, TASK, move([plan], TASK))
    assert episodes.failures == ("",)
    np.testing.assert_allclose(episodes.outcomes[0], plan.goal_pose[:3], atol=2e-4)
    assert rotation_between(episodes.end_poses[0, 3:], plan.goal_pose[3:]) < 1e-3
    assert episodes.tracking_errors[0] < 1e-3


def test_trials_measure_distance_and_angle(make_plan):
    plan = at_its_end(make_plan(1.2))
    off = plan.goal_pose.copy()
    off[0] += 0.02
    turned = plan.goal_pose.copy()
    half = np.radians(6) / 2
    w, x, y, z = turned[3:]
    turned[3:] = np.array([w, x, y, z]) * np.cos(half) + np.array([-z, y, -x, w]) * np.sin(half)
    plans = [plan, replace(plan, goal_pose=off), replace(plan, goal_pose=turned)]
    good, far, twisted = try_plans(ROBOT, TASK, plans)
    assert (good.success, far.success, twisted.success) == (True, False, False)
    assert far.miss == pytest.approx(0.02, abs=3e-4)
    assert np.degrees(twisted.orientation_error) == pytest.approx(6, abs=0.1)
    assert far.reward < good.reward
    assert twisted.reward < good.reward


def test_an_arm_without_the_strength_does_not_follow(make_plan):
    (trial,) = try_plans(ROBOT, TASK, [at_its_end(make_plan(0.1))])
    assert trial.failure == "arm did not follow"
    assert not trial.success


def test_angle_between_quaternions():
    one = np.array([1.0, 0, 0, 0])
    assert rotation_between(one, -one) == 0
    for angle in (1e-7, 0.3, 3.0):
        other = np.array([np.cos(angle / 2), 0, np.sin(angle / 2), 0])
        assert rotation_between(one, other) == pytest.approx(angle, rel=1e-6)
    assert np.isnan(rotation_between(one, np.full(4, np.nan)))
