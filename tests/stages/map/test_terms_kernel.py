import numpy as np
import pytest

from besman.robot.kinematics import forward_kinematics, jacobian, manipulability
from besman.robot.model import load_robot
from besman.stages.map.terms import compiled_terms, path_terms
from besman.stages.map.terms_kernel import manipulability_of


@pytest.mark.parametrize("name", ["ur5", "iiwa7"])
def test_terms_of_the_kernel_are_the_plain_ones(name):
    robot = load_robot(name, "stick_holder")
    rng = np.random.default_rng(1)
    ways = rng.uniform(-0.5, 0.5, (3, 2, 1, robot.n)) * np.linspace(0, 1, 5)[:, None]
    positions = robot.home + rng.uniform(-1.5, 1.5, (3, 2, 1, robot.n)) + ways
    errors = rng.uniform(0, 0.05, (3, 2, 5, 2))
    targets = forward_kinematics(robot.chain, positions[:, 0] + 0.1)
    steps_s = rng.uniform(0.02, 0.2, 3)
    plain = path_terms(robot, positions, errors, targets[:, None], steps_s[:, None, None, None])
    np.testing.assert_allclose(
        compiled_terms(robot, positions, errors, targets, steps_s), plain, rtol=1e-9, atol=1e-9
    )
    assert np.sum(plain.max(axis=(0, 1)) > 0) >= 3


def test_manipulability_by_cholesky():
    robot = load_robot("iiwa7", "none")
    for angles in np.random.default_rng(0).uniform(-2, 2, (10, robot.n)):
        found = manipulability_of(jacobian(robot.chain, angles), np.empty((6, 6)))
        assert found == pytest.approx(float(manipulability(robot.chain, angles)), rel=1e-9)
    assert manipulability_of(np.zeros((6, 7)), np.empty((6, 6))) == 0.0
