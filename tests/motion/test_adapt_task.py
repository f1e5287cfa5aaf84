"""A task whose box stands, and is put, somewhere else: its goals move with the box."""

import dataclasses
import functools

import numpy as np
import pytest
from whole_task import block_goals, map_box_task

from besman.exceptions import PlanError
from besman.motion.adapt_task import frame_matrix, keep_block_range, move_task
from besman.motion.task_rollout import sample_task
from besman.records import TaskPlan
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.stages.imitate.task_plans import plan_task


@functools.cache
def box_plan():
    robot, _, task = map_box_task()
    return robot, plan_task(task, robot, leads_s=(0.1, 0.2))


def turned(pose, shift, angle):
    """The same pose farther away, turned about the vertical."""
    w, _, _, z = pose[3:]
    half = np.arctan2(z, w) + angle / 2
    return np.array([*(pose[:3] + shift), np.cos(half), 0.0, 0.0, np.sin(half)])


@pytest.mark.parametrize("which", ["object", "target"])
def test_goals_move_with_the_box_and_others_stay(which):
    robot, plan = box_plan()
    before = (plan.object_poses if which == "object" else plan.target_poses)[0]
    after = turned(before, (0.02, -0.03, 0.02), 0.1)
    places = {"objects" if which == "object" else "targets": {"box": after}}
    moved = move_task(plan, robot, **places)
    old, new = (forward_kinematics(robot.chain, block_goals(one)) for one in (plan, moved))
    followed = 0
    for k, block in enumerate(plan.blocks):
        expected = old[k]
        if block.frame == which:
            followed += 1
            expected = frame_matrix(after) @ np.linalg.inv(frame_matrix(before)) @ expected
        np.testing.assert_allclose(new[k], expected, atol=1e-4)
    assert followed
    report = check_limits(robot, *sample_task(moved)[1:])
    assert report.position + report.velocity + report.acceleration + report.torque == 0


def test_a_box_that_stays_changes_nothing():
    robot, plan = box_plan()
    same = move_task(plan, robot, {"box": plan.object_poses[0]})
    for before, after in zip(plan.blocks, same.blocks, strict=True):
        np.testing.assert_array_equal(after.goal, before.goal)
    assert same.duration == plan.duration


def test_a_joint_that_would_leave_its_range_gets_less_shape():
    robot, plan = box_plan()
    block = max(plan.blocks, key=lambda one: np.abs(one.weights).max())
    swollen = dataclasses.replace(block, weights=40.0 * block.weights)
    alone = TaskPlan(
        "a:0", "a", plan.joint_names, (at_rest(swollen),), (), np.empty((0, 7)), np.empty((0, 7)),
        np.empty(0), (), 0.0, 0.0,
    )  # fmt: skip
    low, high = robot.limits.position_min, robot.limits.position_max
    outside = sample_task(alone)[1]
    assert np.any((outside < low) | (outside > high))
    kept = keep_block_range(alone.blocks[0], robot.limits)
    inside = sample_task(dataclasses.replace(alone, blocks=(kept,)))[1]
    assert np.all((inside >= low) & (inside <= high))
    # As much shape as fits: one joint at least comes near to its bound.
    assert np.min(np.minimum(inside - low, high - inside)) < 0.02
    np.testing.assert_allclose(inside[[0, -1]], outside[[0, -1]], atol=1e-9)
    assert keep_block_range(kept, robot.limits) is kept


def at_rest(block):
    still = np.zeros_like(block.start)
    return dataclasses.replace(block, start_velocity=still, goal_velocity=still)


def test_what_cannot_be_is_said():
    robot, plan = box_plan()
    far = turned(plan.object_poses[0], (5.0, 0.0, 0.0), 0.0)
    with pytest.raises(PlanError, match="approach_forward: its goal at the object 'box' is out of"):
        move_task(plan, robot, {"box": far})
    with pytest.raises(PlanError, match=r"no object 'bax'; .*box"):
        move_task(plan, robot, {"bax": far})
    with pytest.raises(PlanError, match=r"box: a pose must be finite, shape \(7,\)"):
        move_task(plan, robot, targets={"box": far[:3]})
