"""The scene of `pull_lever`: arm, hook, a lever on its hinge."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

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
    for first, second in hook_rods(task):
        hook.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*first, *second],
            size=[task.hook.rod_radius_m, 0.0, 0.0],
            mass=0.0,
            contype=ARM_BIT,
            conaffinity=0,
            **touch,
        )


def hook_rods(task: PullLeverFields) -> list[tuple[list[float], list[float]]]:
    """Return the ends of the hook's rods in the frame of the tool centre point, metres."""
    rod = task.hook.rod_radius_m
    reach = task.lever.handle_radius_m + task.hook.clearance_m + rod
    corners = [
        [task.hook.tip_m, 0.0, -reach],
        [-reach, 0.0, -reach],
        [-reach, 0.0, reach],
        [task.hook.tip_m, 0.0, reach],
    ]
    return list(pairwise(corners))


def lever_rods(
    task: PullLeverFields, axes: FloatArray
) -> tuple[tuple[list[float], list[float]], tuple[list[float], list[float]]]:
    """Return the ends of the bar and of the handle in the lever's frame, metres.

    Parameters
    ----------
    task : PullLeverFields
    axes : array, shape (3, 3)
        Of the hinge, see `besman.simulation.tasks.pull_lever.hinge.Hinge`.
    """
    conf = task.lever
    left = np.cross([0.0, 0.0, 1.0], axes[:, 0]) @ axes[:, 2]
    sign = float(np.sign(left)) * (1.0 if conf.bar_side == "left" else -1.0)
    side = sign * conf.handle_length_m / 2
    bar = ([0.0, 0.0, side], [conf.length_m, 0.0, side])
    return bar, ([conf.length_m, 0.0, side], [conf.length_m, 0.0, -side])


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
    for (first, second), mass in zip(lever_rods(task, axes), (conf.mass_kg, 0.0), strict=True):
        lever.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*first, *second],
            size=[conf.handle_radius_m, 0.0, 0.0],
            mass=mass,
            contype=0,
            conaffinity=ARM_BIT,
            **touch,
        )
    lever.add_site(name="handle", pos=[conf.length_m, 0.0, 0.0])
