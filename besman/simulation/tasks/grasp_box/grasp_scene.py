"""The scene of `grasp_box`: arm, gripper, a shelf's board, a box on it."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import mujoco
import numpy as np

from besman.robot.model import Robot
from besman.robot.mujoco_model import ARM_BIT, arm_spec
from besman.simulation.scenes import (
    add_tool_body,
    add_tool_capsule,
    add_tool_sensors,
    contact,
    set_contact_options,
)
from besman.simulation.tasks.grasp_box.gripper import FINGERS, add_gripper
from besman.simulation.tasks.grasp_box.sections import GraspBoxFields

_BOX_BIT = 4 * ARM_BIT
_FOOT_M = 0.004
# The feet stand on the board although the box is put so far to the front.
_STRAY_M = 0.03


@lru_cache(maxsize=64)
def grasp_model(
    robot: Robot, task: GraspBoxFields, place: tuple[float, float, float, float]
) -> mujoco.MjModel:
    """Build the scene: arm, gripper, shelf, box.

    Joints: the arm's, three fingers, the box's free joint. Sensors: position (3) and orientation
    (4, wxyz) of the tool centre point in the world, contacts of each finger with the box (3),
    contacts of arm and gripper with the shelf (1).

    Parameters
    ----------
    robot : Robot
    task : GraspBoxFields
    place : tuple of 4 float
        Middle of a box at its place, metres in the robot's world, and which way is ahead, rad.
    """
    spec, last = arm_spec(robot, task.simulation.time_step_s)
    set_contact_options(spec)
    time_s = task.simulation.contact_time_s
    touch = contact(time_s, task.gripper.friction)
    add_tool_capsule(last, robot, **touch)
    add_gripper(spec, add_tool_body(last, robot, "gripper"), task.gripper, touch)
    on_board = contact(time_s, task.shelf.friction)
    _add_shelf(spec, task, place, on_board)
    _add_box(spec, task, touch, on_board)
    add_tool_sensors(spec)
    for finger in FINGERS:
        add_touch(spec, finger, mujoco.mjtObj.mjOBJ_GEOM, finger, "box")
    add_touch(spec, "collision", mujoco.mjtObj.mjOBJ_XBODY, robot.joint_names[0], "shelf")
    return spec.compile()


def _add_shelf(
    spec: mujoco.MjSpec,
    task: GraspBoxFields,
    place: tuple[float, float, float, float],
    on_board: dict[str, list[float]],
) -> None:
    """Add a board below the box."""
    shelf, (depth, _, height) = task.shelf, task.box.size_m
    x, y, z, ahead = place
    out = shelf.depth_m / 2 - depth / 2 + shelf.overhang_m
    spec.worldbody.add_geom(
        name="shelf",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[
            x + out * np.cos(ahead),
            y + out * np.sin(ahead),
            z - height / 2 - shelf.thickness_m / 2,
        ],
        quat=[np.cos(ahead / 2), 0.0, 0.0, np.sin(ahead / 2)],
        size=[shelf.depth_m / 2, shelf.width_m / 2, shelf.thickness_m / 2],
        contype=0,
        conaffinity=ARM_BIT | _BOX_BIT,
        **on_board,
    )


def _add_box(
    spec: mujoco.MjSpec,
    task: GraspBoxFields,
    touch: dict[str, list[float]],
    on_board: dict[str, list[float]],
) -> None:
    """Add the box; it stands on small feet, which have one contact each."""
    box = spec.worldbody.add_body(name="box")
    box.add_freejoint()
    half = np.array(task.box.size_m) / 2
    box.add_geom(
        name="box",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=half,
        mass=task.box.mass_kg,
        contype=0,
        conaffinity=ARM_BIT,
        **touch,
    )
    # Those below stand on the board, some although the box reaches out over it; those above are for
    # when it falls.
    end = half[0] - _FOOT_M
    inner = max(end - task.shelf.overhang_m - _STRAY_M, 0.0)
    for x, y, z in product((-end, -inner, end), (-1.0, 1.0), (-1.0, 1.0)):
        if z > 0 and x == -inner:
            continue
        box.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            pos=[x, y * (half[1] - _FOOT_M), z * (half[2] - _FOOT_M)],
            size=[_FOOT_M, 0.0, 0.0],
            mass=0.0,
            contype=_BOX_BIT,
            conaffinity=0,
            **on_board,
        )


def add_touch(spec: mujoco.MjSpec, name: str, kind: mujoco.mjtObj, first: str, second: str) -> None:
    """Add a sensor that counts contacts between a geom or a subtree and a geom.

    Parameters
    ----------
    spec : mujoco.MjSpec
    name : str
        Of the sensor, before ``_touch``.
    kind : mujoco.mjtObj
        Of the first.
    first, second : str
        Names.
    """
    found = 1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND)
    sensor = spec.add_sensor(
        name=f"{name}_touch",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=kind,
        objname=first,
        reftype=mujoco.mjtObj.mjOBJ_GEOM,
        refname=second,
    )
    sensor.intprm[:3] = [found, 0, 1]
