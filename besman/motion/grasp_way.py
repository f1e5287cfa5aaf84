"""How a gripper comes to what it takes, and leaves it: straight ways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, Slerp

from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

_N_STEPS = 33


@dataclass(frozen=True, eq=False)
class GraspWay:
    """How a gripper has an object, and how it comes to it and leaves it.

    Attributes
    ----------
    grasp : array, shape (4, 4)
        Pose of the tool centre point in the frame of an object, metres.
    pitch_rad : float
        How far the tool is turned about the axis along which it closes, down.
    before_m, after_m : float
        From where on it comes straight ahead along its z axis, and how far it leaves along it.
    up_m : float
        How far it goes straight up after it has taken something, and down to put it.
    straight_s : float
        How long each straight way takes.
    higher_m : float
        How much higher the middle of every other way from place to place is than it was shown.
    posture : int
        0: the postures that follow from what was shown; 1 and more: others, see
        `besman.motion.grasp_postures.list_postures`.
    """

    grasp: FloatArray
    pitch_rad: float = 0.0
    before_m: float = 0.1
    after_m: float = 0.15
    up_m: float = 0.05
    straight_s: float = 1.0
    higher_m: float = 0.0
    posture: int = 0

    @property
    def tool(self) -> FloatArray:
        """Where the tool has the object, shape (4, 4)."""
        turned = np.array(self.grasp)
        # Down is where z is turned to; x may point to either side.
        side = np.sign(np.cross(turned[:3, 0], turned[:3, 2])[2])
        turn = Rotation.from_rotvec(side * self.pitch_rad * -turned[:3, 0]).as_matrix()
        turned[:3, :3] = turn @ turned[:3, :3]
        return turned

    def back(self, distance_m: float) -> FloatArray:
        """Return where the tool is so far behind that, shape (4, 4)."""
        moved = self.tool
        moved[:3, 3] -= distance_m * moved[:3, 2]
        return moved

    def ends(self, taking: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where the straight ways to an object, or its place, and on from there lead."""
        if taking:
            return self.back(self.before_m), self.tool, self.above
        return self.above, self.tool, self.back(self.after_m)

    @property
    def above(self) -> FloatArray:
        """Where the straight way up from an object ends, and that down to its place begins."""
        moved = self.tool
        moved[2, 3] += self.up_m
        return moved


def poses_between(here: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return poses on the straight way between two (4, 4), in small steps, shape (N, 4, 4)."""
    shares = np.linspace(0.0, 1.0, _N_STEPS)
    ends = np.stack([here[:3, :3], wanted[:3, :3]])
    poses = np.tile(np.eye(4), (_N_STEPS, 1, 1))
    poses[:, :3, :3] = Slerp([0.0, 1.0], Rotation.from_matrix(ends))(shares).as_matrix()
    poses[:, :3, 3] = here[:3, 3] + shares[:, np.newaxis] * (wanted[:3, 3] - here[:3, 3])
    return poses


def poses_from(robot: Robot, joints: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return poses on the straight way from where the tool is to where it is wanted."""
    return poses_between(forward_kinematics(robot.chain, joints[np.newaxis])[0], wanted)
