"""Robots as tables for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from besman.robot.model import Robot, find_robot, list_robots, load_robot
from besman.robot.tool_shelf import shelf_tools

if TYPE_CHECKING:
    from rich.table import Table


def reach(robot: Robot) -> float:
    """Return the greatest distance of the flange from the second joint, metres.

    The sum of the lengths between the joints from the second on: what a data sheet calls radius,
    where the arm can stretch.
    """
    lengths = np.linalg.norm(robot.chain.placements[2:, :3, 3], axis=1)
    return float(lengths.sum())


def robots_table() -> Table:
    """Return a table of all robots."""
    from rich.table import Table

    table = Table("robot", "joints", "length [m]", "speed [deg/s]", "tools")
    for name in list_robots():
        robot = load_robot(name)
        tools = ", ".join(robot.content["config"]["tools"] or shelf_tools())
        slow, fast = np.rad2deg([robot.limits.velocity.min(), robot.limits.velocity.max()])
        table.add_row(name, str(robot.n), f"{reach(robot):.2f}", f"{slow:.0f} to {fast:.0f}", tools)
    return table


def robot_table(name: str) -> Table:
    """Return one robot's limits, and where its numbers come from.

    Raises
    ------
    RobotError
        If there is no such robot.
    """
    from rich.table import Table

    robot = load_robot(name)
    sources = find_robot(name).with_name("SOURCES.md")
    table = Table(
        title=f"{robot.name}: base {robot.base_height:g} m above the floor",
        caption=f"origin of every number: {sources}" if sources.is_file() else None,
    )
    for column in (
        "joint",
        "from [deg]",
        "to [deg]",
        "speed [deg/s]",
        "accel. [rad/s2]",
        "torque [Nm]",
        "home [deg]",
    ):
        table.add_column(column, justify="left" if column == "joint" else "right")
    limits = robot.limits
    for row, joint in enumerate(robot.joint_names):
        table.add_row(
            joint,
            f"{np.rad2deg(limits.position_min[row]):.0f}",
            f"{np.rad2deg(limits.position_max[row]):.0f}",
            f"{np.rad2deg(limits.velocity[row]):.0f}",
            f"{limits.acceleration[row]:.1f}",
            f"{limits.torque[row]:.0f}",
            f"{np.rad2deg(robot.home[row]):.0f}",
        )
    return table
