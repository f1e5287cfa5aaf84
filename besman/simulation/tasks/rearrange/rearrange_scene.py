"""The scene of `rearrange`: arm, gripper, boxes, a board below each of their places."""

from __future__ import annotations

from itertools import product

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
from besman.simulation.tasks.grasp_box.grasp_scene import add_touch
from besman.simulation.tasks.grasp_box.gripper import FINGERS, add_gripper
from besman.simulation.tasks.rearrange.boxes import board_pose
from besman.simulation.tasks.rearrange.sections import RearrangeFields

FloatArray = npt.NDArray[np.float64]

_FOOT_BIT, _BOX_BIT = 4 * ARM_BIT, 8 * ARM_BIT
_FOOT_M = 0.004


def rearrange_model(
    robot: Robot,
    task: RearrangeFields,
    before: FloatArray,
    after: FloatArray,
    between: FloatArray | None = None,
) -> mujoco.MjModel:
    """Build the scene.

    Joints: the arm's, three fingers, the free joint of every box. Sensors: position (3) and
    orientation (4, wxyz) of the tool centre point in the world; contacts of each finger with each
    box (3 O); contacts of arm and gripper with each board, before and after (2 O), and between (V).

    Parameters
    ----------
    robot : Robot
    task : RearrangeFields
    before, after : array, shape (O, 7)
        Poses of the boxes: position (m) and quaternion wxyz, upright.
    between : array, shape (V, 7), optional
        Where boxes are put to be taken again: a board each.
    """
    spec, last = arm_spec(robot, task.simulation.time_step_s)
    set_contact_options(spec)
    time_s = task.simulation.contact_time_s
    touch = contact(time_s, task.gripper.friction)
    add_tool_capsule(last, robot, **touch)
    add_gripper(spec, add_tool_body(last, robot, "gripper"), task.gripper, touch)
    on_board = contact(time_s, task.board.friction)
    boards = []
    for number, poses in enumerate(zip(before, after, strict=True)):
        for when, pose in zip(("before", "after"), poses, strict=True):
            boards.append(f"board_{number}_{when}")
            _add_board(spec, task, boards[-1], pose, on_board)
        _add_box(spec, task, f"box_{number}", touch, on_board)
    for number, pose in enumerate(() if between is None else between):
        boards.append(f"board_between_{number}")
        _add_board(spec, task, boards[-1], pose, on_board)
    add_tool_sensors(spec)
    geom, subtree = mujoco.mjtObj.mjOBJ_GEOM, mujoco.mjtObj.mjOBJ_XBODY
    for number, finger in product(range(len(before)), FINGERS):
        add_touch(spec, f"{finger}_{number}", geom, finger, f"box_{number}")
    for board in boards:
        add_touch(spec, board, subtree, robot.joint_names[0], board)
    return spec.compile()


def _add_board(
    spec: mujoco.MjSpec,
    task: RearrangeFields,
    name: str,
    pose: FloatArray,
    on_board: dict[str, list[float]],
) -> None:
    """Add the board that a box stands on."""
    board, placed = task.board, board_pose(pose, task)
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=placed[:3, 3],
        quat=matrix_to_quaternion(placed[:3, :3]),
        size=[board.depth_m / 2, board.width_m / 2, board.thickness_m / 2],
        contype=0,
        conaffinity=ARM_BIT | _FOOT_BIT,
        **on_board,
    )


def _add_box(
    spec: mujoco.MjSpec,
    task: RearrangeFields,
    name: str,
    touch: dict[str, list[float]],
    on_board: dict[str, list[float]],
) -> None:
    """Add a box on eight small feet, one a corner, which have one contact each."""
    box = spec.worldbody.add_body(name=name)
    box.add_freejoint()
    half = np.array(task.box.size_m) / 2
    box.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=half,
        mass=task.box.mass_kg,
        contype=_BOX_BIT,
        conaffinity=ARM_BIT | _BOX_BIT,
        **touch,
    )
    for corner in product((-1.0, 1.0), repeat=3):
        box.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            pos=np.array(corner) * (half - _FOOT_M),
            size=[_FOOT_M, 0.0, 0.0],
            mass=0.0,
            contype=_FOOT_BIT,
            conaffinity=0,
            **on_board,
        )
