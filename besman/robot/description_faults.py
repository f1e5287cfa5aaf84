"""What is missing or doubtful in the description of a robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from besman.config.yaml_file import load_config
from besman.exceptions import BesmanError
from besman.robot.collision import distances
from besman.robot.config import RobotConfig
from besman.robot.files.known_limits import KnownArm, arm_titles, find_known_arm
from besman.robot.files.mesh_folders import list_faults
from besman.robot.kinematics import manipulability
from besman.robot.model import Robot, find_robot, load_robot, read_robot_urdf
from besman.robot.shape_doubts import flange_doubts, overlap_doubts, shape_doubts

FloatArray = npt.NDArray[np.float64]

Kind = Literal["missing", "doubtful", "assumed"]

# No body has a greater radius of gyration than half of its length; links are more than their
# capsules, so that only what is far beyond counts.
_GYRATION_SHARE = 0.75
_LEAST_SIZE_M = 0.15
_LEAST_MANIPULABILITY = 1e-4
_SLOWEST_RAD_S = 0.5
_FASTEST_RAD_S = 10.0
# Radians of two digits in a URDF, degrees in a data sheet.
_ROUNDING = 0.02
# Makers count to the wrist or to the flange.
_ODD_TIMES = 1.5
ODD_REACH = "reach:"
"""What the line about a file of another size than its arm begins with."""


@dataclass(frozen=True)
class Doubt:
    """One line of the report.

    Attributes
    ----------
    kind : "missing", "doubtful" or "assumed"
        With something missing the robot cannot be used; what is assumed says the robot.yaml.
    text : str
        What it is.
    """

    kind: Kind
    text: str


def check_robot(name_or_path: str | Path) -> list[Doubt]:
    """Look for what is missing or doubtful: files, limits, inertias, capsules, home.

    Parameters
    ----------
    name_or_path : str or Path
        A robot that is there, or the path of a robot.yaml.

    Returns
    -------
    list of Doubt
        Empty if there is none.

    Raises
    ------
    RobotError, ConfigError
        If there is no such robot, or its robot.yaml is not valid.
    """
    path = find_robot(name_or_path)
    config = load_config(path, RobotConfig)
    doubts = [Doubt("assumed", text) for text in config.assumed]
    told = all(joint.origin for joint in config.joints)
    if not told and not path.with_name("SOURCES.md").is_file():
        doubts.append(Doubt("doubtful", "no SOURCES.md beside it: no number has an origin"))
    missing = _zero_limits(config) + [
        _as_added(doubt, doubts) for doubt in _missing_meshes(config, path)
    ]
    try:
        robot = load_robot(path)
    except BesmanError as error:
        return [*missing, *([] if missing else [Doubt("missing", str(error))]), *doubts]
    known = _published(robot, config, path)
    found = missing + _odd_speeds(robot)
    if known is not None:
        found += _odd_reach(robot, known) + _beyond_published(config, known)
    found += _inertias(robot) + _capsules(robot)
    found += _shapes(robot, config, path) + _home(robot)
    return found + doubts


def _zero_limits(config: RobotConfig) -> list[Doubt]:
    """Find limits that no movement could keep."""
    doubts = []
    for joint in config.joints:
        lower, upper = joint.position_deg
        for key, value in (
            ("position_deg", upper - lower),
            ("velocity_deg_s", joint.velocity_deg_s),
            ("acceleration_rad_s2", joint.acceleration_rad_s2),
            ("torque_nm", joint.torque_nm),
        ):
            if not value > 0:
                doubts.append(Doubt("missing", f"joint {joint.name}: {key} leaves no room to move"))
    return doubts


def _missing_meshes(config: RobotConfig, path: Path) -> list[Doubt]:
    """Find meshes that are not there."""
    unusable: dict[str, str] = {}
    try:
        read_robot_urdf(config, path, unusable)
    except BesmanError as error:
        return [Doubt("missing", str(error))]
    # Capsules in the robot.yaml stand for the meshes.
    kind: Kind = "doubtful" if config.capsules else "missing"
    return [Doubt(kind, text) for text in list_faults(unusable)]


def _as_added(doubt: Doubt, assumed: list[Doubt]) -> Doubt:
    """Say a fault as it was when the arm was added, once: where it was looked for too."""
    for one in assumed:
        if one.text.startswith(doubt.text):
            assumed.remove(one)
            return Doubt(doubt.kind, one.text)
    return doubt


def _odd_speeds(robot: Robot) -> list[Doubt]:
    """Find speeds beyond those of any arm, and an arm whose joints are all slower than those."""
    fastest = float(robot.limits.velocity.max())
    if fastest < _SLOWEST_RAD_S:
        said = f"no joint is faster than {np.degrees(fastest):.0f} degrees/s; slower than arms are"
        return [Doubt("doubtful", said)]
    return [
        Doubt("doubtful", f"joint {name}: a speed of {np.degrees(speed):.0f} degrees/s")
        for name, speed in zip(robot.joint_names, robot.limits.velocity, strict=True)
        if speed > _FASTEST_RAD_S
    ]


def _published(robot: Robot, config: RobotConfig, path: Path) -> KnownArm | None:
    """Find what the arm's maker publishes, by what the arm is called."""
    tree, urdf = read_robot_urdf(config, path, {})
    return find_known_arm(
        arm_titles(tree, [config.name, urdf.stem, config.joints[0].name]), robot.n
    )


def _odd_reach(robot: Robot, known: KnownArm) -> list[Doubt]:
    """Find a file of another size than the arm: in another unit, or scaled."""
    from besman.robot.workspace import sample_workspace

    if known.reach_m is None:
        return []
    reach = sample_workspace(robot).reach_m
    times = reach / known.reach_m
    if 1.0 / _ODD_TIMES < times < _ODD_TIMES:
        return []
    text = (
        f"{ODD_REACH} {reach:.2f} m from the second joint to the flange, {times:.2g} times the "
        f"{known.reach_m:g} m that are published of {known.arm}; look at the unit and the scale of "
        f"origins and meshes; {known.reach_source}"
    )
    return [Doubt("doubtful", text)]


def _beyond_published(config: RobotConfig, known: KnownArm) -> list[Doubt]:
    """Find limits that are greater than what the arm's maker publishes."""
    doubts = []
    for key, published in known.limits.items():
        own = [float(getattr(joint, key)) for joint in config.joints]
        over = [
            f"{joint.name} {value:g} over {most:g}"
            for joint, value, most in zip(config.joints, own, published, strict=True)
            if value > (1.0 + _ROUNDING) * most
        ]
        if over:
            text = f"{key}: more than published of {known.arm}: {', '.join(over)}; {known.source}"
            doubts.append(Doubt("doubtful", text))
    return doubts


def _inertias(robot: Robot) -> list[Doubt]:
    """Find inertias that no body of the link's size and mass has."""
    doubts = []
    for index, name in enumerate(robot.joint_names):
        body: Any = robot.model.inertias[index + 1]
        what = f"inertia of what joint {name} moves"
        if body.mass < 1e-3:
            doubts.append(Doubt("doubtful", f"{what}: a mass of {body.mass:g} kg"))
            continue
        moments = np.linalg.eigvalsh(body.inertia)
        if moments[0] <= 0 or moments[2] > moments[0] + moments[1] + 1e-9:
            values = ", ".join(f"{moment:.3g}" for moment in moments)
            said = (
                f"{what}: no body has the moments {values} kg m^2; the nearest possible are taken"
            )
            doubts.append(Doubt("doubtful", said))
        size, gyration = _size(robot, index), float(np.sqrt(max(moments[2], 0.0) / body.mass))
        if gyration > _GYRATION_SHARE * size:
            doubts.append(
                Doubt(
                    "doubtful",
                    f"{what}: a radius of gyration of {gyration:.2f} m in {size:.2f} m of length",
                )
            )
    return doubts


def _size(robot: Robot, joint: int) -> float:
    """Return how long the body of a joint is, metres."""
    chain = robot.chain
    points = [np.zeros((1, 3))]
    following = chain.placements[joint + 1] if joint + 1 < robot.n else chain.tip
    points.append(following[None, :3, 3])
    for index in np.flatnonzero(chain.capsule_joints == joint):
        ends, radius = chain.capsule_ends[index], chain.capsule_radii[index]
        points += [ends - radius, ends + radius]
    placed = np.vstack(points)
    return max(float(np.linalg.norm(np.ptp(placed, axis=0))), _LEAST_SIZE_M)


def _capsules(robot: Robot) -> list[Doubt]:
    """Find joints whose links nothing encloses."""
    joints = set(robot.chain.capsule_joints.tolist())
    bare = [name for index, name in enumerate(robot.joint_names) if index not in joints]
    if len(bare) == robot.n:
        return [Doubt("doubtful", "no capsules: collisions are not seen")]
    return [Doubt("doubtful", f"no capsule on what joint {name} moves") for name in bare]


def _shapes(robot: Robot, config: RobotConfig, path: Path) -> list[Doubt]:
    """Find capsules that do not fit, links that always touch, and a flange that looks aside."""
    unusable: dict[str, str] = {}
    tree, urdf = read_robot_urdf(config, path, unusable)
    said = flange_doubts(robot) + overlap_doubts(robot) + shape_doubts(robot, tree, urdf)
    return [Doubt("doubtful", text) for text in said]


def _home(robot: Robot) -> list[Doubt]:
    """Find out whether the arm can stand at home."""
    import pinocchio

    doubts = []
    if distances(robot.chain, robot.home).min() <= 0:
        doubts.append(Doubt("doubtful", "home: the arm touches itself, its pedestal or the floor"))
    # With less than six joints it is zero everywhere.
    if robot.n >= 6 and manipulability(robot.chain, robot.home) < _LEAST_MANIPULABILITY:
        doubts.append(Doubt("doubtful", "home: singular; movements are looked for from there"))
    data = robot.model.createData()
    held = np.abs(pinocchio.computeGeneralizedGravity(robot.model, data, robot.home))
    for index in np.flatnonzero(held > robot.limits.torque):
        doubts.append(
            Doubt(
                "doubtful",
                f"home: joint {robot.joint_names[index]} would need {held[index]:.0f} Nm to stand",
            )
        )
    return doubts
