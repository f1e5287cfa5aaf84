"""A gripper that comes straight to a box, and puts it down as it has taken it."""

import dataclasses
import functools

import numpy as np
import pytest
from whole_task import map_box_task

from besman.exceptions import PlanError
from besman.motion.adapt_task import frame_matrix
from besman.motion.grasp_goals import aim_grasps
from besman.motion.grasp_way import GraspWay
from besman.motion.task_rollout import sample_task
from besman.robot.kinematics import forward_kinematics
from besman.robot.limits import check_limits
from besman.stages.imitate.task_plans import plan_task


@functools.cache
def aimed_plan():
    """The grasp is where the imitation is as its approach ends, levelled by nobody."""
    robot, _, task = map_box_task()
    plan = plan_task(task, robot, 20, leads_s=(0.1, 0.2))
    (first,) = [b for b in plan.blocks if b.label == "approach_forward"]
    way = GraspWay(frame_matrix(first.goal_pose), 0.0, 0.03, 0.04, 0.03, 0.8)
    return robot, plan, way, aim_grasps(plan, robot, way)


def tool_at(robot, plan, time_s):
    _, q, _, _ = sample_task(plan)
    row = min(round(time_s * 1000), len(q) - 1)
    return forward_kinematics(robot.chain, q[row : row + 1])[0]


def test_the_box_is_put_as_it_was_taken():
    robot, plan, way, aimed = aimed_plan()
    assert aimed.events == ("close", "open")
    poses = (plan.object_poses[0], plan.target_poses[0])
    for at, standing in zip(aimed.events_s, poses, strict=True):
        expected = frame_matrix(standing) @ way.tool
        np.testing.assert_allclose(tool_at(robot, aimed, at), expected, atol=2e-3)


def test_it_comes_and_leaves_straight_and_lifts_and_lowers_straight():
    robot, _, way, aimed = aimed_plan()
    ends = aimed.starts_s
    _, q, v, _ = sample_task(aimed)
    for at, lengths in zip(aimed.events_s, [(0.03, 0.03), (0.03, 0.04)], strict=True):
        k = int(np.argmin(np.abs(ends - at)))
        np.testing.assert_allclose(v[round(at * 1000)], 0.0, atol=5e-3)
        for number, length in zip((k - 1, k), lengths, strict=True):
            span = slice(round(ends[number] * 1000) + 1, round(ends[number + 1] * 1000))
            path = forward_kinematics(robot.chain, q[span])[:, :3, 3]
            ahead = path[-1] - path[0]
            assert np.linalg.norm(ahead) == pytest.approx(length, abs=1e-3)
            unit = ahead / np.linalg.norm(ahead)
            apart = path - path[0]
            beside = apart - np.outer(apart @ unit, unit)
            assert np.linalg.norm(beside, axis=1).max() < 1e-3
    (lift,) = [b for k, b in enumerate(aimed.blocks) if abs(ends[k] - aimed.events_s[0]) < 1e-6]
    np.testing.assert_allclose(lift.goal_pose[:3] - way.tool[:3, 3], [0, 0, 0.03], atol=1e-12)


def test_it_keeps_the_limits_and_what_is_moved_is_no_imitation():
    robot, plan, _, aimed = aimed_plan()
    report = check_limits(robot, *sample_task(aimed)[1:])
    assert report.position + report.velocity + report.acceleration + report.torque == 0
    assert len(aimed.blocks) == len(plan.blocks) + 4
    moved = [b for b in aimed.blocks if b.frame != "world"]
    assert all(block.path_error is None for block in moved)


def test_a_task_that_takes_nothing_stays_and_one_out_of_reach_is_said():
    robot, plan, way, _ = aimed_plan()
    world = tuple(dataclasses.replace(b, frame="world", thing="") for b in plan.blocks)
    none = dataclasses.replace(plan, blocks=world)
    assert aim_grasps(none, robot, way) is none
    far = np.array(way.grasp)
    far[:3, 3] += 2.0
    with pytest.raises(PlanError, match="approach_forward: its goal at the object 'box' is out of"):
        aim_grasps(plan, robot, dataclasses.replace(way, grasp=far))


@pytest.mark.parametrize("thumb", [1.0, -1.0])
def test_a_pitch_points_down(thumb):
    grasp = np.eye(4)
    x, z = np.array([0, thumb, 0]), np.array([1.0, 0, 0])
    grasp[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    tool = GraspWay(grasp, pitch_rad=0.3).tool
    np.testing.assert_allclose(tool[:3, 2], [np.cos(0.3), 0, -np.sin(0.3)], atol=1e-12)
    np.testing.assert_allclose(tool[:3, 0], x, atol=1e-12)
