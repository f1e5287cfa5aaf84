"""What a robot.yaml may say."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from besman.config.stage import Config, NotNegative, Positive
from besman.foreign.names import fault_of_part_name


def _check_part_name(name: str) -> str:
    """Refuse names that a table or a terminal would obey."""
    fault = fault_of_part_name(name)
    if fault is not None:
        raise ValueError(f"the name {fault}")
    return name


PartName = Annotated[str, AfterValidator(_check_part_name)]
"""Name of a robot, joint, link or tool; it names columns of tables and bodies in other programs."""

Triple = tuple[float, float, float]
Share = Annotated[float, Field(gt=0, le=1)]


_LONGEST_QUATERNION = 1000.0


def _normalise(value: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return a quaternion of length one."""
    norm = sum(part * part for part in value) ** 0.5
    # Its parts are read as numbers of any size: of one that overflows nothing would be left.
    if not 1e-6 <= norm <= _LONGEST_QUATERNION:
        raise ValueError(
            "expected a quaternion (w, x, y, z) that is not zero, and not longer than "
            f"{_LONGEST_QUATERNION:g}"
        )
    w, x, y, z = (part / norm for part in value)
    return (w, x, y, z)


Quaternion = Annotated[tuple[float, float, float, float], AfterValidator(_normalise)]


class JointConfig(Config):
    """One joint that moves, in the order from base to tip.

    Attributes
    ----------
    name : str
        Name of the joint in the URDF.
    position_deg : pair of float
        Lower and upper limit, degrees.
    velocity_deg_s, acceleration_rad_s2, torque_nm : float
        Greatest absolute values, above zero: degrees/s, rad/s^2, Nm.
    home_deg : float
        Angle of the home configuration, degrees.
    jerk_rad_s3 : float, optional
        Greatest absolute jerk, rad/s^3; null where the maker states none: then it is not limited.
    servo_gain : float
        How much stiffer the servo is than the usual one: factor of both of its gains.
    delay_s, lag_s : float
        How late the servo gets its set-points, and the time constant with which these are smoothed.
    friction_nm, damping_nms_rad : float
        Dry friction, and viscous friction, Nm s/rad.
    origin : dict of str
        Where the numbers come from, by the names above, in words; what is not among them is in
        ``SOURCES.md``.

    What a servo and its joint do, `servo_gain` to `damping_nms_rad`, ``besman identify`` measures.
    """

    name: PartName
    position_deg: tuple[float, float]
    velocity_deg_s: float
    acceleration_rad_s2: float
    torque_nm: float
    home_deg: float
    jerk_rad_s3: Positive | None = None
    servo_gain: Annotated[float, Field(ge=0.05, le=20)] = 1.0
    delay_s: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    lag_s: Annotated[float, Field(ge=0, le=1)] = 0.0
    friction_nm: NotNegative = 0.0
    damping_nms_rad: NotNegative = 0.0
    origin: dict[str, str] = Field(default_factory=dict)


class InertiaConfig(Config):
    """The inertia of a link, where the URDF's is wrong.

    Attributes
    ----------
    mass_kg : float
        Kilogrammes.
    com_m : triple of float
        Centre of mass in the link's frame, metres.
    inertia_kgm2 : triple of float
        Diagonal of the inertia tensor about the centre of mass, axes of the link's frame, kg m^2.
    """

    mass_kg: Annotated[float, Field(gt=0)]
    com_m: Triple
    inertia_kgm2: tuple[
        Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]
    ]


class ToolConfig(Config):
    """What is mounted on the flange.

    Attributes
    ----------
    translation_m : triple of float
        Origin of the tool centre point (TCP) in the flange's frame (the tip link), metres.
    rotation_wxyz : quadruple of float
        Orientation of the TCP frame in the flange's frame. TCP z is where the tool points.
    hand_to_tcp_wxyz : quadruple of float
        Orientation of the TCP frame in the hand frame of the person: which axis of the hand the
        tool's axes follow.
    hand_to_tcp_m : triple of float
        Origin of the TCP in the hand frame of the person, metres: what the tool holds moves like
        what the hand holds.
    mass_kg : float
        Mass, spread evenly along the capsule's axis.
    capsule_ends_m : pair of triple of float
        Ends of the axis of a capsule that encloses the tool, in the flange's frame, metres.
    capsule_radius_m : float
        Its radius; no capsule if it is 0.
    least_scale : float
        How short it may be made for a small arm: its lengths, not the radius, and its mass with
        them; 1 for a tool whose size is what it holds.
    """

    translation_m: Triple = (0.0, 0.0, 0.0)
    rotation_wxyz: Quaternion = (1.0, 0.0, 0.0, 0.0)
    hand_to_tcp_wxyz: Quaternion = (1.0, 0.0, 0.0, 0.0)
    hand_to_tcp_m: Triple = (0.0, 0.0, 0.0)
    mass_kg: NotNegative = 0.0
    capsule_ends_m: tuple[Triple, Triple] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    capsule_radius_m: NotNegative = 0.0
    least_scale: Share = 1.0


class MountingConfig(Config):
    """How the arm stands.

    Attributes
    ----------
    height_m : float
        Height of the base link above the floor, metres.
    yaw_deg : float
        Turn of the base link about the vertical, degrees: world x is forward.
    roll_deg, pitch_deg : float
        Turns of the base link about the world's x and y axes, before that about the vertical,
        degrees: ``pitch_deg: 90`` is an arm on a wall, whose z points forward, ``roll_deg: 180``
        one on a ceiling.
    pedestal_radius_m : float
        Radius of the column below the base, metres; 0 for none.
    """

    height_m: NotNegative = 0.0
    yaw_deg: float = 0.0
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    pedestal_radius_m: NotNegative = 0.0


class CapsuleConfig(Config):
    """A capsule around a part of a link.

    Attributes
    ----------
    link : str
        Link of the URDF.
    ends_m : pair of triple of float
        Ends of the axis in the link's frame, metres.
    radius_m : float
        Metres.
    """

    link: PartName
    ends_m: tuple[Triple, Triple]
    radius_m: Annotated[float, Field(gt=0)]


class RobotConfig(Config):
    """A robot.yaml.

    Attributes
    ----------
    name : str
        Name of the robot.
    urdf : str
        Path relative to the robot.yaml, or ``example-robot-data:PATH`` below the folder
        ``robots`` of that installed package.
    tip : str
        Link of the URDF that tools are mounted on, z pointing away from the arm.
    flange_wxyz : quadruple of float
        Orientation of the flange in the tip link, if that link's z does not point away from the
        arm (ISO 9787).
    mesh_folder : str
        Folder, relative to the robot.yaml, that relative addresses of meshes lie below.
    packages : dict of str
        Folders of ``package://NAME``, relative to the robot.yaml, by name.
    joints : tuple of JointConfig
        The joints that move, from base to tip. All others are fixed, at zero or as ``held`` says.
    held : dict of float
        Where joints that are not among ``joints`` are fixed, by name, rad or metres.
    mounting : MountingConfig
        How the arm stands.
    inertia : dict of InertiaConfig
        By link, where the URDF's inertia is wrong.
    capsules : tuple of CapsuleConfig
        What encloses the links; if empty, capsules are fitted to the URDF's collision meshes.
    ignored_pairs : tuple of pairs of str
        Links that cannot collide with each other, besides neighbours; ``LINK#2`` is the second of
        a link's capsules alone.
    tools : dict of ToolConfig
        By name; a robot that names none has all of ``tools/NAME.yaml``.
    tool_scale : float
        Factor by which tools are made shorter for a small arm, as far as each may be.
    default_tool : str
        Used where none is named.
    payload_kg : float
        What the arm carries in the middle of its tool and its controller does not know of.
    assumed : tuple of str
        What no source states, in words; ``besman robots check`` lists it.
    """

    name: PartName
    urdf: str
    tip: PartName
    flange_wxyz: Quaternion = (1.0, 0.0, 0.0, 0.0)
    mesh_folder: str | None = None
    packages: dict[str, str] = Field(default_factory=dict)
    joints: Annotated[tuple[JointConfig, ...], Field(min_length=1)]
    held: dict[PartName, float] = Field(default_factory=dict)
    mounting: MountingConfig = MountingConfig()
    inertia: dict[PartName, InertiaConfig] = Field(default_factory=dict)
    capsules: tuple[CapsuleConfig, ...] = ()
    ignored_pairs: tuple[tuple[PartName, PartName], ...] = ()
    tools: dict[PartName, ToolConfig] = Field(default_factory=dict)
    tool_scale: Share = 1.0
    default_tool: str = "none"
    payload_kg: NotNegative = 0.0
    assumed: tuple[str, ...] = ()
