"""Where boxes are, told from their markers and from where a gripper takes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from besman.geometry.frames import rotation_to_quaternion
from besman.motion.adapt_task import frame_matrix
from besman.motion.task_rollout import sample_task
from besman.records import TaskPlan
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.simulation.tasks.rearrange.sections import RearrangeFields

FloatArray = npt.NDArray[np.float64]


class BoxFrame(NamedTuple):
    """Where a box is in the frame of its markers.

    Attributes
    ----------
    centre_m : array, shape (3,)
    turn_rad : float
        Of its depth about the vertical, to the left; ahead of the gripper that takes it.
    thumb : float
        Which way the x axis of the tool centre point is: 1 to the left of the box, -1 to its right.
    """

    centre_m: FloatArray
    turn_rad: float
    thumb: float = 1.0

    @property
    def matrix(self) -> FloatArray:
        """The box in the frame of its markers, shape (4, 4)."""
        cos, sin = np.cos(self.turn_rad), np.sin(self.turn_rad)
        box = np.eye(4)
        box[:2, :2] = [[cos, -sin], [sin, cos]]
        box[:3, 3] = self.centre_m
        return box

    @property
    def grasp(self) -> FloatArray:
        """The level gripper that has the box in its middle, in the frame of the markers."""
        tool = np.eye(4)
        x, z = np.array([0.0, self.thumb, 0.0]), np.array([1.0, 0.0, 0.0])
        tool[:3, :3] = np.column_stack([x, np.cross(z, x), z])
        return np.asarray(self.matrix @ tool)


def frame_of_grasps(plans: Sequence[TaskPlan], robot: Robot) -> BoxFrame | None:
    """Tell where boxes are in the frames of their markers from where they are taken.

    What a marker set does not say: a box is taken in its middle, its width between the fingers. The
    median over all tasks: a single grasp that is beside it stays so.

    Parameters
    ----------
    plans : sequence of TaskPlan
    robot : Robot
        With the gripper: it closes along the x axis of its tool centre point.

    Returns
    -------
    BoxFrame
        None if nothing is ever taken.
    """
    insides = []
    for plan in plans:
        _, positions, _, _ = sample_task(plan)
        for at, thing in taken(plan):
            row = min(round(at * 1000.0), len(positions) - 1)
            tool = forward_kinematics(robot.chain, positions[row : row + 1])[0]
            insides.append(np.linalg.inv(frame_matrix(plan.object_poses[thing])) @ tool)
    return frame_of_tools(insides)


def frame_of_tools(insides: Sequence[FloatArray]) -> BoxFrame | None:
    """Tell where boxes are from poses of the tool as it takes them, in their markers' frames.

    Parameters
    ----------
    insides : sequence of array, shape (4, 4)

    Returns
    -------
    BoxFrame
        See `frame_of_grasps`; None if there is no pose.
    """
    centres: list[FloatArray] = []
    turns: list[float] = []
    sides: list[float] = []
    for inside in insides:
        centres.append(inside[:3, 3])
        # Across the fingers, on the side away from the gripper.
        across = np.array([-inside[1, 0], inside[0, 0]])
        side = float(np.sign(across @ inside[:2, 2])) or 1.0
        turns.append(float(np.arctan2(*(side * across)[::-1])))
        sides.append(-side)
    if not centres:
        return None
    mean = np.arctan2(np.sin(turns).mean(), np.cos(turns).mean())
    off = (np.array(turns) - mean + np.pi) % (2 * np.pi) - np.pi
    thumb = 1.0 if np.sum(sides) >= 0 else -1.0
    return BoxFrame(np.median(centres, axis=0), float(mean + np.median(off)), thumb)


def taken(plan: TaskPlan) -> list[tuple[float, int]]:
    """Return when the gripper closes, and on which object: the one that its block leads to."""
    found = []
    ends = plan.starts_s[1:]
    for at, event in zip(plan.events_s, plan.events, strict=True):
        if event == "close":
            here = int(np.searchsorted(ends, at))
            around = [plan.blocks[k].thing for k in range(len(plan.blocks)) if k <= here + 1]
            things = [thing for thing in around if thing]
            found.append((float(at), plan.objects.index(things[-1]) if things else 0))
    return found


def box_poses(poses: FloatArray, frame: BoxFrame) -> FloatArray:
    """Return poses of boxes from those of their markers, both of shape (O, 7)."""
    placed = np.array([frame_matrix(pose) @ frame.matrix for pose in poses]).reshape(-1, 4, 4)
    return np.hstack([placed[:, :3, 3], rotation_to_quaternion(placed[:, :3, :3])])


def board_pose(pose: FloatArray, task: RearrangeFields) -> FloatArray:
    """Return where the middle of the board below a box (7,) is, shape (4, 4).

    Its front edge is where the gripper comes from.
    """
    board, ahead = task.board, 2.0 * np.arctan2(pose[6], pose[3])
    placed = frame_matrix([*pose[:3], np.cos(ahead / 2), 0.0, 0.0, np.sin(ahead / 2)])
    placed[:3, 3] += (board.depth_m / 2 - board.front_m) * placed[:3, 0]
    placed[2, 3] -= task.box.size_m[2] / 2 + board.thickness_m / 2
    return placed
