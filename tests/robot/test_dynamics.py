import numpy as np
import pinocchio

from besman.robot.dynamics import _newton_euler, inverse_dynamics
from besman.robot.model import load_robot

ROBOT = load_robot("ur5", "stick_holder")


def test_agrees_with_pinocchio():
    data = ROBOT.model.createData()
    q, dq, ddq = np.random.default_rng(0).normal(scale=2, size=(3, 50, 6))
    expected = [pinocchio.rnea(ROBOT.model, data, *state) for state in zip(q, dq, ddq, strict=True)]
    np.testing.assert_allclose(inverse_dynamics(ROBOT, q, dq, ddq), expected, atol=1e-10)


def test_keeps_the_shape_of_a_batch():
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 2, 5, 6))
    torques = inverse_dynamics(ROBOT, q, dq, ddq)
    assert torques.shape == (2, 5, 6)
    np.testing.assert_array_equal(
        torques[1, 3], inverse_dynamics(ROBOT, q[1, 3], dq[1, 3], ddq[1, 3])
    )


def test_records_need_no_kernel_of_their_own():
    moved = np.zeros((4, 6))
    kept = moved.copy()
    kept.flags.writeable = False
    for values in (moved, kept, [[0.0] * 6], moved[::2], np.asfortranarray(moved)):
        inverse_dynamics(ROBOT, values, values, values)
    assert len(_newton_euler.signatures) == 1
