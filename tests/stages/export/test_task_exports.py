"""Files of a whole task for the real arm: read back, block by block, with the gripper."""

import json
from itertools import pairwise

import numpy as np
import pytest
import yaml
from whole_task import map_box_task

from besman.exceptions import RecordingError
from besman.io.exports import read_joint_csv, read_ros_joint_trajectory
from besman.io.task_exports import read_gripper_csv, with_gripper
from besman.io.urscript import read_urscript
from besman.motion.task_rollout import sample_task
from besman.stages.export.task_exports import write_task_exports
from besman.stages.imitate.task_plans import plan_task


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    robot, _, task = map_box_task()
    plan = plan_task(task, robot)
    folder = tmp_path_factory.mktemp("exports") / "exports_tasks"
    write_task_exports((plan,), robot, folder)
    (whole,) = [path for path in folder.glob("*.csv") if path.name.count(".") == 1]
    return plan, folder, whole.stem


def test_all_of_a_task_comes_back(written):
    plan, folder, name = written
    time, q, _, _ = sample_task(plan)
    for ending in ("csv", "ros.json", "ros.yaml"):
        read = read_joint_csv if ending == "csv" else read_ros_joint_trajectory
        held = read(folder / f"{name}.{ending}")
        np.testing.assert_allclose(held[1], q, atol=1e-6)
        np.testing.assert_allclose(held[0], time, atol=1e-6)
    limits = json.loads((folder / "limits.json").read_text())["motions"][name]
    assert limits["velocity"] == limits["acceleration"] == limits["self_collisions"] == 0


def test_blocks_join_to_the_whole(written):
    plan, folder, name = written
    _, whole, _, _ = sample_task(plan)
    paths = sorted(folder.glob(f"{name}.[0-9]*.csv"))
    assert [path.name.split(".")[2] for path in paths] == [one.label for one in plan.blocks]
    parts = [read_joint_csv(path) for path in paths]
    for before, after in pairwise(parts):
        assert before[0][-1] == pytest.approx(after[0][0])
        np.testing.assert_allclose(before[1][-1], after[1][0], atol=1e-9)
    joined = np.concatenate([part[1][k > 0 :] for k, part in enumerate(parts)])
    np.testing.assert_allclose(joined, whole, atol=1e-9)


def test_the_gripper_is_told_in_every_format(written, tmp_path):
    plan, folder, name = written
    at, commands = read_gripper_csv(folder / f"{name}.gripper.csv")
    np.testing.assert_allclose(at, plan.events_s, atol=1e-6)
    assert commands == plan.events
    steps = json.loads((folder / f"{name}.task.ros.json").read_text())["steps"]
    again = yaml.safe_load((folder / f"{name}.task.ros.yaml").read_text())["steps"]
    assert again == steps
    starts = [step["start_s"] for step in steps]
    assert starts == sorted(starts)
    gripper = [step for step in steps if "gripper" in step]
    assert [step["goal"]["command"]["position"] for step in gripper] == [0.0, plan.opening_m]
    goals = [step["goal"]["trajectory"] for step in steps if "block" in step]
    assert len(goals) == len(plan.blocks)
    for goal, block in zip(goals, plan.blocks, strict=True):
        first, last = goal["points"][0], goal["points"][-1]
        assert first["time_from_start"] == {"sec": 0, "nanosec": 0}
        np.testing.assert_allclose(first["positions"], block.start, atol=2e-3)
        np.testing.assert_allclose(last["positions"], block.goal, atol=2e-3)
    (tmp_path / "bad.csv").write_text("time\n1\n")
    with pytest.raises(RecordingError, match="expected the columns time_s and command"):
        read_gripper_csv(tmp_path / "bad.csv")


def test_urscript_closes_and_opens_between_its_set_points(written):
    plan, folder, name = written
    lines = (folder / f"{name}.script").read_text().splitlines()
    set_points = np.cumsum([line.startswith("  servoj(") for line in lines])
    found = [
        (set_points[k] * 0.008, line.split("#")[-1].strip())
        for k, line in enumerate(lines)
        if "set_standard_digital_out" in line
    ]
    np.testing.assert_allclose([at for at, _ in found], plan.events_s, atol=0.0081)
    assert [what for _, what in found] == list(plan.events)
    _, positions = read_urscript(folder / f"{name}.script")
    whole = sample_task(plan)[1][::8]
    np.testing.assert_allclose(positions[: len(whole)], whole, atol=1e-6)
    # What is due after the last set-point is not forgotten.
    late = with_gripper("  servoj([0])\n  stopj(2.0)\nend\n", np.array([9.0]), ("open",))
    assert late.splitlines()[1] == "  set_standard_digital_out(0, False)  # open"
