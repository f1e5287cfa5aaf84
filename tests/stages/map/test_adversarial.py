"""Demonstrations that no person gives: what becomes of them keeps every limit all the same."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from besman.geometry.frames import rotation_to_quaternion
from besman.records import HandTrajectory
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.stages.map.demonstration import MappingSettings, map_one

ROBOTS = {name: load_robot(name, "gripper") for name in ("ur5", "iiwa7", "compi")}
KINDS = ("line", "rush", "step", "spike", "constant", "noise", "outside", "turn", "flip")


def draw(robot, kind, seed, n_samples):
    """Poses asked of the tool, shape (T, 4, 4), starting at home."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, n_samples)[:, None]
    way = rng.normal(size=3)
    way = way / np.linalg.norm(way)
    shift, turn = np.zeros((n_samples, 3)), np.zeros((n_samples, 3))
    if kind == "line":
        shift = 0.3 * u * way
    elif kind == "rush":  # 10 m/s
        shift = 0.1 * np.arange(n_samples)[:, None] % 0.4 * way
    elif kind == "step":
        shift = np.where(u > rng.uniform(), 0.3, 0.0) * way
    elif kind == "spike":
        shift[rng.integers(n_samples)] = way
    elif kind == "noise":
        shift, turn = rng.normal(0, 0.02, shift.shape), rng.normal(0, 0.2, shift.shape)
    elif kind == "outside":
        shift = 10.0 * u * way
    elif kind == "turn":
        turn = 4 * np.pi * u * way
    elif kind == "flip":
        turn = np.where(u > 0.5, np.pi, 0.0) * way
    poses = np.tile(forward_kinematics(robot.chain, robot.home), (n_samples, 1, 1))
    poses[:, :3, 3] += shift
    poses[:, :3, :3] = Rotation.from_rotvec(turn).as_matrix() @ poses[:, :3, :3]
    return poses


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
@given(
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 1000),
    n_samples=st.integers(3, 60),
    free_spin=st.booleans(),
)
@example(kind="line", seed=0, n_samples=3, free_spin=False)
@example(kind="noise", seed=0, n_samples=500, free_spin=False)
@settings(max_examples=6, deadline=None)
def test_every_limit_is_kept_whatever_is_demonstrated(name, kind, seed, n_samples, free_spin):
    robot = ROBOTS[name]
    poses = draw(robot, kind, seed, n_samples)
    hand = np.hstack([poses[:, :3, 3], rotation_to_quaternion(poses[:, :3, :3])])
    one = HandTrajectory(np.arange(n_samples) / 100, hand, f"{kind}:{seed}", kind)
    trajectory, report = map_one(one, poses, robot, MappingSettings(free_spin=free_spin))
    assert report.violations == 0
    assert report.torque_ratio <= 1.0 + 1e-9
    assert trajectory.time_stretch >= 1.0
