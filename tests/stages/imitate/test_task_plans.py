"""Chained plans of a whole task: continuous, within limits, with frames and gripper events."""

import dataclasses
import functools

import numpy as np
import pytest
from whole_task import map_box_task

from besman.exceptions import PlanError
from besman.geometry.frames import quaternion_to_rotation
from besman.motion.task_rollout import sample_task, stretch_task
from besman.records.files import load_record, save_record
from besman.records.whole_tasks import TaskPlan
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.stages.imitate.accuracy import NUMBERS
from besman.stages.imitate.stage import ImitateConfig
from besman.stages.imitate.task_plans import ImitateTasks, _lead_in_range, find_frame, plan_task


@functools.cache
def make_task_plan():
    robot, _, task = map_box_task()
    return plan_task(task, robot, leads_s=(0.1, 0.2))


def test_the_movement_is_continuous_through_all_borders_and_rests_at_its_ends():
    plan = make_task_plan()
    time, q, v, a = sample_task(plan)
    step = time[1]
    # Central differences, with what a jump of the acceleration's derivative leaves.
    np.testing.assert_allclose((q[2:] - q[:-2]) / (2 * step), v[1:-1], atol=1e-3)
    assert np.max(np.abs(np.diff(v, axis=0))) <= 1.01 * step * np.max(np.abs(a))
    assert np.max(np.abs(np.diff(a, axis=0))) < 0.2 * np.max(np.abs(a))
    for row in (0, -1):
        np.testing.assert_allclose(v[row], 0.0, atol=1e-9)
    moving = np.linalg.norm(v[(plan.starts_s[1:-1] * 1000).astype(int)], axis=1)
    assert moving.max() > 0.01


def test_it_follows_what_was_mapped_within_the_limits():
    robot, _, task = map_box_task()
    plan = make_task_plan()
    report = check_limits(robot, *sample_task(plan)[1:])
    assert (report.position, report.velocity, report.acceleration) == (0, 0, 0)
    assert (report.torque, report.self_collisions) == (0, 0)
    assert plan.rmse < 0.02
    own = task.trajectory
    _, q, _, _ = sample_task(plan)
    stretch = plan.duration / (own.time[-1] + 0.3)
    rows = np.round((own.time + 0.1) * stretch * 1000).astype(int)
    tool = forward_kinematics(robot.chain, q[rows])[:, :3, 3]
    away = np.linalg.norm(tool - forward_kinematics(robot.chain, own.positions)[:, :3, 3], axis=1)
    assert np.median(away) < 0.005


def test_goals_are_relative_to_the_box_and_to_where_it_is_put():
    robot, _, task = map_box_task()
    plan = make_task_plan()
    frames = {block.label: (block.frame, block.thing) for block in plan.blocks}
    assert frames["approach_forward"] == ("object", "box")
    assert frames["move_obj_table"] == ("target", "box")
    assert frames["move_to_rest_right"] == ("world", "")
    poses = {"object": plan.object_poses[0], "target": plan.target_poses[0]}
    np.testing.assert_allclose(poses["object"][:3], task.object_positions[0, 0])
    np.testing.assert_allclose(poses["target"][:3], task.object_positions[-1, 0])
    for block in plan.blocks:
        at = poses.get(block.frame, np.array([0.0, 0, 0, 1, 0, 0, 0]))
        turn = quaternion_to_rotation(at[3:])
        reached = forward_kinematics(robot.chain, block.goal[np.newaxis])[0]
        np.testing.assert_allclose(turn @ block.goal_pose[:3] + at[:3], reached[:3, 3], atol=1e-9)
        np.testing.assert_allclose(
            turn @ quaternion_to_rotation(block.goal_pose[3:]), reached[:3, :3], atol=1e-9
        )


def test_the_gripper_closes_and_opens_when_the_box_does():
    _, _, task = map_box_task()
    plan = make_task_plan()
    stretch = plan.duration / (task.trajectory.time[-1] + 0.3)
    assert plan.events == ("close", "open")
    np.testing.assert_allclose(plan.events_s, (task.holds_s[0] + 0.1) * stretch, atol=2e-3)
    labels = [plan.blocks[int(np.searchsorted(plan.starts_s, at)) - 1].label
              for at in plan.events_s + np.array([0.1, -0.1])]  # fmt: skip
    assert labels == ["move_obj_table"] * 2


def test_rests_between_blocks_are_blocks_of_their_own():
    _, _, task = map_box_task()
    labels = [block.label for block in make_task_plan().blocks]
    assert [label for label in labels if label != "idle"] == list(task.labels)
    rests = task.bounds_s[1:, 0] - task.bounds_s[:-1, 1]
    assert labels.count("idle") == np.sum(rests >= 0.1)


def test_a_slower_task_is_the_same_way():
    plan = make_task_plan()
    slow = stretch_task(plan, 2.0)
    fast, q = sample_task(plan)[:2]
    _, again, _, _ = sample_task(slow, 500.0)
    np.testing.assert_allclose(again[: len(q)], q[: len(again)], atol=1e-9)
    np.testing.assert_allclose(slow.events_s, 2.0 * plan.events_s)
    assert slow.duration == pytest.approx(2.0 * plan.duration)
    assert fast[-1] >= plan.duration


def test_it_is_stored_and_comes_back(tmp_path):
    plan = make_task_plan()
    save_record((plan,), tmp_path / "a.npz")
    (again,) = load_record(tmp_path / "a.npz")
    assert isinstance(again, TaskPlan)
    assert again.events == plan.events
    for before, after in zip(plan.blocks, again.blocks, strict=True):
        np.testing.assert_array_equal(after.weights, before.weights)
        assert (after.label, after.frame, after.thing) == (before.label, before.frame, before.thing)


def test_figures_say_blocks_frames_and_gripper():
    robot, _, task = map_box_task()
    step = ImitateTasks(ImitateConfig())
    plans = step.run((task,), robot)
    told = step.figures(plans, None)
    (own,) = told["plans"].values()
    assert {block["frame"] for block in own["blocks"]} == {"object", "target", "world"}
    assert [one["command"] for one in own["gripper"]] == ["close", "open"]
    assert told["rmse_rad"]["max"] == plans[0].rmse
    assert told["wanted_error_m"] == 1e-3
    assert told["position_error_m"]["max"] == max(b["position_error_m"] for b in own["blocks"])
    assert told["n_weights"]["min"] == min(b["n_weights"] for b in own["blocks"])


def test_each_block_has_the_least_weights_that_keep_the_tool_near():
    """Brute force: the next smaller number of weights is farther off than was asked for."""
    robot, _, task = map_box_task()
    plan = plan_task(task, robot, None, (0.1, 0.2), 0.0005)
    assert plan.path_error == max(block.path_error for block in plan.blocks)
    numbers = [block.weights.shape[1] for block in plan.blocks]
    assert len(set(numbers)) > 1
    _, q, _, _ = sample_task(plan)
    own = task.trajectory
    stretch = plan.duration / (own.time[-1] + 0.3)
    rows = np.round((own.time + 0.1) * stretch * 1000).astype(int)
    tool, wanted = (
        forward_kinematics(robot.chain, one)[:, :3, 3] for one in (q[rows], own.positions)
    )
    speed = np.linalg.norm(np.diff(tool, axis=0), axis=1).max() / np.diff(own.time).min()
    # Samples lie up to half a millisecond beside those of the mapped movement.
    away = np.linalg.norm(tool - wanted, axis=1).max()
    assert away <= plan.path_error + 0.0005 * speed + 1e-4
    for k, block in enumerate(plan.blocks):
        assert block.path_error <= 0.0005
        at = NUMBERS.index(numbers[k])
        if at > 0:
            fewer = plan_task(task, robot, NUMBERS[at - 1], (0.1, 0.2))
            assert fewer.blocks[k].path_error > 0.0005


def test_a_block_that_is_far_from_what_it_imitates_leaves_its_task_out():
    robot, _, task = map_box_task()
    with pytest.raises(
        PlanError, match=r"\w+: \w+: not imitated: 6 weights for .* allowed: 0\.1 mm"
    ):
        ImitateTasks(ImitateConfig(n_weights=6, greatest_error_mm=0.1)).run((task,), robot)


def test_frames_where_blocks_and_grasps_meet_otherwise():
    _, _, task = map_box_task()
    # Carried in two blocks: the first leads to no place where it is put.
    two = dataclasses.replace(
        task,
        labels=("reach", "lift", "put", "leave"),
        bounds_s=np.array([[0.0, 1.0], [1.0, 2.0], [2.0, 3.0], [3.0, 4.0]]),
        holds_s=np.array([[1.05, 3.1]]),
    )
    frames = [find_frame(two, k)[0] for k in range(4)]
    assert frames == ["object", "world", "target", "world"]
    none = dataclasses.replace(two, holds_s=np.empty((0, 2)), held=())
    assert [find_frame(none, k) for k in range(4)] == [("world", "")] * 4


@pytest.mark.parametrize(("room", "expected"), [(1.0, 0.1), (0.03, 0.06), (1e-4, 0.0)])
def test_a_lead_ends_where_a_joint_would_leave_its_range(room, expected):
    """Speeding up to 1 rad/s for 0.1 s takes a joint 0.05 rad on."""
    robot, _, _ = map_box_task()
    high = np.full(6, 5.0)
    high[0] = room
    bounded = dataclasses.replace(
        robot, limits=dataclasses.replace(robot.limits, position_max=high)
    )
    found = _lead_in_range(0.1, np.zeros(6), np.array([1.0, 0, -0.5, 0, 0, 0]), bounded)
    assert found == pytest.approx(expected, abs=1e-6)


def test_what_does_not_join_is_no_task():
    plan = make_task_plan()
    first, second = plan.blocks[:2]
    moved = dataclasses.replace(second, start=second.start + 0.1)
    with pytest.raises(PlanError, match=r"start: 0\.1 off from where approach_forward ends"):
        dataclasses.replace(plan, blocks=(first, moved, *plan.blocks[2:]))
    with pytest.raises(PlanError, match="begins and ends at rest; got a velocity"):
        dataclasses.replace(
            plan, blocks=(dataclasses.replace(first, start_velocity=np.ones(6)), *plan.blocks[1:])
        )
    with pytest.raises(PlanError, match="at least one block, got none"):
        dataclasses.replace(plan, blocks=())
    with pytest.raises(PlanError, match="approach_forward: duration: got 0 s"):
        dataclasses.replace(first, duration=0.0)


def test_what_the_arm_cannot_do_is_said():
    robot, _, task = map_box_task()
    own = task.trajectory
    high = dataclasses.replace(own, positions=own.positions + robot.limits.position_max.max())
    with pytest.raises(PlanError, match="block by block the arm leaves its joint range in"):
        plan_task(dataclasses.replace(task, trajectory=high), robot)
    weak = dataclasses.replace(
        robot, limits=dataclasses.replace(robot.limits, torque=robot.limits.torque / 50)
    )
    with pytest.raises(PlanError, match="of the torque limit, twice as slow too"):
        plan_task(task, weak)
    late = dataclasses.replace(
        task, bounds_s=np.array([[0, 1], [1, 2], [own.time[-1] + 1, own.time[-1] + 2]])
    )
    with pytest.raises(PlanError, match="move_to_rest_right: no time is left for it"):
        plan_task(late, robot)
