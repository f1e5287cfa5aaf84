"""What executions may tell of an arm: quantities of its robot.yaml, and their effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from besman.robot.drives import Drives
from besman.robot.model import Robot
from besman.robot.parts import read_only

FloatArray = npt.NDArray[np.float64]

PAYLOAD = "payload_kg"
"""The key of robot.yaml that is not a joint's."""

# Keys of a joint in robot.yaml, and what they are in `Drives`.
_OF_JOINTS = {
    "servo_gain": "gains",
    "delay_s": "delays",
    "lag_s": "lags",
    "friction_nm": "friction",
    "damping_nms_rad": "damping",
}
# Differences that matter; those of frictions are shares of the torque limit.
_GAIN, _FRICTION, _DAMPING, _PAYLOAD_KG = 0.1, 0.01, 0.01, 0.2
# A small lag does what a delay does: where the two are not told apart, it is a delay.
_LAG_S, _DELAY_S = 0.002, 0.003


@dataclass(frozen=True)
class Quantity:
    """One number of a robot.yaml.

    Attributes
    ----------
    key : str
        As it is called there.
    joint : int
        Whose it is; -1 of the arm's.
    unit : float
        Which difference of it matters.
    least, greatest : float
        Between which it is sought.
    """

    key: str
    joint: int
    unit: float
    least: float
    greatest: float


def quantities_of(robot: Robot, has_delays: bool) -> tuple[Quantity, ...]:
    """List what is sought of an arm: of every joint five quantities, of the arm its payload.

    Parameters
    ----------
    robot : Robot
    has_delays : bool
        Whether anything can be said of delays: when motions were sent off is known.
    """
    found = []
    for joint in range(robot.n):
        torque, speed = robot.limits.torque[joint], robot.limits.velocity[joint]
        found += [
            Quantity("servo_gain", joint, _GAIN, 0.1, 10.0),
            Quantity("lag_s", joint, _LAG_S, 0.0, 0.6),
            Quantity("friction_nm", joint, _FRICTION * torque, 0.0, 0.5 * torque),
            Quantity("damping_nms_rad", joint, _DAMPING * torque / speed, 0.0, torque / speed),
        ]
        if has_delays:
            found.append(Quantity("delay_s", joint, _DELAY_S, 0.0, 0.3))
    return (*found, Quantity(PAYLOAD, -1, _PAYLOAD_KG, 0.0, 50.0))


def values_of(drives: Drives, quantities: Sequence[Quantity]) -> FloatArray:
    """Return the values (D,) that an arm has now."""
    arrays = {key: getattr(drives, name) for key, name in _OF_JOINTS.items()}
    return np.array(
        [drives.payload if one.joint < 0 else arrays[one.key][one.joint] for one in quantities]
    )


def drives_with(drives: Drives, quantities: Sequence[Quantity], values: FloatArray) -> Drives:
    """Return drives with other values (D,) of some quantities."""
    changed = {name: getattr(drives, name).copy() for name in _OF_JOINTS.values()}
    payload = drives.payload
    for one, value in zip(quantities, values, strict=True):
        if one.key == PAYLOAD:
            payload = float(value)
        else:
            changed[_OF_JOINTS[one.key]][one.joint] = value
    arrays = {name: read_only(array) for name, array in changed.items()}
    return replace(drives, **arrays, payload=payload)
