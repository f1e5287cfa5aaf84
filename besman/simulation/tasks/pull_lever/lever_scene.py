"""The scene of `pull_lever`: arm, hook, a lever on its hinge, and where that is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from besman.exceptions import RefinementError
from besman.robot.model import Robot
from besman.robot.mujoco_model import ARM_BIT, arm_spec, matrix_to_quaternion
from besman.simulation.scenes import (
    add_tool_body,
    add_tool_capsule,
    add_tool_sensors,
    contact,
    set_contact_options,
)
from besman.simulation.tasks.pull_lever.sections import PullLeverFields

FloatArray = npt.NDArray[np.float64]

# A chord that is steeper than this does not tell which way is ahead.
_LEAST_LEVEL_M = 0.02
# Nor is a level pull's arc ahead of it; it is above.
_LEAST_BULGE = 1e-3


@dataclass(frozen=True, eq=False)
class Hinge:
    """Where a lever is hinged.

    Attributes
    ----------
    centre : array, shape (3,)
        Where the hinge's axis meets the plane in which the handle's middle moves, metres.
    axes : array, shape (3, 3)
        Columns: to the handle before the pull, where it goes first, the axis of the hinge.
    """

    centre: FloatArray
    axes: FloatArray

    @property
    def key(self) -> tuple[float, ...]:
        """The same as plain numbers."""
        return tuple(np.concatenate([self.centre, self.axes.ravel()]).tolist())

    def handle(self, angle: float, length: float) -> FloatArray:
        """Return where the handle's middle is at an angle (rad) of a lever (m), shape (3,)."""
        turned = self.axes @ np.array([np.cos(angle), np.sin(angle), 0.0])
        return np.asarray(self.centre + length * turned)

    def angle(self, handle: FloatArray) -> float:
        """Return the angle (rad) at which the handle's middle is at a place (3,)."""
        x, y, _ = self.axes.T @ (handle - self.centre)
        return float(np.arctan2(y, x))


def find_hinge(
    start: FloatArray, end: FloatArray, length: float, offset: npt.ArrayLike, name: str = "lever"
) -> Hinge:
    """Find the hinge of a lever whose handle goes from one place to another.

    Of the two circles through both places in their vertical plane it is the one that bulges
    ahead, or up where the pull is level: a person pulls down and towards the body.

    Parameters
    ----------
    start, end : array, shape (7,)
        Poses of the tool in the robot's world; the handle is at their positions, metres.
    length : float
        Of the lever, metres.
    offset : array, shape (3,)
        Moves the whole lever, metres.
    name : str
        Of the motion, for the message.

    Raises
    ------
    RefinementError
        If the places are too close to each other, or too far apart for the lever.
    """
    way = end[:3] - start[:3]
    chord = float(np.linalg.norm(way))
    if not 0.01 <= chord <= 1.98 * length:
        raise RefinementError(
            f"{name}: task pull_lever: the demonstrated movement ends {100 * chord:.1f} cm from "
            f"its start; expected 1 cm to {198 * length:.1f} cm for lever.length_m {length:g}"
        )
    ahead = -way * [1.0, 1.0, 0.0]
    if np.linalg.norm(ahead) < _LEAST_LEVEL_M:
        w, x, y, z = start[3:]
        ahead = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 0.0])
    if np.linalg.norm(ahead) < _LEAST_BULGE:
        ahead = np.array([1.0, 0.0, 0.0])
    along = way / chord
    ahead /= np.linalg.norm(ahead)
    bulge = ahead - (ahead @ along) * along
    if np.linalg.norm(bulge) < _LEAST_BULGE:
        bulge = np.array([0.0, 0.0, 1.0]) - along[2] * along
    bulge /= np.linalg.norm(bulge)
    centre = start[:3] + way / 2 - np.sqrt(length**2 - chord**2 / 4) * bulge
    first = (start[:3] - centre) / length
    axis = np.cross(first, end[:3] - centre)
    axis /= np.linalg.norm(axis)
    return Hinge(centre + np.asarray(offset), np.column_stack([first, np.cross(axis, first), axis]))


@lru_cache(maxsize=64)
def lever_model(robot: Robot, task: PullLeverFields, hinge: tuple[float, ...]) -> mujoco.MjModel:
    """Build the scene: arm, hook, lever.

    The lever's joint is the last one, 0 before the pull. Sensors: position (3) and orientation
    (4, wxyz) of the tool centre point, position of the handle's middle (3), in the world.

    Parameters
    ----------
    robot : Robot
    task : PullLeverFields
    hinge : tuple of 12 float
        `Hinge.key`.
    """
    spec, last = arm_spec(robot, task.simulation.time_step_s)
    set_contact_options(spec)
    touch = contact(task.simulation.contact_time_s, task.hook.friction)
    add_tool_capsule(last, robot, **touch)
    _add_hook(add_tool_body(last, robot, "hook"), task, touch)
    _add_lever(spec, task, np.array(hinge[:3]), np.reshape(hinge[3:], (3, 3)), touch)
    add_tool_sensors(spec)
    spec.add_sensor(
        name="handle",
        type=mujoco.mjtSensor.mjSENS_FRAMEPOS,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname="handle",
    )
    return spec.compile()


def _add_hook(hook: Any, task: PullLeverFields, touch: dict[str, list[float]]) -> None:
    """Add three rods in the plane of TCP x and z."""
    rod = task.hook.rod_radius_m
    reach = task.lever.handle_radius_m + task.hook.clearance_m + rod
    corners = [
        [task.hook.tip_m, 0.0, -reach],
        [-reach, 0.0, -reach],
        [-reach, 0.0, reach],
        [task.hook.tip_m, 0.0, reach],
    ]
    for first, second in pairwise(corners):
        hook.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*first, *second],
            size=[rod, 0.0, 0.0],
            mass=0.0,
            contype=ARM_BIT,
            conaffinity=0,
            **touch,
        )


def _add_lever(
    spec: mujoco.MjSpec,
    task: PullLeverFields,
    centre: FloatArray,
    axes: FloatArray,
    touch: dict[str, list[float]],
) -> None:
    """Add a bar on a hinge, beside the plane in which the handle's middle moves."""
    lever, conf = spec.worldbody.add_body(name="lever"), task.lever
    lever.pos, lever.quat = centre, matrix_to_quaternion(axes)
    joint = lever.add_joint(
        name="lever",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[0.0, 0.0, 1.0],
        range=[0.0, np.radians(conf.stop_deg)],
    )
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    joint.frictionloss, joint.damping = conf.friction_nm, [conf.damping_nms, 0.0, 0.0]
    left = np.cross([0.0, 0.0, 1.0], axes[:, 0]) @ axes[:, 2]
    sign = np.sign(left) * (1.0 if conf.bar_side == "left" else -1.0)
    side, radius = sign * conf.handle_length_m / 2, conf.handle_radius_m
    rods = [
        ([0.0, 0.0, side], [conf.length_m, 0.0, side], conf.mass_kg),
        ([conf.length_m, 0.0, side], [conf.length_m, 0.0, -side], 0.0),
    ]
    for first, second, mass in rods:
        lever.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*first, *second],
            size=[radius, 0.0, 0.0],
            mass=mass,
            contype=0,
            conaffinity=ARM_BIT,
            **touch,
        )
    lever.add_site(name="handle", pos=[conf.length_m, 0.0, 0.0])
