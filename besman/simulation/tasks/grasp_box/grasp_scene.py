"""The scene of `grasp_box`: arm, gripper, a shelf's board, a box on it."""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Annotated

import mujoco
import numpy as np
from pydantic import Field

from besman.config.stage import Config, NotNegative, Positive
from besman.robot.model import Robot
from besman.robot.mujoco_model import ARM_BIT, arm_spec
from besman.simulation.scenes import (
    add_tool_body,
    add_tool_capsule,
    add_tool_sensors,
    contact,
    set_contact_options,
)
from besman.simulation.task import Triple
from besman.simulation.tasks.grasp_box.gripper import FINGERS, add_gripper

if TYPE_CHECKING:
    from besman.simulation.tasks.grasp_box.grasp_box import GraspBoxConfig

_BOX_BIT = 4 * ARM_BIT
_FOOT_M = 0.004
# The feet stand on the board although the box is put so far to the front.
_STRAY_M = 0.03


class BoxConfig(Config):
    """The box and where it stands.

    Attributes
    ----------
    size_m : triple of float
        Depth (ahead), width, height.
    mass_kg : float
        Spread evenly.
    place_m : triple of float or None
        Its middle in the robot's world, metres; null: where the demonstrated approach ends.
    shift_m : pair of float
        Where it is put on the shelf off that place: ahead and to the left, metres.
    turn_deg : float
        How far it is turned there about the vertical, to the left.
    spread_m : float
        Every motion plan is tried with the box there and this far ahead, behind, to the left and to
        the right of it, and must succeed everywhere; 0: there alone.
    """

    size_m: tuple[Positive, Positive, Positive] = (0.08, 0.10, 0.18)
    mass_kg: Positive = 0.4
    place_m: Triple | None = None
    shift_m: tuple[float, float] = (0.0, 0.0)
    turn_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    spread_m: Annotated[float, Field(ge=0, le=0.1)] = 0.025


class ShelfConfig(Config):
    """The board that the box stands on.

    Attributes
    ----------
    depth_m, width_m, thickness_m : float
        Of the board.
    overhang_m : float
        How far a box at its place reaches out over the board's front edge.
    friction : float
        Coefficient of sliding friction between box and board.
    """

    depth_m: Positive = 0.3
    width_m: Positive = 0.5
    thickness_m: Positive = 0.02
    overhang_m: NotNegative = 0.0
    friction: NotNegative = 0.4


@lru_cache(maxsize=64)
def grasp_model(
    robot: Robot, task: GraspBoxConfig, place: tuple[float, float, float, float]
) -> mujoco.MjModel:
    """Build the scene: arm, gripper, shelf, box.

    Joints: the arm's, three fingers, the box's free joint. Sensors: position (3) and orientation
    (4, wxyz) of the tool centre point in the world, contacts of each finger with the box (3),
    contacts of arm and gripper with the shelf (1).

    Parameters
    ----------
    robot : Robot
    task : GraspBoxConfig
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
        _add_touch(spec, finger, mujoco.mjtObj.mjOBJ_GEOM, finger, "box")
    _add_touch(spec, "collision", mujoco.mjtObj.mjOBJ_XBODY, robot.joint_names[0], "shelf")
    return spec.compile()


def _add_shelf(
    spec: mujoco.MjSpec,
    task: GraspBoxConfig,
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
    task: GraspBoxConfig,
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


def _add_touch(
    spec: mujoco.MjSpec, name: str, kind: mujoco.mjtObj, first: str, second: str
) -> None:
    """Add a sensor that counts contacts between a geom or a subtree and a geom."""
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
