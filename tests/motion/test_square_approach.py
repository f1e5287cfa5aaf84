"""Approaches that come to a pose along its z axis."""

from dataclasses import replace

import numpy as np
import pytest
from contact_motions import AHEAD, slanted_approach_of

from besman.motion.rollout import sample_plan
from besman.motion.square_approach import square_approach
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot

STRAIGHT_M = 0.06


def tool_poses(plan, robot):
    return forward_kinematics(robot.chain, sample_plan(plan, robot)[1])


@pytest.fixture(scope="module")
def grasper():
    return load_robot("iiwa7", "gripper3")


@pytest.fixture(scope="module")
def shown(grasper):
    return slanted_approach_of(grasper)


@pytest.fixture(scope="module")
def brought(grasper, shown):
    """The approach when it was brought to a level gripper in front of the box."""
    position = shown.goal_pose[:3] - [0.02, 0.0, 0.0]
    return square_approach(shown, grasper, position, AHEAD, STRAIGHT_M), position


def beside(plan, robot, position):
    """Return where the tool is from its end, in its frame there, within the straight way."""
    poses = tool_poses(plan, robot)
    left = (poses[:, :3, 3] - position) @ poses[-1, :3, :3]
    return left[np.linalg.norm(left, axis=1) < STRAIGHT_M]


def test_it_ends_at_the_pose_and_comes_straight_along_its_z(grasper, shown, brought):
    plan, position = brought
    end = tool_poses(plan, grasper)[-1]
    np.testing.assert_allclose(end[:3, 3], position, atol=1e-4)
    np.testing.assert_allclose(end[:3, :3], AHEAD, atol=1e-4)
    left = beside(plan, grasper, position)
    assert len(left) > 10
    assert np.abs(left[:, :2]).max() < 2e-3
    assert (np.diff(left[:, 2]) > -1e-4).all()
    assert np.abs(beside(shown, grasper, shown.goal_pose[:3])[:, :2]).max() > 0.04


def test_what_is_far_from_the_end_stays_and_it_rests_at_its_ends(grasper, shown, brought):
    plan = brought[0]
    first, before = (tool_poses(one, grasper)[0] for one in (plan, shown))
    np.testing.assert_allclose(first, before, atol=1e-3)
    assert (plan.duration, plan.goal_pose.tolist()) == (shown.duration, shown.goal_pose.tolist())
    velocities = sample_plan(plan, grasper)[2]
    assert np.abs(velocities[[0, -1]]).max() < 1e-6


def test_what_ends_there_already_stays_the_same_one(grasper, brought):
    plan, position = brought
    assert square_approach(plan, grasper, position, AHEAD, STRAIGHT_M) is plan


def test_what_is_out_of_reach_stays_as_it_was_shown(grasper, shown):
    far = np.array([9.0, 0.0, 0.5])
    assert square_approach(shown, grasper, far, np.eye(3), STRAIGHT_M) is shown


def test_plans_of_other_kinds_stay(grasper, shown):
    other = replace(shown, kind="joint_dmp_velocity")
    assert square_approach(other, grasper, np.zeros(3), np.eye(3), STRAIGHT_M) is other
