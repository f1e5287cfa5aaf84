from dataclasses import replace

import numpy as np
import pytest

from besman.robot.kinematics import forward_kinematics, jacobian, manipulability
from besman.robot.model import load_robot
from besman.stages.map.terms import cheapest_terms, heaviness, is_weak, path_terms
from besman.stages.map.terms_kernel import manipulability_of


@pytest.mark.parametrize("name", ["ur5", "iiwa7"])
@pytest.mark.parametrize("dear", [0.0, 3.0, 1e3])
def test_the_cheapest_branch_is_that_of_the_plain_terms(name, dear):
    robot = load_robot(name, "stick_holder")
    rng = np.random.default_rng(1)
    ways = rng.uniform(-0.5, 0.5, (6, 4, 1, robot.n)) * np.linspace(0, 1, 5)[:, None]
    positions = robot.home + rng.uniform(-1.5, 1.5, (6, 4, 1, robot.n)) + ways
    errors = rng.uniform(0, 0.05, (6, 4, 5, 2))
    targets = forward_kinematics(robot.chain, positions[:, 0] + 0.1)
    steps_s = rng.uniform(0.02, 0.2, 6)
    weights, more = np.array([1.0, 0.3, 1.0, dear, 3.0, 1.0]), rng.uniform(0, 2, (6, 4))
    plain = path_terms(robot, positions, errors, targets[:, None], steps_s[:, None, None, None])
    expected = np.argmin(plain @ weights + more, axis=1)
    terms, branches = cheapest_terms(robot, positions, errors, targets, steps_s, weights, more)
    np.testing.assert_array_equal(branches, expected)
    np.testing.assert_allclose(terms, plain[np.arange(6), expected], rtol=1e-9, atol=1e-9)
    alone, _ = cheapest_terms(robot, positions[:, :1], errors[:, :1], targets, steps_s, np.zeros(6))
    np.testing.assert_allclose(alone, plain[:, 0], rtol=1e-9, atol=1e-9)
    assert np.sum(plain.max(axis=(0, 1)) > 0) >= 3


def test_manipulability_by_cholesky():
    robot = load_robot("iiwa7", "none")
    for angles in np.random.default_rng(0).uniform(-2, 2, (10, robot.n)):
        found = manipulability_of(jacobian(robot.chain, angles), np.empty((6, 6)))
        assert found == pytest.approx(float(manipulability(robot.chain, angles)), rel=1e-9)
    assert manipulability_of(np.zeros((6, 7)), np.empty((6, 6))) == 0.0


def test_an_arm_that_can_hardly_hold_itself_is_told_where():
    robot = load_robot("ur5", "stick_holder")
    limits = robot.limits
    weak = replace(robot, limits=replace(limits, torque=0.2 * limits.torque))
    assert not is_weak(robot)
    assert is_weak(weak)
    # Stretched out forward, and upright.
    paths = np.array([[0.0, 0, 0, 0, 0, 0], [0.0, -np.pi / 2, 0, 0, 0, 0]])[:, None]
    out, up = heaviness(weak, paths)
    assert up == 0.0
    assert 1.0 < out < 2.0
    assert out < heaviness(replace(robot, limits=replace(limits, torque=1e-3)), paths[:1])[0] < 2.0
