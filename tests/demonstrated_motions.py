import numpy as np
import pytest

from besman.geometry.frames import rotation_to_quaternion
from besman.records import JointTrajectory
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import load_robot
from besman.stages.imitate.methods import ImitateMethod
from besman.stages.imitate.stage import CartesianDmpConfig, ImitateConfig, VelocityDmpConfig

CONFIGS: dict[str, ImitateMethod] = {
    "joint_dmp": ImitateConfig(),
    "joint_dmp_velocity": VelocityDmpConfig(method="joint_dmp_velocity"),
    "cartesian_dmp": CartesianDmpConfig(method="cartesian_dmp"),
}


def about_home(robot, seed=0):
    """Move about home, with a velocity at both ends."""
    random = np.random.default_rng(seed)
    time = np.linspace(0, 0.8, 81)
    x = time[:, None] / 0.8
    blend = 10 * x**3 - 15 * x**4 + 6 * x**5
    rate = (30 * x**2 - 60 * x**3 + 30 * x**4) / 0.8
    way, wave = random.uniform(-0.5, 0.5, robot.n), random.uniform(-0.1, 0.1, robot.n)
    drift = 0.3 * way
    positions = robot.home + blend * way + drift * x + wave * np.sin(np.pi * x) ** 4
    velocities = (
        rate * way
        + drift / 0.8
        + wave * 4 * np.pi / 0.8 * np.sin(np.pi * x) ** 3 * np.cos(np.pi * x)
    )
    poses = forward_kinematics(robot.chain, positions)
    return JointTrajectory(
        time=time,
        positions=positions,
        velocities=velocities,
        accelerations=np.zeros_like(positions),
        joint_names=robot.joint_names,
        poses=np.column_stack([poses[:, :3, 3], rotation_to_quaternion(poses[:, :3, :3])]),
        position_error=np.zeros(81),
        orientation_error=np.zeros(81),
        time_stretch=1.0,
        target=np.array([2.0, 0, 0]),
        name="a",
        label="throw",
    )


@pytest.fixture(scope="session")
def robots():
    return {name: load_robot(name) for name in ("ur5", "iiwa7", "compi")}


@pytest.fixture(scope="session")
def demonstrate():
    """Make a demonstration: (robot, seed) -> JointTrajectory."""
    return about_home


@pytest.fixture(scope="session")
def configs():
    """Give one config per kind of motion plan."""
    return CONFIGS


@pytest.fixture(scope="session")
def plan_of(robots):
    """Imitate one demonstration: (kind, robot's name, seed) -> plan."""

    def make(kind, robot="ur5", seed=0):
        demonstration = about_home(robots[robot], seed)
        return CONFIGS[kind].run((demonstration,), robots[robot])[0]

    return make
