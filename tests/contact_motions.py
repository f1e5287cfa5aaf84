"""Plans for the tasks with contacts: what a demonstration would have given."""

import numpy as np
import pytest

from besman.geometry.frames import quaternion_to_rotation, rotation_to_quaternion
from besman.geometry.quaternions import from_rotation_vector
from besman.motion.dmp_fit import fit_weights
from besman.records import MotionPlan
from besman.robot.inverse_kinematics import solve_path
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot


def plan_of_poses(robot, poses, duration, within_m=2e-3):
    """Follow poses (T, 4, 4) with least jerk."""
    x = np.linspace(0, 1, 101)
    blend = 10 * x**3 - 15 * x**4 + 6 * x**5
    path = solve_path(robot, poses)
    assert path.position_error.max() < within_m
    share = np.linspace(0, 1, len(poses))
    joints = np.stack([np.interp(blend, share, q) for q in path.positions.T], axis=1)
    reached = forward_kinematics(robot.chain, joints[[0, -1]])
    ends = np.column_stack([reached[:, :3, 3], rotation_to_quaternion(reached[:, :3, :3])])
    return MotionPlan(
        weights=fit_weights(x, joints, 20),
        start=joints[0],
        goal=joints[-1],
        duration=duration,
        joint_names=robot.joint_names,
        rmse=0.0,
        goal_pose=ends[1],
        start_pose=ends[0],
        target=np.full(3, np.nan),
        name="a",
        label="x",
    )


@pytest.fixture(scope="session")
def grasper():
    return load_robot("iiwa7", "gripper3")


# TCP z ahead (world x), TCP x to the left (world y), TCP y up.
AHEAD = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])


def approach_of(robot):
    """Come from 20 cm in front of a box to its middle."""
    poses = np.tile(np.eye(4), (21, 1, 1))
    poses[:, :3, :3] = AHEAD
    poses[:, :3, 3] = np.linspace([0.68, 0.1, 1.2], [0.88, 0.1, 1.2], 21)
    return plan_of_poses(robot, poses, 1.5)


@pytest.fixture(scope="session")
def approach(grasper):
    return approach_of(grasper)


def slanted_approach_of(robot):
    """Come to the same middle from the side, turned as a hand is."""
    poses = np.tile(np.eye(4), (21, 1, 1))
    turn = from_rotation_vector(np.array([0.1, -0.3, 0.2]))
    poses[:, :3, :3] = quaternion_to_rotation(turn) @ AHEAD
    poses[:, :3, 3] = np.linspace([0.72, -0.25, 1.25], [0.88, 0.1, 1.2], 21)
    return plan_of_poses(robot, poses, 1.5)


@pytest.fixture(scope="session")
def puller():
    return load_robot("ur10", "hook")


def pull_of(robot):
    """Pull a handle along an arc of 60 degrees with a radius of 28 cm, down and back."""
    angle = np.radians(np.linspace(10, -50, 31))
    poses = np.tile(np.eye(4), (31, 1, 1))
    # TCP x, where the hook is open, down.
    poses[:, :3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    poses[:, :3, 3] = np.array([0.4, 0.4, 1.1]) + 0.28 * np.column_stack(
        [np.cos(angle), np.zeros(31), np.sin(angle)]
    )
    return plan_of_poses(robot, poses, 1.5)


@pytest.fixture(scope="session")
def pull(puller):
    return pull_of(puller)


@pytest.fixture(scope="session")
def scooper():
    return load_robot("ur5", "scoop")


def tilted(angles_deg, places):
    """Poses of a scoop: tilted back by an angle; its handle ahead."""
    poses = np.tile(np.eye(4), (len(places), 1, 1))
    cos, sin = np.cos(np.radians(angles_deg)), np.sin(np.radians(angles_deg))
    poses[:, 0, 0], poses[:, 2, 0] = cos, sin
    poses[:, 0, 2], poses[:, 2, 2] = -sin, cos
    poses[:, :3, 3] = places
    return poses


@pytest.fixture(scope="session")
def scoop_throw(scooper):
    """Swing a scoop ahead and up, from tilted back to tilted ahead."""
    places = np.linspace([0.25, 0.15, 1.15], [0.65, 0.15, 1.45], 31)
    return plan_of_poses(scooper, tilted(np.linspace(30, -50, 31), places), 0.6, 0.05)


@pytest.fixture(scope="session")
def level_scoop(scooper):
    """Joint angles with which the scoop is level."""
    return solve_path(scooper, tilted(np.zeros(2), [[0.4, 0.15, 1.2]] * 2)).positions[0]
