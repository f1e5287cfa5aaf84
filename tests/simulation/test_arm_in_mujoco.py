"""An arm alone in MuJoCo is where its set-points are, and bears its weight."""

import numpy as np
import pinocchio
import pytest

from besman.simulation.arm_in_mujoco import ArmInMujoco


def test_it_bears_its_weight_at_rest_by_the_torques_of_another_dynamics(robot):
    arm = ArmInMujoco(robot, robot.home)
    still = np.zeros((300, robot.n))
    reached = arm.follow(np.tile(robot.home, (300, 1)), still, still)
    np.testing.assert_allclose(reached[-1], robot.home, atol=1e-4)
    weight = pinocchio.computeGeneralizedGravity(robot.model, robot.model.createData(), robot.home)
    np.testing.assert_allclose(arm.torques, weight, atol=0.05)


def test_it_is_where_it_is_sent_in_one_call_as_in_many(robot):
    at = np.arange(600)[:, None] * 1e-3
    swing = 0.3 * np.array([1, 0.5, -0.5, 1, 1, 1.0])
    w = 2 * np.pi / 1.2
    movement = (
        robot.home + swing * (1 - np.cos(w * at)),
        swing * w * np.sin(w * at),
        swing * w**2 * np.cos(w * at),
    )
    reached = ArmInMujoco(robot, robot.home).follow(*movement)
    assert np.abs(reached - movement[0]).max() < 0.01
    pieces = ArmInMujoco(robot, robot.home)
    again = [pieces.follow(*(part[k : k + 10] for part in movement)) for k in range(0, 600, 10)]
    np.testing.assert_allclose(np.concatenate(again), reached, atol=1e-9)
    assert pieces.positions == pytest.approx(reached[-1], abs=1e-9)
