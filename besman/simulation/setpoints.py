"""What an arm's servos get of a movement, and where they should be then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from besman.robot.drives import arrive_late
from besman.robot.model import Robot
from besman.robot.mujoco_model import servo_controls
from besman.simulation.episodes import Movements

FloatArray = npt.NDArray[np.float64]


def servo_setpoints(robot: Robot, movements: Movements, time_step_s: float) -> FloatArray:
    """Return the set-points that the servos get.

    Parameters
    ----------
    robot : Robot
        With the task's tool. Its controller takes its servos for ideal ones, which its drives may
        not be.
    movements : Movements
        B movements, sampled at the time step.
    time_step_s : float

    Returns
    -------
    array, shape (B, T, n)
        rad.
    """
    distinct = movements.distinct
    sent = servo_controls(robot, distinct.positions, distinct.velocities, distinct.accelerations)
    late = arrive_late(sent, robot.drives, time_step_s)
    return late if distinct is movements else np.broadcast_to(late, movements.positions.shape)


def expected_movements(robot: Robot, movements: Movements, time_step_s: float) -> Movements:
    """Return the movements with the positions at which an arm is that is as late as its robot says.

    An arm that is known to be late has not failed for that.
    """
    return replace(movements, positions=arrive_late(movements.positions, robot.drives, time_step_s))
