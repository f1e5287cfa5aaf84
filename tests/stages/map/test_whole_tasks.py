"""Objects, borders and grasps of a whole action, where its movement was mapped to."""

import dataclasses

import numpy as np
import pytest
from whole_task import map_box_task

from besman.records import ShapeError
from besman.records.files import load_record, save_record
from besman.stages.map.demonstration import tool_poses
from besman.stages.map.stage import MapConfig
from besman.stages.map.whole_tasks import MapTasks


def test_the_box_is_as_far_from_the_tool_as_it_was_from_the_hand():
    robot, demonstration, task = map_box_task()
    asked = tool_poses(demonstration.hand, robot)[:, :3, 3]
    shown = np.linalg.norm(demonstration.object_positions[:, 0] - asked, axis=1)
    mapped = np.linalg.norm(task.object_positions[:, 0] - task.trajectory.poses[:, :3], axis=1)
    np.testing.assert_allclose(mapped, shown, atol=1e-6)
    # Up is up: the box rises and sinks by as much.
    rise = demonstration.object_positions[:, 0, 2] - demonstration.object_positions[0, 0, 2]
    np.testing.assert_allclose(
        task.object_positions[:, 0, 2] - task.object_positions[0, 0, 2], rise, atol=1e-6
    )


def test_headings_turn_with_the_way_between_two_places():
    _, demonstration, task = map_box_task()
    ways = [one[-1, 0] - one[0, 0] for one in (demonstration.object_positions,
                                               task.object_positions)]  # fmt: skip
    turned = np.arctan2(ways[1][1], ways[1][0]) - np.arctan2(ways[0][1], ways[0][0])
    off = task.object_headings - demonstration.object_headings - turned
    np.testing.assert_allclose(np.angle(np.exp(1j * off)), 0.0, atol=1e-6)


def test_borders_and_grasps_are_on_the_robots_clock():
    _, demonstration, task = map_box_task()
    stretch = task.trajectory.time[-1] / demonstration.hand.time[-1]
    assert stretch >= 1.0
    np.testing.assert_allclose(task.bounds_s, stretch * demonstration.bounds_s)
    np.testing.assert_allclose(task.holds_s, stretch * demonstration.holds_s)
    told = MapTasks(MapConfig()).figures((task,), None)
    assert told == {"n_tasks": 1, "holds_s": {task.name: task.holds_s.tolist()}}


def test_it_is_stored_and_comes_back(tmp_path):
    _, _, task = map_box_task()
    save_record((task,), tmp_path / "a.npz")
    (again,) = load_record(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.object_positions, task.object_positions)
    assert (again.labels, again.held, again.opening_m) == (task.labels, task.held, task.opening_m)
    with pytest.raises(ShapeError, match=r"must have \d+ samples, got 1"):
        dataclasses.replace(
            task, object_positions=np.zeros((1, 1, 3)), object_headings=np.zeros((1, 1))
        )
