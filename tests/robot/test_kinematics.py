import numpy as np
import pinocchio
import pytest

from besman.exceptions import RobotError
from besman.robot.kinematics import forward_kinematics, jacobian, manipulability
from besman.robot.model import load_robot

ROBOT = load_robot("ur5", "stick_holder")
ANGLES = np.random.default_rng(0).uniform(-3, 3, (50, 6))


def test_forward_kinematics_agrees_with_pinocchio():
    data = ROBOT.model.createData()
    for angles, pose in zip(ANGLES, forward_kinematics(ROBOT.chain, ANGLES), strict=True):
        pinocchio.framesForwardKinematics(ROBOT.model, data, angles)
        np.testing.assert_allclose(pose, data.oMf[ROBOT.tip_frame].homogeneous, atol=1e-12)


def test_the_jacobian_agrees_with_pinocchio():
    data = ROBOT.model.createData()
    for angles, matrix in zip(ANGLES, jacobian(ROBOT.chain, ANGLES), strict=True):
        expected = pinocchio.computeFrameJacobian(
            ROBOT.model, data, angles, ROBOT.tip_frame, pinocchio.LOCAL_WORLD_ALIGNED
        )
        np.testing.assert_allclose(matrix, expected, atol=1e-12)


def test_the_jacobian_agrees_with_finite_differences():
    step = 1e-6
    for angles in ANGLES[:10]:
        pose = forward_kinematics(ROBOT.chain, angles)
        for joint in range(6):
            moved = forward_kinematics(ROBOT.chain, angles + step * np.eye(6)[joint])
            linear = (moved[:3, 3] - pose[:3, 3]) / step
            turn = moved[:3, :3] @ pose[:3, :3].T
            angular = np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / step
            column = jacobian(ROBOT.chain, angles)[:, joint]
            np.testing.assert_allclose(column, np.r_[linear, angular], atol=1e-5)


def test_leading_axes_are_kept():
    stacked = ANGLES.reshape(5, 10, 6)
    assert forward_kinematics(ROBOT.chain, stacked).shape == (5, 10, 4, 4)
    assert jacobian(ROBOT.chain, stacked).shape == (5, 10, 6, 6)
    assert forward_kinematics(ROBOT.chain, ANGLES[0]).shape == (4, 4)


def test_manipulability_is_zero_when_the_elbow_is_straight():
    straight = np.array([0.3, -1.0, 0.0, 0.4, 1.0, 0.2])
    assert manipulability(ROBOT.chain, straight) == pytest.approx(0.0, abs=1e-9)
    matrix = jacobian(ROBOT.chain, ROBOT.home)
    expected = abs(np.linalg.det(matrix))
    assert manipulability(ROBOT.chain, ROBOT.home) == pytest.approx(expected)


def test_a_wrong_number_of_joints():
    with pytest.raises(RobotError, match=r"must have shape \(\.\.\., 6\), got \(3, 5\)"):
        forward_kinematics(ROBOT.chain, np.zeros((3, 5)))
