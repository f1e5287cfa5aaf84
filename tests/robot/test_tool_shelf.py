"""Tools that stand by themselves."""

import mujoco
import numpy as np
import pytest
import yaml

from besman.config.yaml_file import load_config
from besman.exceptions import RobotError
from besman.robot.config import RobotConfig
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import find_robot, load_robot
from besman.robot.tool_shelf import shelf_tools, tools_of
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.stick_throw.stick_throw import stick_throw_model


def test_the_tools_of_the_ur5_are_those_of_the_shelf():
    own = tools_of(load_config(find_robot("ur5"), RobotConfig))
    shelf = shelf_tools()
    for name, tool in own.items():
        same = shelf["parallel_gripper" if name == "gripper" else name]
        assert same.model_copy(update={"least_scale": 1.0}) == tool
    assert len(shelf) == len(own)


def without_tools(folder, **changes):
    content = yaml.safe_load(find_robot("ur5").read_text()) | {"name": "bare"} | changes
    del content["tools"]
    path = folder / "bare.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_robot_that_names_no_tool_has_them_all(tmp_path):
    path = without_tools(tmp_path)
    for name in shelf_tools():
        own = load_robot("ur5", "gripper" if name == "parallel_gripper" else name)
        robot = load_robot(path, name)
        pose = forward_kinematics(robot.chain, robot.home)
        np.testing.assert_array_equal(pose, forward_kinematics(own.chain, own.home))
    with pytest.raises(RobotError, match=r"no tool 'stick_holdr'; did you mean 'stick_holder'"):
        load_robot(path, "stick_holdr")


def test_a_flange_that_is_turned_turns_the_tool_with_it(tmp_path):
    half = float(np.sqrt(0.5))
    plain = load_robot(without_tools(tmp_path), "stick_holder")
    turned = load_robot(without_tools(tmp_path, flange_wxyz=[half, 0, half, 0]), "stick_holder")
    about_y = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    ends, place = plain.tool.capsule_ends, plain.tool.tcp2flange
    np.testing.assert_allclose(turned.tool.capsule_ends, ends @ about_y.T, atol=1e-12)
    np.testing.assert_allclose(turned.tool.tcp2flange[:3], about_y @ place[:3], atol=1e-12)


def test_a_small_arm_gets_shorter_tools_as_far_as_each_may_be(tmp_path):
    usual = load_robot(without_tools(tmp_path), "stick_holder").tool
    small = load_robot(without_tools(tmp_path, tool_scale=0.6), "stick_holder").tool
    smallest = load_robot(without_tools(tmp_path, tool_scale=0.1), "stick_holder").tool
    assert (usual.scale, small.scale, smallest.scale) == (1.0, 0.6, 0.4)
    np.testing.assert_allclose(small.tcp2flange[:3, 3], 0.6 * usual.tcp2flange[:3, 3])
    np.testing.assert_allclose(small.capsule_ends, 0.6 * usual.capsule_ends)
    assert small.mass == pytest.approx(0.6 * usual.mass)
    # What it holds is as large as before.
    assert small.capsule_radius == usual.capsule_radius
    np.testing.assert_array_equal(small.tcp2hand, usual.tcp2hand)
    gripper = load_robot(without_tools(tmp_path, tool_scale=0.1), "gripper3").tool
    assert gripper.scale == 1.0


def test_the_tube_of_a_shorter_holder_is_shorter(tmp_path):
    task = load_task("stick_throw")
    tops = []
    for scale in (1.0, 0.5):
        robot = load_robot(without_tools(tmp_path, tool_scale=scale), "stick_holder")
        model = stick_throw_model(robot, task)
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        body = model.body("holder").id
        geoms = np.flatnonzero(model.geom_bodyid == body)
        along = (data.geom_xpos[geoms] - data.xpos[body]) @ data.xmat[body].reshape(3, 3)
        tops.append(float(along[:, 2].max()))
    wall = task.holder.length_m - tops[0]
    assert tops[1] == pytest.approx(0.5 * task.holder.length_m - wall, abs=1e-9)
    assert 0 <= wall < 0.01
