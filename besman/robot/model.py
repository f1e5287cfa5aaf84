"""A robot arm as all parts use it: Pinocchio model, limits, arrays for batched kinematics."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from besman.config.resources import resource_folder
from besman.config.yaml_file import load_config
from besman.exceptions import RobotError, nearest
from besman.foreign.names import fault_of_characters
from besman.foreign.paths import is_file
from besman.geometry.frames import quaternion_to_rotation
from besman.records.files import digest
from besman.robot.config import JointConfig, RobotConfig
from besman.robot.drives import Drives, drives_of
from besman.robot.parts import Chain, FloatArray, JointLimits, Tool, read_only
from besman.robot.tool_shelf import tools_of
from besman.robot.urdf_file import read_urdf

_PACKAGE = "example-robot-data"


@dataclass(frozen=True, eq=False)
class Robot:
    """One arm with one tool.

    Attributes
    ----------
    name : str
    joint_names : tuple of str, length n
        From base to tip.
    model : pinocchio.Model
        Fixed base; its world is the floor below the base, z up; the tool's mass is in the last
        body; frame ``tcp`` is the tool centre point. Make your own data: ``model.createData()``.
    tip_frame : int
        Index of frame ``tcp`` in `model`.
    limits : JointLimits
    home : array, shape (n,)
        Home configuration, rad.
    chain : Chain
    tool : Tool
    base_height : float
        Height of the base above the floor, metres.
    drives : Drives
        What its servos and joints do that ideal ones would not.
    content : dict
        Everything that the robot is made from, as plain JSON values, for the cache's key.
    source : str
        The name or the path of the robot.yaml that it was loaded by.

    In another process a robot is loaded again, once, and must then be the same.
    """

    name: str
    joint_names: tuple[str, ...]
    model: Any
    tip_frame: int
    limits: JointLimits
    home: FloatArray
    chain: Chain
    tool: Tool
    base_height: float
    drives: Drives
    content: dict[str, Any]
    source: str

    def __reduce__(self) -> tuple[Any, ...]:
        return _load_again, (self.source, self.tool.name, _digest(self))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_names)


def list_robots() -> list[str]:
    """Return the names of the robots that are there, sorted."""
    return sorted(path.parent.name for path in resource_folder("robots").glob("*/robot.yaml"))


def find_robot(name_or_path: str | Path) -> Path:
    """Return the path of a robot.yaml.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a robot that is there, or a path to a robot.yaml.

    Raises
    ------
    RobotError
        If there is no such robot.
    """
    path = Path(name_or_path)
    if path.suffix in {".yaml", ".yml"} and is_file(path):
        return path
    found = resource_folder("robots") / str(name_or_path) / "robot.yaml"
    if len(path.parts) == 1 and is_file(found):
        return found
    raise RobotError(
        f"no robot {str(name_or_path)!r:.200}; {nearest(str(name_or_path), list_robots())}"
    )


def load_robot(name_or_path: str | Path, tool: str | None = None) -> Robot:
    """Load a robot with one of its tools.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a robot that is there, or a path to a robot.yaml.
    tool : str, optional
        One of the robot's tools; without it the robot's default tool.

    Returns
    -------
    Robot
        Arrays are read-only.

    Raises
    ------
    RobotError
        If robot, tool, URDF, joint or link is not there, or a limit is not above zero.
    ConfigError
        If the robot.yaml is not valid.
    """
    path = find_robot(name_or_path)
    config = find_tool(path, tool)
    _check_name(config.name, path)
    tool_name = config.default_tool if tool is None else tool
    for joint in config.joints:
        _check_limits(joint, path)
    own = path.parent == resource_folder("robots") / config.name
    source = config.name if own else str(path.resolve())
    tree, urdf = read_robot_urdf(config, path)
    return build_robot(config, tool_name, tree, urdf, path, source)


def find_tool(name_or_path: str | Path, tool: str | None = None) -> RobotConfig:
    """Return the config of a robot that has a tool; nothing more is looked at.

    Parameters
    ----------
    name_or_path, tool
        As of `load_robot`.

    Raises
    ------
    RobotError, ConfigError
        If robot or tool is not there, or the robot.yaml is not valid.
    """
    path = find_robot(name_or_path)
    config = load_config(path, RobotConfig)
    name, tools = config.default_tool if tool is None else tool, tools_of(config)
    if name not in tools:
        raise RobotError(f"{path}: no tool {name!r}; {nearest(name, tools)}")
    return config


@lru_cache(maxsize=8)
def _load_again(source: str, tool: str, expected: str) -> Robot:
    """Load a robot that another process has sent."""
    robot = load_robot(source, tool)
    if _digest(robot) != expected:
        raise RobotError(
            f"{source}: robot {robot.name} (tool {tool}) is not what it is in the process that "
            "sent it: expected the same files in both, and nothing changed after loading"
        )
    return robot


def _digest(robot: Robot) -> str:
    """Return the digest of what the robot is made from and of what may be changed after that."""
    return digest((robot.content, robot.limits, robot.home, robot.base_height, robot.drives))


def _check_name(name: str, path: Path) -> None:
    """Refuse two robots with one name: runs and exports tell robots apart by it."""
    own = resource_folder("robots") / name / "robot.yaml"
    if path.resolve() == own.resolve():
        return
    if own.is_file():
        raise RobotError(f"{path}: name: {name!r} is the robot {own}; expected another name")
    if path.resolve().is_relative_to(resource_folder("robots").resolve()):
        raise RobotError(f"{path}: name: got {name!r}, expected the folder's, {path.parent.name!r}")


def _check_limits(joint: JointConfig, path: Path) -> None:
    """Refuse limits that no movement could keep."""
    lower, upper = joint.position_deg
    if not lower < upper:
        raise RobotError(
            f"{path}: joint {joint.name}: position_deg: got {[lower, upper]}, "
            "expected the lower limit below the upper one"
        )
    for name in ("velocity_deg_s", "acceleration_rad_s2", "torque_nm"):
        value = getattr(joint, name)
        if not value > 0:
            raise RobotError(
                f"{path}: joint {joint.name}: {name}: got {value:g}, expected more than 0"
            )
    if not lower <= joint.home_deg <= upper:
        raise RobotError(
            f"{path}: joint {joint.name}: home_deg: got {joint.home_deg:g}, "
            f"expected it within position_deg {[lower, upper]}"
        )


def find_urdf(source: str, path: Path) -> tuple[Path, Path]:
    """Return the URDF and the folder that its ``package://`` addresses start from.

    Parameters
    ----------
    source : str
        What the robot.yaml says under ``urdf``.
    path : Path
        The robot.yaml.

    Raises
    ------
    RobotError
        If there is no such file.
    """
    prefix, colon, inside = source.partition(":")
    if fault_of_characters(source) is not None:
        raise RobotError(f"{path}: urdf: {source!r:.200} is no path")
    if not colon:
        urdf = path.parent / source
        beside = urdf.resolve().is_relative_to(path.resolve().parent)
        folder = path.parent if beside else urdf.parent
    elif prefix == _PACKAGE:
        folder = _share_folder()
        urdf = folder / _PACKAGE / "robots" / inside
    else:
        raise RobotError(
            f"{path}: urdf: got {source!r}, expected a relative path or '{_PACKAGE}:PATH'"
        )
    if not is_file(urdf):
        raise RobotError(f"{path}: urdf: no file {str(urdf)!r:.200}")
    return urdf, folder


def read_robot_urdf(
    config: RobotConfig, path: Path, unusable: dict[str, str] | None = None
) -> tuple[ElementTree.Element, Path]:
    """Read the URDF of a robot.yaml, its meshes where the robot.yaml says.

    Parameters
    ----------
    config : RobotConfig
    path : Path
        The robot.yaml.
    unusable : dict of str, optional
        Addresses of meshes that cannot be used, and why, are added to it.

    Returns
    -------
    tree : Element
        Without the shapes whose meshes cannot be used, if the robot.yaml has capsules.
    urdf : Path

    Raises
    ------
    RobotError
        If there is no such file, or it is none of which an arm is made.
    """
    urdf, folder = find_urdf(config.urdf, path)
    if config.mesh_folder is not None:
        folder = path.parent / config.mesh_folder
    packages = {name: path.parent / one for name, one in config.packages.items()}
    # Capsules in the robot.yaml stand for the meshes.
    left_out = unusable if unusable is not None else {} if config.capsules else None
    return read_urdf(urdf, folder, packages, left_out), urdf


def _share_folder() -> Path:
    """Return the share folder that holds example-robot-data, which ships no Python module."""
    try:
        distribution = metadata.distribution(_PACKAGE)
    except metadata.PackageNotFoundError:
        raise RobotError(f"package {_PACKAGE!r} is not installed; pip install {_PACKAGE}") from None
    return Path(str(distribution.locate_file("cmeel.prefix/share")))


def build_robot(
    config: RobotConfig,
    tool_name: str,
    tree: ElementTree.Element,
    urdf: Path,
    path: Path,
    source: str,
) -> Robot:
    """Assemble a robot from its config.

    Parameters
    ----------
    config : RobotConfig
        Checked.
    tool_name : str
        One of its tools.
    tree, urdf
        From `read_robot_urdf`.
    path : Path
        The robot.yaml, named in errors.
    source : str
        What the robot was loaded by.

    Raises
    ------
    RobotError
        If a joint or link is not in the URDF, or Pinocchio cannot be loaded.
    """
    try:
        from besman.robot import pinocchio_model
    except ImportError as error:
        raise RobotError(
            f"robot {config.name}: Pinocchio cannot be loaded: {error}; "
            "libgomp.so.1, which it needs, is in the system's package libgomp1 or libgomp"
        ) from None

    limits = joint_limits(config.joints)
    tool = mount_tool(tool_name, config)
    model, tip_frame = pinocchio_model.build_model(config, tool, limits, tree, urdf, path)
    chain = pinocchio_model.build_chain(model, tip_frame, config, tool, tree, urdf, path)
    content = {
        "config": config.model_dump(mode="json"),
        "tool": tool_name,
        "urdf_sha256": hashlib.sha256(urdf.read_bytes()).hexdigest(),
        "capsules": np.round(chain.capsule_ends, 9).tolist(),
        "radii": np.round(chain.capsule_radii, 9).tolist(),
    }
    return Robot(
        name=config.name,
        joint_names=tuple(joint.name for joint in config.joints),
        model=model,
        tip_frame=tip_frame,
        limits=limits,
        home=read_only(np.radians([joint.home_deg for joint in config.joints])),
        chain=chain,
        tool=tool,
        base_height=config.mounting.height_m,
        drives=drives_of(config, tool),
        content=content,
        source=source,
    )


def joint_limits(joints: tuple[JointConfig, ...]) -> JointLimits:
    """Collect the joints' limits in SI units."""
    return JointLimits(
        position_min=read_only(np.radians([joint.position_deg[0] for joint in joints])),
        position_max=read_only(np.radians([joint.position_deg[1] for joint in joints])),
        velocity=read_only(np.radians([joint.velocity_deg_s for joint in joints])),
        acceleration=read_only([joint.acceleration_rad_s2 for joint in joints]),
        torque=read_only([joint.torque_nm for joint in joints]),
        jerk=read_only(
            [np.inf if joint.jerk_rad_s3 is None else joint.jerk_rad_s3 for joint in joints]
        ),
    )


def mount_tool(name: str, config: RobotConfig) -> Tool:
    """Turn a tool's config into matrices, in the frame of the link it is mounted on.

    Parameters
    ----------
    name : str
        One of the robot's tools.
    config : RobotConfig
        Says how the flange is turned, and how small tools are.
    """
    tool = tools_of(config)[name]
    scale = max(config.tool_scale, tool.least_scale)
    flange = np.eye(4)
    flange[:3, :3] = quaternion_to_rotation(config.flange_wxyz)
    tcp2flange = np.eye(4)
    tcp2flange[:3, :3] = quaternion_to_rotation(tool.rotation_wxyz)
    tcp2flange[:3, 3] = scale * np.array(tool.translation_m)
    tcp2hand = np.eye(4)
    tcp2hand[:3, :3] = quaternion_to_rotation(tool.hand_to_tcp_wxyz)
    tcp2hand[:3, 3] = tool.hand_to_tcp_m
    return Tool(
        name=name,
        tcp2flange=read_only(flange @ tcp2flange),
        tcp2hand=read_only(tcp2hand),
        mass=scale * tool.mass_kg,
        capsule_ends=read_only(scale * np.array(tool.capsule_ends_m) @ flange[:3, :3].T),
        capsule_radius=tool.capsule_radius_m,
        scale=scale,
    )
