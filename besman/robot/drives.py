"""How an arm's servos and joints differ from ideal ones, as far as a robot.yaml says so."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from besman.robot.config import RobotConfig
from besman.robot.parts import Tool, read_only

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Drives:
    """What n joints do with the set-points that they get, and what they carry.

    The controller does not know of it: set-points are those of ideal servos.

    Attributes
    ----------
    gains : array, shape (n,)
        Factors of both gains of each servo, see `besman.robot.mujoco_model.servo_gains`.
    delays, lags : array, shape (n,)
        How late a servo gets its set-points, and the time constant with which these are smoothed;
        seconds.
    friction, damping : array, shape (n,)
        Dry friction, Nm, and viscous friction, Nm s/rad.
    payload : float
        What it carries besides its tool, kg.
    payload_centre : array, shape (3,)
        Where that is, in the flange's frame, metres: the middle of the tool.
    """

    gains: FloatArray
    delays: FloatArray
    lags: FloatArray
    friction: FloatArray
    damping: FloatArray
    payload: float
    payload_centre: FloatArray

    @property
    def are_late(self) -> bool:
        """Whether any servo gets other set-points than are sent."""
        return bool(self.delays.any() or self.lags.any())


def drives_of(config: RobotConfig, tool: Tool) -> Drives:
    """Collect what a robot.yaml says of its drives, with one of its tools mounted."""
    joints = config.joints
    return Drives(
        gains=read_only([joint.servo_gain for joint in joints]),
        delays=read_only([joint.delay_s for joint in joints]),
        lags=read_only([joint.lag_s for joint in joints]),
        friction=read_only([joint.friction_nm for joint in joints]),
        damping=read_only([joint.damping_nms_rad for joint in joints]),
        payload=config.payload_kg,
        payload_centre=read_only(tool.capsule_ends.mean(axis=0)),
    )


def delay_and_smooth(
    values: FloatArray, delay_s: float, lag_s: float, time_step_s: float
) -> FloatArray:
    """Return what comes of the set-points (T,) of one servo, sampled at a step, from rest.

    Parameters
    ----------
    values : array, shape (T,)
        rad.
    delay_s : float
        How late they come.
    lag_s : float
        Time constant of a first-order lag after that.
    time_step_s : float
    """
    late = values
    if delay_s > 0:
        time = np.asarray(time_step_s * np.arange(len(values)), dtype=np.float64)
        late = np.interp(time - delay_s, time, late)
    if lag_s > 0:
        from scipy.signal import lfilter

        # Exact for set-points that are straight between the steps, so that lags below a step count.
        kept = np.exp(-time_step_s / lag_s)
        share = lag_s / time_step_s * (1.0 - kept)
        new, old = 1.0 - share, share - kept
        late, _ = lfilter([new, old], [1.0, -kept], late, zi=[(1.0 - new) * late[0]])
    return np.asarray(late)


def arrive_late(setpoints: FloatArray, drives: Drives, time_step_s: float) -> FloatArray:
    """Return the set-points that an arm's servos get of those that are sent.

    Parameters
    ----------
    setpoints : array, shape (B, T, n)
        rad, from rest.
    drives : Drives
    time_step_s : float

    Returns
    -------
    array, shape (B, T, n)
        The same array, if they come as they are sent.
    """
    if not drives.are_late:
        return setpoints
    late = np.empty_like(setpoints)
    for row in range(len(setpoints)):
        for joint, (delay, lag) in enumerate(zip(drives.delays, drives.lags, strict=True)):
            late[row, :, joint] = delay_and_smooth(
                setpoints[row, :, joint], delay, lag, time_step_s
            )
    return late
