import io
import re

import numpy as np
import pytest
from rich.console import Console

from besman.exceptions import RobotError
from besman.report.robot_tables import reach, robot_table, robots_table
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import list_robots, load_robot


def shown(table):
    console = Console(width=200, file=io.StringIO())
    console.print(table)
    return console.file.getvalue()


@pytest.mark.parametrize("name", ["ur5", "iiwa7"])
def test_no_configuration_reaches_farther_than_the_length(name):
    robot = load_robot(name)
    rng = np.random.default_rng(0)
    low, high = robot.limits.position_min, robot.limits.position_max
    poses = forward_kinematics(robot.chain, rng.uniform(low, high, (3000, robot.n)))
    tip = np.linalg.norm(robot.chain.tip[:3, 3])
    second = robot.chain.placements[0] @ robot.chain.placements[1]
    far = np.linalg.norm(poses[:, :3, 3] - second[:3, 3], axis=1).max()
    # The second joint's origin turns about the first: not by more than it is off its axis.
    off = 2 * np.linalg.norm(robot.chain.placements[1][:2, 3])
    assert far <= reach(robot) + tip + off
    assert far >= 0.6 * reach(robot)


def test_every_robot_is_a_row():
    text = shown(robots_table())
    for name in list_robots():
        (row,) = [line for line in text.splitlines() if f" {name} " in line]
        robot = load_robot(name)
        assert f"{reach(robot):.2f}" in row
        speeds = np.rad2deg(robot.limits.velocity)
        assert f" {speeds.min():.0f} to {speeds.max():.0f} " in row
        # A robot that names no tools has all of them.
        assert re.split(r"[│|]", row)[-2].strip()


def test_limits_of_one_robot_are_degrees_and_its_sources_are_named():
    robot, text = load_robot("ur5"), shown(robot_table("ur5"))
    assert "ur5: base" in text
    assert "SOURCES.md" in text
    for row, joint in enumerate(robot.joint_names):
        (line,) = [line for line in text.splitlines() if f" {joint} " in line]
        assert f"{np.rad2deg(robot.limits.velocity[row]):.0f}" in line
        assert f"{robot.limits.torque[row]:.0f}" in line
    with pytest.raises(RobotError, match="no robot 'ur6'; did you mean 'ur5'"):
        robot_table("ur6")
