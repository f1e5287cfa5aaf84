"""The arm by itself, as it follows set-points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from besman.robot.model import Robot
from besman.robot.mujoco_model import arm_spec
from besman.simulation.physics import SimulatedStates, run_physics

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]


def arm_model(robot: Robot, time_step_s: float) -> mujoco.MjModel:
    """Build the scene: the arm with its tool, which nothing touches."""
    return arm_spec(robot, time_step_s)[0].compile()


def follow_setpoints(
    robot: Robot, starts: FloatArray, setpoints: FloatArray, time_step_s: float
) -> FloatArray:
    """Return where the arm with its tool is, without anything that it could touch.

    Parameters
    ----------
    robot : Robot
        With its tool; its drives say what its servos and joints do.
    starts : array, shape (B, n)
        Joint angles at rest, rad.
    setpoints : array, shape (B, T, n)
        What its servos get at every step, rad.
    time_step_s : float

    Returns
    -------
    array, shape (B, T, n)
        Joint angles at the time of every set-point, the first of all the start.
    """
    model = arm_model(robot, time_step_s)

    def finished(run: SimulatedStates, span: slice) -> npt.NDArray[np.bool_]:
        return np.zeros(len(starts), dtype=bool)

    run = run_physics(model, starts, setpoints, finished)
    return np.concatenate([starts[:, None], run.qpos[:, :-1]], axis=1)
