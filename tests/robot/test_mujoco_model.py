import mujoco
import numpy as np
import pinocchio
import pytest

from besman.robot.dynamics import inverse_dynamics
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.robot.mujoco_model import arm_spec, matrix_to_quaternion, servo_controls, servo_gains

ROBOT = load_robot("ur5", "gripper")
MODEL = arm_spec(ROBOT, 0.002)[0].compile()


def random_states(count=40):
    return np.random.default_rng(0).normal(size=(3, count, 6))


def test_inverse_dynamics_is_that_of_pinocchio():
    data, other = mujoco.MjData(MODEL), ROBOT.model.createData()
    for q, dq, ddq in zip(*random_states(), strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(MODEL, data)
        expected = pinocchio.rnea(ROBOT.model, other, q, dq, ddq)
        np.testing.assert_allclose(data.qfrc_inverse, expected, atol=1e-8)


def test_tool_centre_point_is_that_of_the_kinematics():
    data = mujoco.MjData(MODEL)
    for q in random_states()[0]:
        data.qpos[:] = q
        mujoco.mj_kinematics(MODEL, data)
        pose = forward_kinematics(ROBOT.chain, q)
        np.testing.assert_allclose(data.site("tcp").xpos, pose[:3, 3], atol=1e-9)
        np.testing.assert_allclose(data.site("tcp").xmat.reshape(3, 3), pose[:3, :3], atol=1e-9)


def test_servos_at_their_set_points_give_the_torques_of_the_movement():
    data = mujoco.MjData(MODEL)
    q, dq, ddq = random_states()
    controls = servo_controls(ROBOT, q, dq, 0.1 * ddq)
    torques = inverse_dynamics(ROBOT, q, dq, 0.1 * ddq)
    for index in range(len(q)):
        data.qpos[:], data.qvel[:], data.ctrl[:] = q[index], dq[index], controls[index]
        mujoco.mj_forward(MODEL, data)
        limit = ROBOT.limits.torque
        expected = np.clip(torques[index], -limit, limit)
        np.testing.assert_allclose(data.qfrc_actuator, expected, atol=1e-8)


def test_gains_saturate_at_a_small_deviation():
    gains = servo_gains(ROBOT)
    np.testing.assert_allclose(gains.kp * 0.03, ROBOT.limits.torque)
    assert (gains.kv > 0).all()


def test_links_do_not_meet_each_other():
    data = mujoco.MjData(MODEL)
    for q in random_states()[0]:
        data.qpos[:] = q
        mujoco.mj_forward(MODEL, data)
        assert data.ncon == 0


def test_quaternion_of_a_matrix():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert matrix_to_quaternion(turn) == pytest.approx([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
