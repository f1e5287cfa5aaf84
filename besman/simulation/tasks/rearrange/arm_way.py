"""What arm and gripper do in a whole task."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.simulation.episodes import Movements
from besman.simulation.tasks.grasp_box.sections import GripperConfig

FloatArray = npt.NDArray[np.float64]


class ArmWay(NamedTuple):
    """What arm and gripper do, at the simulation's step.

    Attributes
    ----------
    movements : Movements
        One; `ends` is when all is over.
    commands_s : array, shape (E,)
        When the gripper closes or opens.
    closes : bool array, shape (E,)
    """

    movements: Movements
    commands_s: FloatArray
    closes: npt.NDArray[np.bool_]

    def finger_controls(
        self, gripper: GripperConfig, time: FloatArray, first_m: float = 0.0
    ) -> FloatArray:
        """Return the set-points of the fingers, metres from open, shape (T, 3); before that one."""
        speed, most = gripper.speed_m_s, gripper.opening_m / 2
        closed = np.full_like(time, first_m)
        for at, close in zip(self.commands_s, self.closes, strict=True):
            then = float(np.interp(at, time, closed))
            since = np.maximum(time - at, 0.0)
            moved = then + (speed if close else -speed) * since
            closed = np.where(time >= at, np.clip(moved, 0.0, most), closed)
        return np.repeat(closed[:, None], 3, axis=1)
