"""Shapes of robots and scenes stand where MuJoCo has them."""

import mujoco
import numpy as np
import pytest

from besman.geometry.frames import quaternion_to_rotation
from besman.pictures.scene_geoms import scene_geoms
from besman.robot.model import load_robot
from besman.simulation.tasks.grasp_box.grasp_scene import grasp_model
from besman.simulation.tasks.kinds import load_task
from besman.view.packing import Packer
from besman.view.shapes import robot_content, scene_shapes
from besman.view.takes import _body_poses


def matrix(pose):
    found = np.eye(4)
    found[:3, 3], found[:3, :3] = pose[:3], quaternion_to_rotation(pose[3:])
    return found


def scene(kind, make_plan):
    if kind == "grasp_box":
        robot = load_robot("iiwa7", "gripper3")
        return robot, grasp_model(robot, load_task("grasp_box"), (0.7, 0.1, 1.2, 0.3))
    robot = load_robot("ur5", "stick_holder")
    return robot, load_task("stick_throw").play(robot, make_plan()).model


@pytest.mark.parametrize("kind", ["grasp_box", "stick_throw"])
def test_shapes_of_a_scene_are_where_mujoco_has_them(kind, make_plan):
    robot, model = scene(kind, make_plan)
    shapes, bodies = scene_shapes(robot, model)
    ids = scene_geoms(robot, model).ids
    assert len(shapes) == len(ids)
    rng = np.random.default_rng(0)
    data = mujoco.MjData(model)
    for _ in range(5):
        data.qpos[:] = rng.normal(size=model.nq)
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_kinematics(model, data)
        (poses,) = _body_poses(model, data.qpos[None].copy(), bodies)
        joints = [model.body(name).id for name in robot.joint_names]
        frames = [np.eye(4)]
        frames += [matrix([*data.xpos[body], *data.xquat[body]]) for body in joints]
        frames += [matrix(pose) for pose in poses]
        for shape, geom in zip(shapes, ids, strict=True):
            found = frames[shape["frame"] + 1] @ matrix(shape["pose"])
            np.testing.assert_allclose(found[:3, 3], data.geom_xpos[geom], atol=1e-5)
            turned = data.geom_xmat[geom].reshape(3, 3)
            np.testing.assert_allclose(found[:3, :3], turned, atol=1e-5)
            n = len(shape["size"])
            np.testing.assert_array_equal(shape["size"], model.geom_size[geom][:n])
    roles = {shape["role"] for shape in shapes}
    assert roles == ({"tool", "fixed", "object"} if kind == "grasp_box" else {"tool", "object"})


def test_each_arm_of_two_shows_its_own_links_once():
    right, left = load_robot("rh5_right"), load_robot("rh5_left")
    alone = robot_content(right, Packer())["shapes"]
    beside = robot_content(right, Packer(), [left])["shapes"]
    # Seven links of the other arm hang still where it is not shown itself.
    assert len(alone) - len(beside) == left.n
    moved = [shape for shape in alone if shape["frame"] >= 0]
    assert [shape for shape in beside if shape["frame"] >= 0] == moved


def test_a_capsule_reaches_from_end_to_end():
    robot = load_robot("iiwa7")
    chain = robot.chain
    shapes = robot_content(robot, Packer())["shapes"]
    links = [k for k, link in enumerate(chain.capsule_links) if link not in ("tool", "pedestal")]
    for k, shape in zip(links, shapes, strict=False):
        place = matrix(shape["pose"])
        radius, half = shape["size"]
        assert radius == pytest.approx(chain.capsule_radii[k])
        ends = place[:3, 3] + np.array([[-half], [half]]) * place[:3, 2]
        np.testing.assert_allclose(ends, chain.capsule_ends[k], atol=1e-5)


def test_the_meshes_of_an_arm_are_small():
    packer = Packer()
    content = robot_content(load_robot("ur10"), packer)
    meshes = [shape for shape in content["shapes"] if shape["kind"] == "mesh"]
    assert len(meshes) == 7
    assert len(packer.bundle(content)) * 4 / 3 < 100_000
