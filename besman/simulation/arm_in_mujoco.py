"""An arm alone in MuJoCo, driven by set-points as they come."""

from __future__ import annotations

import numpy as np

from besman.records import FloatArray
from besman.robot.limits import RATE_HZ
from besman.robot.model import Robot
from besman.robot.mujoco_log import silence_mujoco
from besman.robot.mujoco_model import arm_spec, servo_controls


class ArmInMujoco:
    """Follows set-points by its servos, a millisecond a step.

    Parameters
    ----------
    robot : Robot
    start : array, shape (n,)
        Where it rests, rad.
    """

    def __init__(self, robot: Robot, start: FloatArray) -> None:
        import mujoco

        silence_mujoco()
        spec, _ = arm_spec(robot, 1.0 / RATE_HZ)
        self._robot, self._step = robot, mujoco.mj_step
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:] = start

    @property
    def positions(self) -> FloatArray:
        """Where the joints are, shape (n,), rad."""
        return np.array(self._data.qpos)

    @property
    def torques(self) -> FloatArray:
        """What the servos gave in the last step, shape (n,), Nm."""
        return np.array(self._data.actuator_force)

    def follow(
        self, positions: FloatArray, velocities: FloatArray, accelerations: FloatArray
    ) -> FloatArray:
        """Simulate as many milliseconds as there are set-points.

        Parameters
        ----------
        positions, velocities, accelerations : array, shape (K, n)
            rad, rad/s, rad/s^2, at 1 kHz.

        Returns
        -------
        array, shape (K, n)
            Where the joints were after each, rad.
        """
        reached = np.empty(positions.shape)
        controls = servo_controls(self._robot, positions, velocities, accelerations)
        for row, control in enumerate(controls):
            self._data.ctrl[:] = control
            self._step(self._model, self._data)
            reached[row] = self._data.qpos
        return reached
