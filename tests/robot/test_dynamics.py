import mujoco
import numpy as np
import pinocchio
from scipy.optimize import minimize

from besman.robot.dynamics import _newton_euler, inverse_dynamics, possible_tensors
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


def test_moments_that_no_body_has_become_the_nearest_that_one_has():
    rng = np.random.default_rng(3)
    moments = [[0.1, 0.2, 0.5], [0.1, 0.2, 0.3], [0.2, 0.2, 0.2], [-0.1, 0.2, 0.25], [0.0] * 3]
    turns = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in moments]
    tensors = np.array([(turn * one) @ turn.T for turn, one in zip(turns, moments, strict=True)])
    masses = np.array([1.0, 1.0, 1.0, 2.0, 0.5])
    found = possible_tensors(masses, tensors)
    for tensor, one, mass in zip(found, moments, masses, strict=True):
        text = " ".join(map(repr, tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()))
        mujoco.MjModel.from_xml_string(
            f'<mujoco><worldbody><body><joint/><inertial pos="0 0 0" mass="{mass}" '
            f'fullinertia="{text}"/></body></worldbody></mujoco>'
        )
        bound = {"type": "ineq", "fun": lambda x: np.array([*x, *(x.sum() - 2 * x)])}
        nearest = minimize(lambda x: np.sum((x - one) ** 2), [0.1] * 3, constraints=bound).x  # noqa: B023
        np.testing.assert_allclose(np.linalg.eigvalsh(tensor), np.sort(nearest), atol=1e-4)
    np.testing.assert_array_equal(found[2], tensors[2])
    # What can be is handed on as it is, and so is what weighs nothing.
    assert possible_tensors(masses[2:3], tensors[2:3]).tolist() == tensors[2:3].tolist()
    np.testing.assert_array_equal(possible_tensors(np.zeros(5), tensors), tensors)
