"""Every robot that is there: Pinocchio, MuJoCo and the arrays are the same arm."""

import mujoco
import numpy as np
import pinocchio
import pytest

from besman.robot.collision import distances
from besman.robot.dynamics import inverse_dynamics
from besman.robot.kinematics import forward_kinematics, jacobian, manipulability
from besman.robot.model import find_robot, list_robots, load_robot
from besman.robot.mujoco_model import arm_spec

THROWERS = ("ur5", "ur10", "iiwa7", "compi")


@pytest.fixture(scope="module", params=list_robots())
def arm(request):
    robot = load_robot(request.param)
    rng = np.random.default_rng(0)
    low, high = robot.limits.position_min, robot.limits.position_max
    states = rng.uniform(low, high, (30, robot.n)), *rng.normal(size=(2, 30, robot.n))
    return robot, robot.model.createData(), arm_spec(robot, 0.002)[0].compile(), states


def test_forward_kinematics(arm):
    robot, data, model, (angles, _, _) = arm
    other = mujoco.MjData(model)
    for q, pose in zip(angles, forward_kinematics(robot.chain, angles), strict=True):
        pinocchio.framesForwardKinematics(robot.model, data, q)
        np.testing.assert_allclose(pose, data.oMf[robot.tip_frame].homogeneous, atol=1e-9)
        other.qpos[:] = q
        mujoco.mj_kinematics(model, other)
        np.testing.assert_allclose(other.site("tcp").xpos, pose[:3, 3], atol=1e-9)
        np.testing.assert_allclose(other.site("tcp").xmat.reshape(3, 3), pose[:3, :3], atol=1e-9)


def test_jacobian(arm):
    robot, data, _, (angles, _, _) = arm
    for q, matrix in zip(angles, jacobian(robot.chain, angles), strict=True):
        expected = pinocchio.computeFrameJacobian(
            robot.model, data, q, robot.tip_frame, pinocchio.LOCAL_WORLD_ALIGNED
        )
        np.testing.assert_allclose(matrix, expected, atol=1e-9)


def test_inverse_dynamics(arm):
    robot, data, model, states = arm
    other = mujoco.MjData(model)
    torques = inverse_dynamics(robot, *states)
    for q, dq, ddq, torque in zip(*states, torques, strict=True):
        expected = pinocchio.rnea(robot.model, data, q, dq, ddq)
        other.qpos[:], other.qvel[:], other.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, other)
        np.testing.assert_allclose(other.qfrc_inverse, expected, atol=1e-8)
        np.testing.assert_allclose(torque, expected, atol=1e-8)


def test_home_is_usable(arm):
    robot, data, _, states = arm
    # Neighbours may be nearer in every pose.
    roomiest = distances(robot.chain, states[0]).min(axis=1).max()
    assert distances(robot.chain, robot.home).min() > min(0.02, 0.8 * roomiest)
    if robot.n >= 6:
        assert manipulability(robot.chain, robot.home) > 1e-3
    else:
        matrix = jacobian(robot.chain, robot.home)
        assert np.sqrt(np.linalg.det(matrix.T @ matrix)) > 1e-3
    held = pinocchio.computeGeneralizedGravity(robot.model, data, robot.home)
    assert (np.abs(held) < robot.limits.torque).all()


def test_sources_are_there_and_the_name_is_the_folders(arm):
    path = find_robot(arm[0].name)
    assert path.parent.name == arm[0].name
    text = (path.parent / "SOURCES.md").read_text()
    assert "| number | value | source |" in text or "| number | source |" in text
    assert "**assumed**" in text


@pytest.mark.parametrize("name", THROWERS)
def test_tools_of_the_throwers(name):
    for tool in ("scoop", "stick_holder", "gripper", "none"):
        assert load_robot(name, tool).tool.name == tool


@pytest.mark.parametrize(
    ("name", "reach_m"), [("ur5", 0.85), ("ur10", 1.3), ("iiwa7", 0.926), ("compi", 0.966)]
)
def test_the_reach_is_the_published_one(name, reach_m):
    robot = load_robot(name, "none")
    rng = np.random.default_rng(0)
    low, high = robot.limits.position_min, robot.limits.position_max
    tips = forward_kinematics(robot.chain, rng.uniform(low, high, (20000, robot.n)))[:, :3, 3]
    shoulder = robot.chain.placements[0, :3, 3] + robot.chain.placements[1, 2, 3] * np.eye(3)[2]
    farthest = np.linalg.norm(tips - shoulder, axis=1).max()
    assert reach_m - 0.06 < farthest < reach_m + 0.15
