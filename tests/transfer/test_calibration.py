"""The likeliest model of an arm whose throws came down elsewhere."""

from types import SimpleNamespace

import numpy as np
import pytest

from besman.robot.model import load_robot
from besman.transfer.approach import RealTry
from besman.transfer.archive import Archive
from besman.transfer.calibration import (
    Touchdown,
    _most_likely,
    calibrate,
    landings_of,
    n_model_parameters,
    world_at,
)


def silent(done):
    """Take no notice of progress."""


def test_of_a_linear_model_it_is_the_regression_with_a_prior():
    """Closed form: ridge regression, whose penalty is one standard deviation of each."""
    random = np.random.default_rng(3)
    slopes, real = random.normal(size=(3, 2, 9)), random.normal(size=(3, 2))
    found = _most_likely(lambda points: np.einsum("rik,pk->pri", slopes, points) - real, 9, silent)
    flat = slopes.reshape(6, 9)
    expected = np.linalg.solve(flat.T @ flat + np.eye(9), flat.T @ real.ravel())
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_what_lands_in_no_model_says_nothing():
    lands_nowhere = lambda points: np.full((len(points), 1, 2), np.nan)  # noqa: E731
    assert _most_likely(lands_nowhere, 4, silent) is None
    assert calibrate(load_robot("ur5"), None, []) is None


def test_a_throw_that_fails_beside_the_model_stops_no_step():
    """Ahead on the first parameter nothing is thrown: the second one explains the landing."""

    def off(points):
        found = np.stack([points[:, 1] - 8.0, np.zeros(len(points))], axis=1)[:, None]
        found[points[:, 0] > 0.2] = np.nan
        return found

    np.testing.assert_allclose(_most_likely(off, 2, silent), [0.0, 4.0], atol=1e-9)


def test_at_the_middle_nothing_is_off_and_nothing_is_less_than_none():
    robot = load_robot("ur5", "stick_holder")
    world = world_at(robot, np.zeros(n_model_parameters(robot)))
    assert (world.friction, world.object_mass) == (1.0, 1.0)
    for name in ("link_masses", "servo_gains"):
        np.testing.assert_array_equal(getattr(world, name), np.ones(robot.n))
    for name in ("joint_friction", "joint_damping", "delays", "lags", "backlash", "offsets"):
        np.testing.assert_array_equal(getattr(world, name), np.zeros(robot.n))
    far = world_at(robot, np.full(n_model_parameters(robot), -2.0))
    for name in ("joint_friction", "joint_damping", "lags"):
        np.testing.assert_array_equal(getattr(far, name), np.zeros(robot.n))
    late = world_at(robot, np.eye(n_model_parameters(robot))[2])
    np.testing.assert_allclose(late.lags, 0.1)


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_arm_that_is_late_is_known_by_where_its_throws_come_down(jobs, monkeypatch):
    """Throws come down the shorter, the later the arm is; the heavier, the farther to the left."""
    robot = load_robot("ur5", "stick_holder")

    def land(plan, world):
        return np.array([plan - 3.0 * world.lags.mean(), 0.2 * np.log(world.object_mass), 0.0])

    def throw(robot, task, plan, worlds):
        return [SimpleNamespace(failure="", outcome=land(plan, world)) for world in worlds]

    monkeypatch.setattr("besman.transfer.calibration.try_perturbed", throw)
    landings = [Touchdown(reach, np.array([reach - 0.3, 0.0])) for reach in (2.0, 2.5, 1.5)]
    world = calibrate(robot, None, landings, jobs)
    assert world.lags.mean() == pytest.approx(0.1, abs=0.005)
    assert world.object_mass == pytest.approx(1.0)


def test_throws_that_failed_are_no_landings():
    archive = Archive(np.zeros((4, 1)), np.zeros((4, 2)), np.zeros((4, 6)), np.zeros(4))
    tried = [(0, [np.nan, np.nan]), (1, [0.4, 0.1]), (2, [0.0, -2.0]), (3, [0.0, 1.9])]
    tries = [RealTry(row, np.array(outcome)) for row, outcome in tried]
    space = SimpleNamespace(plan_at=lambda point: SimpleNamespace(target=np.array([0, 1.5, 0])))
    found = landings_of(space, archive, tries)
    # The last one was aimed in a model: by the simulation as it is it came down far away.
    np.testing.assert_array_equal([one.outcome for one in found], [[0.4, 0.1], [0.0, 1.9]])
