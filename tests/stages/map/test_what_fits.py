import numpy as np
import pytest

from besman.exceptions import MappingError
from besman.records import HandTrajectory
from besman.robot.kinematics import forward_kinematics, jacobian
from besman.robot.model import load_robot
from besman.stages.map.stage import MapConfig
from besman.stages.map.what_fits import what_fits, why_it_cannot_fit

LOOKING_DOWN = np.array([0.5, -0.5, 0.5, 0.5])


def line(length, duration=1.0, name="a.tsv:0"):
    time = np.linspace(0, duration, 51)
    path = np.outer(np.linspace(0, length, 51), [1.0, 0, 0])
    return HandTrajectory(time, np.hstack([path, np.tile(LOOKING_DOWN, (51, 1))]), name, "reach")


@pytest.mark.parametrize("name", ["ur5", "iiwa7", "compi"])
def test_no_configuration_beats_the_bounds(name):
    robot = load_robot(name, "stick_holder")
    low, high = robot.limits.position_min, robot.limits.position_max
    rows = np.random.default_rng(0).uniform(low, high, (4000, robot.n))
    poses = forward_kinematics(robot.chain, rows)
    fit = what_fits(robot, np.arange(200.0), poses[:200])
    apart = np.linalg.norm(poses[::2, :3, 3] - poses[1::2, :3, 3], axis=1).max()
    assert 0.6 * fit.span_m < apart <= fit.span_m
    speeds = np.abs(jacobian(robot.chain, rows)[:, :3]) @ robot.limits.velocity
    # Each coordinate alone is at most the whole speed.
    assert speeds.max() <= fit.greatest_speed_m_s
    assert fit.extent_m == pytest.approx(
        max(np.linalg.norm(one - poses[:200, :3, 3], axis=1).max() for one in poses[:200, :3, 3])
    )


def test_what_fits_and_what_does_not():
    robot = load_robot("ur5", "gripper")
    time, poses = np.linspace(0, 1, 3), np.tile(np.eye(4), (3, 1, 1))
    poses[:, 0, 3] = 0.0, 4.0, 8.0
    fit = what_fits(robot, time, poses)
    assert fit.extent_m == 8.0
    assert fit.speed_m_s == 8.0
    assert fit.scale == pytest.approx(fit.span_m / 8.0)
    assert why_it_cannot_fit(fit, fit.scale) == ""
    assert f"made smaller by {np.floor(100 * fit.scale) / 100:.2f} it may fit" in why_it_cannot_fit(
        fit, 1.0
    )
    slow = what_fits(robot, time / 10, poses)
    assert slow.speed_share == pytest.approx(slow.greatest_speed_m_s / 80.0)
    assert f"at most {slow.speed_share:.0%} of its speed" in why_it_cannot_fit(slow, 1.0)
    still = what_fits(robot, time, np.tile(np.eye(4), (3, 1, 1)))
    assert still.scale == still.speed_share == 1.0


def test_an_arm_that_is_too_short_says_so_before_it_searches(monkeypatch):
    monkeypatch.setattr("besman.stages.map.map_demonstrations.find_placement", None)
    robot = load_robot("ur5", "gripper")
    message = r"ur5 \(tool gripper\) is too short for all of 2 demonstrations; .*5.00 m apart"
    with pytest.raises(MappingError, match=message):
        MapConfig().run((line(4.0), line(5.0, name="a.tsv:1")), robot)


def test_one_that_is_too_large_is_left_out():
    robot = load_robot("ur5", "gripper")
    mapping = MapConfig(evaluations=20, yaw=False).run(
        (line(0.2), line(5.0, name="a.tsv:1")), robot
    )
    assert [one.name for one in mapping.failed] == ["a.tsv:1"]
    assert "made smaller by" in mapping.failed[0].reason
