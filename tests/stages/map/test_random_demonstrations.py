"""Random demonstrations on all arms: nothing that is kept violates a limit at 1 kHz.

Five hundred of them, ten thousand where `.ci/run` asks for these in BESMAN_RANDOM_DEMONSTRATIONS.
One in a hundred goes from the hand's poses through inverse kinematics on, the others are paths of
the joints that go through limits alone, which takes a tenth as long.
`benchmarks/random_demonstrations.py` sends any number from the hand on.
"""

import os
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from demonstrations import attempts, checks
from demonstrations.attempts import attempt
from demonstrations.draws import KINDS, ROBOTS, draw

from besman.exceptions import MappingError
from besman.io.exports import read_joint_csv, write_joint_csv
from besman.robot.collision import distances
from besman.robot.model import load_robot

SEED, BLOCK = 18, 500
BLOCKS = int(os.environ.get("BESMAN_RANDOM_DEMONSTRATIONS", BLOCK)) // BLOCK


@pytest.mark.slow
@pytest.mark.parametrize("block", range(BLOCKS))
def test_nothing_that_is_kept_violates_a_limit(block):
    numbers = range(block * BLOCK, (block + 1) * BLOCK)
    tried = [attempt(SEED, number, hand=number % 101 == 0) for number in numbers]
    assert [one for one in tried if one.found] == []
    assert {one.robot for one in tried if not one.reason} == set(ROBOTS)
    assert {one.kind for one in tried} == set(KINDS)
    assert sum(one.samples for one in tried) > 100 * BLOCK


def test_a_number_is_one_demonstration():
    for number in range(12):
        hand = draw(3, number, True), draw(3, number, True)
        joints = draw(3, number, False), draw(3, number, False)
        assert np.array_equal(hand[0].path.poses, hand[1].path.poses)
        assert np.array_equal(joints[0].path, joints[1].path)
        assert hand[0].settings == hand[1].settings
        assert hand[0].robot is joints[1].robot


def at_home(n_samples=40):
    """Stand still at home, in something that may be spoiled."""
    robot = load_robot("ur5")
    still = np.zeros((n_samples, robot.n))
    return robot, [np.arange(n_samples) / 1000, still + robot.home, still.copy(), still.copy()]


def spoil(movement, kind, robot):
    time, positions, velocities, accelerations = movement
    if kind == "not finite":
        velocities[3, 0] = np.nan
    elif kind == "time":
        time[5] = time[4]
    elif kind == "position":
        positions[:, 0] = robot.limits.position_max[0] + 1e-8
    elif kind == "velocity":
        velocities[7, 1] = robot.limits.velocity[1] * (1 + 1e-8)
    elif kind == "acceleration":
        accelerations[7, 1] = -robot.limits.acceleration[1] * (1 + 1e-8)
    elif kind == "velocity, by differences":
        positions[20:, 2] += 1.01e-3 * robot.limits.velocity[2]
    elif kind == "acceleration, by differences":
        positions[20:, 2] += 1.01e-6 * robot.limits.acceleration[2]
    elif kind in ("torque", "torque, by Pinocchio"):
        accelerations[:, 1] = 200.0
    elif kind in ("self_collisions", "touch, by Coal"):
        positions[:, 2] = np.pi


@pytest.mark.parametrize(
    "kind",
    [
        "not finite",
        "time",
        "position",
        "velocity",
        "acceleration",
        "velocity, by differences",
        "acceleration, by differences",
        "torque",
        "torque, by Pinocchio",
        "self_collisions",
        "touch, by Coal",
    ],
)
def test_what_is_violated_is_found(kind):
    robot, movement = at_home()
    rng = np.random.default_rng(0)
    assert checks.violations(robot, tuple(movement), rng, 3) == Counter()
    spoil(movement, kind, robot)
    assert checks.violations(robot, tuple(movement), rng, 3)[kind] > 0


@pytest.mark.parametrize("name", ROBOTS)
def test_distances_agree_with_coal(name):
    robot, rng = load_robot(name), np.random.default_rng(2)
    for angles in rng.uniform(robot.limits.position_min, robot.limits.position_max, (20, robot.n)):
        nearest = distances(robot.chain, angles).min()
        # Where capsules overlap, Coal only knows that they do.
        got = checks.coal_distance(robot, angles)
        assert got == pytest.approx(nearest, abs=1e-5) or max(got, nearest) <= 1e-5


def test_numbers_are_rounded_as_in_the_exported_csv(tmp_path):
    values = np.random.default_rng(0).normal(size=(50, 3)) * 10.0 ** np.arange(-3, 3, 2)
    values[0] = 0.0
    time, names = np.arange(50) / 1000, ("a", "b", "c")
    write_joint_csv(tmp_path / "a.csv", time, values, values, values, names)
    held = read_joint_csv(tmp_path / "a.csv")[1]
    assert np.allclose(checks.as_exported(values), held, rtol=1e-15, atol=0)


def test_an_error_that_is_none_of_besmans_own_is_a_fault(monkeypatch):
    def broken(*arguments):
        raise ZeroDivisionError("x")

    monkeypatch.setattr(attempts, "map_one", broken)
    found = attempt(1, 0)
    assert found.found == {"traceback": 1}
    assert "ZeroDivisionError: x" in found.words


def test_a_refusal_is_counted_by_its_reason(monkeypatch):
    def refused(*arguments):
        raise MappingError("1:0: got 3 of 4.5e-3 m (ur5), at 2 s")

    monkeypatch.setattr(attempts, "map_one", refused)
    assert attempt(1, 0).reason == "got N of N m"


def test_limits_hold_for_what_is_refused_too(monkeypatch):
    whole = attempts.map_one

    def fast(*arguments):
        trajectory, report = whole(*arguments)
        return trajectory, replace(report, velocity=3)

    monkeypatch.setattr(attempts, "map_one", fast)
    tried = [attempt(1, number) for number in range(24)]
    reasons = {one.reason for one in tried}
    assert {"position error N m at N s"} <= reasons
    assert all(one.found["velocity, refused"] == 3 for one in tried if np.isfinite(one.stretch))
