"""Loaded in a process that others are forked from: they have what an arm's kernels take to load."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from besman.exceptions import RobotError
from besman.robot.collision import distances
from besman.robot.dynamics import inverse_dynamics
from besman.robot.model import load_robot


def load_kernels() -> None:
    """Have Numba load from its cache what every simulation of an arm calls."""
    robot = load_robot("ur5")
    resting = np.tile(robot.home, (1, 2, 1))
    inverse_dynamics(robot, resting, resting, resting)
    distances(robot.chain, resting)


# Why an arm cannot be loaded says the process that needs one.
with suppress(RobotError):
    load_kernels()
