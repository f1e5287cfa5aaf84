"""Random demonstrations of every kind, each made again from a seed and its number."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from besman.geometry.frames import quaternion_to_rotation, rotation_to_quaternion
from besman.records import HandTrajectory
from besman.robot.config import RobotConfig
from besman.robot.kinematics import forward_kinematics, manipulability
from besman.robot.model import Robot, load_robot
from besman.stages.map.demonstration import MappingSettings

# Those of which besman has the whole description.
ROBOTS = ("compi", "iiwa7", "rh5_left", "rh5_right", "ur10", "ur5")
KINDS = (
    "smooth",
    "step",
    "spike",
    "10 m/s",
    "outside",
    "singular",
    "repeated",
    "constant",
    "short",
    "walk",
    "noise",
    "turns",
    "half turn",
)
# Metres and radians of a unit of a shape.
_UNITS = np.repeat([0.25, 0.6], 3)
_SPEED = 10.0


@dataclass(frozen=True, eq=False)
class Draw:
    """One random demonstration.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    robot : Robot
        With one of its tools.
    time : array, shape (T,)
        Seconds.
    path : HandTrajectory or array, shape (T, n)
        What is asked of the hand, in the robot's world frame; or angles of the joints, rad.
    settings : MappingSettings
        How it is mapped.
    """

    kind: str
    robot: Robot
    time: np.ndarray
    path: HandTrajectory | np.ndarray
    settings: MappingSettings


def draw(seed: int, number: int, hand: bool, robots: tuple[str, ...] = ROBOTS) -> Draw:
    """Draw demonstration `number` of the hand, or a path of the joints.

    Arms and kinds take turns, so every range has them all.
    """
    rng = np.random.default_rng([seed, number])
    kind = KINDS[number // len(robots) % len(KINDS)]
    robot = _load(robots[number % len(robots)], int(rng.integers(100)))
    time = _times(rng, kind, 8 if hand else 5)
    settings = _settings(rng)
    if not hand:
        return Draw(kind, robot, time, _joint_path(rng, kind, robot, time), settings)
    frames = _hand_path(rng, kind, robot, time)
    poses = np.hstack([frames[:, :3, 3], rotation_to_quaternion(frames[:, :3, :3])])
    return Draw(kind, robot, time, HandTrajectory(time, poses, f"{seed}:{number}", kind), settings)


@cache
def _load_robot(name: str, tool: str) -> Robot:
    return load_robot(name, tool)


def _load(name: str, drawn: int) -> Robot:
    tools = _tools(name)
    return _load_robot(name, tools[drawn % len(tools)])


@cache
def _tools(name: str) -> tuple[str, ...]:
    config = RobotConfig.model_validate(load_robot(name).content["config"])
    return tuple(sorted(config.tools))


def _times(rng: np.random.Generator, kind: str, few: int) -> np.ndarray:
    """Draw the times of the samples: mostly few, mostly even, seconds from 0."""
    if kind == "short":
        count = int(rng.integers(1, 4))
    else:
        count = int(rng.integers(few, 60) if rng.random() < 0.05 else rng.integers(3, few + 1))
    rate = rng.choice([30.0, 100.0, 100.0, 100.0, 500.0])
    steps = np.full(count - 1, 1.0 / rate)
    if rng.random() < 0.1:
        steps *= rng.uniform(0.2, 3.0, count - 1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _settings(rng: np.random.Generator) -> MappingSettings:
    """Draw how it is mapped: one in four with a change of the path, which takes longest."""
    return MappingSettings(
        free_spin=bool(rng.random() < 0.25),
        knot_spacing_s=float(rng.choice([0.02, 0.05, 0.05, 0.2])),
        least_duration_s=0.5 * bool(rng.random() < 0.1),
        greatest_change_m=float(rng.choice([0.0, 0.0, 0.0, 0.005])),
    )


def _shape(rng: np.random.Generator, kind: str, time: np.ndarray, width: int) -> np.ndarray:
    """Draw a path (T, width) of a kind, in units of about 1."""
    count = len(time)
    u = np.linspace(0, 1, count)[:, None]
    way = rng.normal(size=width)
    way /= np.linalg.norm(way)
    if kind == "constant":
        return np.zeros((count, width))
    if kind == "step":
        return np.where(u > rng.uniform(), rng.uniform(0.1, 2.0), 0.0) * way
    if kind == "spike":
        path = 0.3 * u * way
        path[rng.integers(count)] += 10 ** rng.uniform(-1.0, 1.0) * rng.normal(size=width)
        return path
    if kind == "outside":
        return 10 ** rng.uniform(0.3, 1.5) * u * way
    if kind == "walk":
        return np.cumsum(rng.normal(0, rng.uniform(0.01, 0.3), (count, width)), axis=0)
    if kind == "noise":
        return rng.normal(0, rng.uniform(1e-4, 0.3), (count, width))
    path = _minimum_jerk(rng, u[:, 0], width)
    if kind == "repeated":
        # Every pose is held for some samples, as where a camera's frames are doubled.
        return path[np.arange(count) // int(rng.integers(2, 5))]
    return path


def _minimum_jerk(rng: np.random.Generator, u: np.ndarray, width: int) -> np.ndarray:
    """Draw a path through random points, each reached and left as a person would."""
    points = rng.normal(0, 0.5, (int(rng.integers(2, 5)), width))
    points[0] = 0.0
    at = u * (len(points) - 1)
    piece = np.minimum(at.astype(int), len(points) - 2)
    x = (at - piece)[:, None]
    return points[piece] + (points[piece + 1] - points[piece]) * x**3 * (10 - 15 * x + 6 * x**2)


def _to_and_fro(rng: np.random.Generator, time: np.ndarray, width: int, reach: float) -> np.ndarray:
    """Move to and fro at 10 units a second, within a reach."""
    way = rng.normal(size=width)
    made = _SPEED * time[:, None] + rng.uniform(0, reach)
    return (reach - np.abs(made % (2 * reach) - reach)) * way / np.linalg.norm(way)


def _hand_path(rng: np.random.Generator, kind: str, robot: Robot, time: np.ndarray) -> np.ndarray:
    """Draw poses of the hand (T, 4, 4) in the robot's world, such that the tool starts in reach."""
    start = _start(rng, robot)
    if kind == "singular":
        tips = forward_kinematics(robot.chain, _through_singular(rng, robot, time))
        return tips @ np.linalg.inv(robot.tool.tcp2hand)
    path = _UNITS * _shape(rng, kind, time, 6)
    if kind == "10 m/s":
        path[:, :3] = _to_and_fro(rng, time, 3, 0.4)
    if kind == "turns":
        path[:, 3:] *= rng.uniform(1.0, 20.0)
    if kind == "half turn":
        way = rng.normal(size=3)
        exact = np.eye(3)[rng.integers(3)] if rng.random() < 0.5 else way / np.linalg.norm(way)
        path[:, 3:] = np.where(time[:, None] > time[-1] * rng.uniform(), np.pi, 0.0) * exact
    tips = np.tile(forward_kinematics(robot.chain, start), (len(time), 1, 1))
    tips[:, :3, 3] += path[:, :3]
    tips[:, :3, :3] = Rotation.from_rotvec(path[:, 3:]).as_matrix() @ tips[:, :3, :3]
    # As recordings have them: quaternions are only so exact.
    tips[:, :3, :3] = quaternion_to_rotation(rotation_to_quaternion(tips[:, :3, :3]))
    return tips @ np.linalg.inv(robot.tool.tcp2hand)


def _joint_path(rng: np.random.Generator, kind: str, robot: Robot, time: np.ndarray) -> np.ndarray:
    """Draw a path (T, n) of the joints, from hardly any movement to many radians."""
    if kind == "singular":
        start, path = np.zeros(robot.n), _through_singular(rng, robot, time)
    else:
        start = _start(rng, robot)
        path = 10 ** rng.uniform(-3.0, -0.3) * _shape(rng, kind, time, robot.n)
    if kind == "10 m/s":
        path = _to_and_fro(rng, time, robot.n, 0.5)
    if kind == "half turn":
        turn = np.pi * 10 ** rng.uniform(-2.0, 0.0)
        path[:, rng.integers(robot.n)] += np.where(time > time[-1] * rng.uniform(), turn, 0.0)
    low, high = robot.limits.position_min, robot.limits.position_max
    # Inverse kinematics gives none beyond. One in 32 to the very limits: there the path must be
    # changed, which takes ten times as long.
    edge = 0.15 * (high - low) * bool(rng.integers(32))
    return np.clip(start + path, low + edge, high - edge)


def _start(rng: np.random.Generator, robot: Robot) -> np.ndarray:
    """Draw joint angles: near home, or anywhere in the box, or at its very edge."""
    low, high = robot.limits.position_min, robot.limits.position_max
    if rng.random() < 0.8:
        return np.clip(robot.home + rng.uniform(-0.5, 0.5, robot.n), low, high)
    anywhere = rng.uniform(low, high)
    return np.where(rng.random(robot.n) < 0.1, high, anywhere)


def _through_singular(rng: np.random.Generator, robot: Robot, time: np.ndarray) -> np.ndarray:
    """Draw a straight path (T, n) of the joints through a singular configuration."""
    places = _singular(robot)
    way = rng.normal(size=robot.n)
    way *= rng.uniform(0.05, 1.0) / np.linalg.norm(way)
    u = np.linspace(-rng.uniform(0, 1), rng.uniform(0, 1), len(time))[:, None]
    path = places[rng.integers(len(places))] + u * way
    return np.clip(path, robot.limits.position_min, robot.limits.position_max)


@cache
def _singular(robot: Robot, count: int = 8) -> np.ndarray:
    """Find configurations near home at which some joints can be traded against each other."""
    rng = np.random.default_rng(0)
    low, high = robot.limits.position_min, robot.limits.position_max
    found = np.clip(robot.home + rng.uniform(-0.7, 0.7, (count, robot.n)), low, high)
    for place in found:
        for _ in range(2):
            for joint in range(robot.n):
                tried = np.tile(place, (41, 1))
                tried[1:, joint] = np.linspace(0.8 * low[joint], 0.8 * high[joint], 40)
                place[joint] = tried[np.argmin(manipulability(robot.chain, tried)), joint]
    return found
