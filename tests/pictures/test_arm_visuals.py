"""The model that pictures are drawn with moves as the arm does."""

import mujoco
import numpy as np
import pytest

from besman.pictures.arm_visuals import HIDDEN_GROUP, arm_visuals, mount_rod, pedestal_radius
from besman.pictures.camera import CameraView
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot

VIEW = CameraView(np.array([0.3, 0.1, 0.8]), 3.0, 120.0, -20.0)


@pytest.mark.parametrize("name", ["ur5", "compi"])
def test_meshes_and_rod_move_with_the_arm(name):
    robot = load_robot(name, "stick_holder")
    model = arm_visuals(robot, VIEW, 320, 200)
    assert model.nq == robot.n
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    low, high = robot.limits.position_min, robot.limits.position_max
    ends, radius = mount_rod(robot)
    last = model.body(robot.joint_names[-1]).id
    for angles in rng.uniform(low, high, (5, robot.n)):
        data.qpos[:] = angles
        mujoco.mj_forward(model, data)
        tcp = forward_kinematics(robot.chain, angles)
        last2world = data.xmat[last].reshape(3, 3), data.xpos[last]
        tip = last2world[0] @ robot.chain.tip[:3, 3] + last2world[1]
        np.testing.assert_allclose(tip, tcp[:3, 3], atol=1e-9)
        rod_end = last2world[0] @ ends[1] + last2world[1]
        assert np.linalg.norm(rod_end - tcp[:3, 3]) == pytest.approx(0.04)
    assert radius > 0


def test_a_link_is_drawn_once():
    robot = load_robot("ur5", "stick_holder")
    model = arm_visuals(robot, VIEW, 320, 200)
    kinds = model.geom_type
    drawn = model.geom_group != HIDDEN_GROUP
    meshes = np.flatnonzero(kinds == mujoco.mjtGeom.mjGEOM_MESH)
    assert drawn[meshes].all()
    # Where a link has a mesh its capsule is hidden.
    bodies = set(model.geom_bodyid[meshes])
    capsules = np.flatnonzero(kinds == mujoco.mjtGeom.mjGEOM_CAPSULE)
    for geom in capsules:
        rod = model.geom_size[geom, 0] == pytest.approx(0.012)
        if model.geom_bodyid[geom] in bodies and not rod:
            assert not drawn[geom]
    assert model.vis.global_.offwidth == 320


def test_what_stands_on_a_column_has_its_radius():
    robot = load_robot("ur5")
    radius = pedestal_radius(robot)
    model = arm_visuals(robot, VIEW, 64, 64)
    columns = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER)
    assert radius in model.geom_size[columns, 0]
