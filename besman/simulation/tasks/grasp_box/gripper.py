"""A gripper of three fingers that close on rails: two of them against a thumb."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from besman.robot.mujoco_model import ARM_BIT
from besman.simulation.tasks.grasp_box.sections import GripperConfig

FloatArray = npt.NDArray[np.float64]

FINGERS = ("finger_1", "finger_2", "thumb")
# Which side of TCP x each is on; the two fingers share the thumb's force.
_SIDES, _SHARES = (-1.0, -1.0, 1.0), (0.5, 0.5, 1.0)
# A finger reaches its force limit at this deviation.
_SATURATION_M = 0.01
# Half of how thick the palm is.
_PALM_M = 0.015
# The rotor of its motor, seen through the gears.
_ROTOR_KG = 0.5


def add_gripper(
    spec: mujoco.MjSpec, body: Any, gripper: GripperConfig, touch: dict[str, list[float]]
) -> None:
    """Add palm, fingers and their position servos.

    Parameters
    ----------
    spec : mujoco.MjSpec
    body : mujoco.MjsBody
        In the frame of the tool centre point.
    gripper : GripperConfig
    touch : dict
        Contact parameters of the fingers.
    """
    back, tip = gripper.reach_m
    half = gripper.opening_m / 2
    radius = gripper.finger_radius_m
    rails = _rails(gripper)
    shape = {"mass": 0.0, "contype": ARM_BIT, "conaffinity": 0, **touch}
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[0.0, 0.0, -back - _PALM_M],
        size=[half + radius, gripper.spacing_m / 2 + radius, _PALM_M],
        **shape,
    )
    for name, side, share, (x, y) in zip(FINGERS, _SIDES, _SHARES, rails, strict=True):
        finger = body.add_body(name=name, gravcomp=1.0)
        joint = finger.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[-side, 0.0, 0.0],
            range=[-0.002, half + 0.01],
        )
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.armature, joint.frictionloss = _ROTOR_KG, share * gripper.drag_n
        finger.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[x, y, -back, x, y, tip - radius],
            size=[radius, 0.0, 0.0],
            **{**shape, "mass": gripper.finger_mass_kg},
        )
        force = share * gripper.force_n
        kp = force / _SATURATION_M
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=kp, kv=2.0 * np.sqrt(kp * (_ROTOR_KG + gripper.finger_mass_kg)))
        servo.forcelimited = True
        servo.forcerange = [-force, force]


def gripper_capsules(
    gripper: GripperConfig, between_m: float | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return capsules that have what `add_gripper` adds in them.

    Parameters
    ----------
    gripper : GripperConfig
    between_m : float, optional
        Between thumb and fingers; by default they are open.

    Returns
    -------
    ends : array, shape (C, 2, 3)
        Of their axes, in the frame of the tool centre point, metres.
    radii : array, shape (C,)
    """
    back, tip = gripper.reach_m
    radius = gripper.finger_radius_m
    side, wide = gripper.opening_m / 2 + radius, gripper.spacing_m / 2
    closed = 0.0 if between_m is None else (gripper.opening_m - between_m) / 2
    fingers = [
        [[x - np.sign(x) * closed, y, -back], [x - np.sign(x) * closed, y, tip - radius]]
        for x, y in _rails(gripper)
    ]
    # The palm: three bars across, as thick as it is.
    palm = [
        [[-side, y, -back - _PALM_M], [side, y, -back - _PALM_M]]
        for y in np.array([-1.0, 0.0, 1.0]) * (wide + radius - _PALM_M)
    ]
    ends = np.array([*fingers, *palm])
    return ends, np.repeat([radius, _PALM_M * np.sqrt(2.0)], [len(fingers), len(palm)])


def _rails(gripper: GripperConfig) -> list[tuple[float, float]]:
    """Return where fingers are across the tool while they are open, x and y, metres."""
    side, wide = gripper.opening_m / 2 + gripper.finger_radius_m, gripper.spacing_m / 2
    return [(-side, wide), (-side, -wide), (side, 0.0)]


def finger_controls(gripper: GripperConfig, since: FloatArray) -> FloatArray:
    """Compute the set-points of fingers that begin to close at a time.

    Parameters
    ----------
    gripper : GripperConfig
    since : array, shape (..., T)
        Seconds since they begin; negative before.

    Returns
    -------
    array, shape (..., T, 3)
        Metres from the open position. Past what they touch, up to the middle, they press.
    """
    closed = np.clip(gripper.speed_m_s * since, 0.0, gripper.opening_m / 2)
    return np.repeat(closed[..., None], len(FINGERS), axis=-1)
