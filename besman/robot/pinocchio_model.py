"""The Pinocchio model of an arm, and the plain arrays taken from it."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio

from besman.exceptions import RobotError, in_one_line, nearest
from besman.foreign.error_stream import catch_error_stream
from besman.foreign.urdf_text import link_names
from besman.geometry.joint_axis import joint_axis
from besman.robot.config import RobotConfig
from besman.robot.link_shapes import link_capsules
from besman.robot.parts import Chain, JointLimits, Tool, capsule_part, read_only
from besman.robot.urdf_file import joint_in_model, text_for_model

FloatArray = npt.NDArray[np.float64]

# What urdfdom writes where it drops a part of a link, and what follows it.
_LOST = "Could not parse"


def build_model(
    config: RobotConfig,
    tool: Tool,
    limits: JointLimits,
    tree: ElementTree.Element,
    urdf: Path,
    path: Path,
) -> tuple[Any, int]:
    """Build the Pinocchio model with mounting, tool and the config's limits and inertias.

    Parameters
    ----------
    config : RobotConfig
        What the robot.yaml says.
    tool : Tool
        Its mass goes to the last body; frame ``tcp`` is added.
    limits : JointLimits
        Written into the model.
    tree : Element
        The URDF, from `read_urdf`.
    urdf, path : Path
        The URDF and the robot.yaml, named in errors.

    Returns
    -------
    model : pinocchio.Model
    tip_frame : int
        Index of frame ``tcp``.

    Raises
    ------
    RobotError
        If the URDF cannot be used, or a joint or link is not in it.
    """
    text = _amend(config, tree, path)
    try:
        # What is wrong is written there, not raised.
        with catch_error_stream() as said:
            full = pinocchio.buildModelFromXML(text)
    except (ValueError, RuntimeError) as error:
        why = in_one_line(said) or in_one_line(error)
        raise RobotError(f"{urdf}: cannot be used as URDF: {why}") from None
    lost = next((line for line in said if _LOST in line), None)
    if lost is not None:
        # The library goes on without the link's mass and shapes.
        raise RobotError(f"{urdf}: cannot be used as URDF: {in_one_line(said)}")
    _refuse_mimics(config, tree, path)
    model = _reduce(full, config, set(link_names(tree)), path)
    if not model.existFrame(config.tip, pinocchio.FrameType.BODY):
        links = [frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY]
        raise RobotError(f"{path}: tip: no link {config.tip!r}; {nearest(config.tip, links)}")
    _mount(model, config)
    tip_frame = _attach(model, config.tip, tool, path)
    model.lowerPositionLimit = limits.position_min.copy()
    model.upperPositionLimit = limits.position_max.copy()
    model.upperVelocityLimit = limits.velocity.copy()
    model.lowerVelocityLimit = -limits.velocity
    model.upperEffortLimit = limits.torque.copy()
    model.lowerEffortLimit = -limits.torque
    return model, tip_frame


def _amend(config: RobotConfig, tree: ElementTree.Element, path: Path) -> str:
    """Return the URDF's text with the config's inertias, and its limits on hinges without end."""
    tree = copy.deepcopy(tree)
    limits = {joint.name: joint.position_deg for joint in config.joints}
    for hinge in tree.iterfind("joint[@type='continuous']"):
        if hinge.get("name") in limits:
            hinge.set("type", "revolute")
            lower, upper = np.radians(limits[str(hinge.get("name"))])
            for old in hinge.findall("limit"):
                hinge.remove(old)
            bounds = {"lower": repr(float(lower)), "upper": repr(float(upper))}
            ElementTree.SubElement(hinge, "limit", bounds | {"effort": "1", "velocity": "1"})
    links = {str(link.get("name")): link for link in tree.iter("link")}
    for name, inertia in config.inertia.items():
        if name not in links:
            raise RobotError(f"{path}: inertia: no link {name!r}; {nearest(name, links)}")
        for old in links[name].findall("inertial"):
            links[name].remove(old)
        new = ElementTree.SubElement(links[name], "inertial")
        xyz = " ".join(repr(part) for part in inertia.com_m)
        ElementTree.SubElement(new, "origin", xyz=xyz, rpy="0 0 0")
        ElementTree.SubElement(new, "mass", value=repr(inertia.mass_kg))
        moments = dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "0")
        for key, value in zip(("ixx", "iyy", "izz"), inertia.inertia_kgm2, strict=True):
            moments[key] = repr(value)
        ElementTree.SubElement(new, "inertia", moments)
    return text_for_model(tree)


def _refuse_mimics(config: RobotConfig, tree: ElementTree.Element, path: Path) -> None:
    """Refuse joints that follow another one: moved by themselves, they are elsewhere."""
    names = {joint.name for joint in config.joints}
    for joint in tree.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None and joint.get("name") in names:
            raise RobotError(
                f"{path}: joint {joint.get('name')}: <mimic>: follows joint "
                f"{mimic.get('joint', '')!r:.60}; coupled joints within an arm cannot be used"
            )


def _fixed_pose(full: Any, config: RobotConfig, links: set[str], path: Path) -> FloatArray:
    """Return the configuration at which the joints that are not the arm's are fixed."""
    pose: FloatArray = pinocchio.neutral(full)
    held = {joint_in_model(name, links): value for name, value in config.held.items()}
    for name, value in held.items():
        if name not in list(full.names)[1:]:
            there = list(full.names)[1:]
            raise RobotError(f"{path}: held: no joint {name!r} in the URDF; {nearest(name, there)}")
        joint = full.joints[full.getJointId(name)]
        if joint.nq == 1:
            pose[joint.idx_q] = value
        elif joint.nq == 2:
            pose[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        else:
            raise RobotError(f"{path}: held: joint {name!r} has more than one degree of freedom")
    return pose


def _reduce(full: Any, config: RobotConfig, links: set[str], path: Path) -> Any:
    """Fix all joints but the named ones, and check that these form one chain of hinges."""
    there = list(full.names)[1:]
    names = [joint_in_model(joint.name, links) for joint in config.joints]
    for name in names:
        if name not in there:
            raise RobotError(
                f"{path}: joints: no joint {name!r} in the URDF; {nearest(name, there)}"
            )
    fixed = [full.getJointId(name) for name in there if name not in names]
    model = full
    if fixed:
        model = pinocchio.buildReducedModel(full, fixed, _fixed_pose(full, config, links, path))
    if list(model.names)[1:] != names or list(model.parents)[1:] != list(range(len(names))):
        raise RobotError(
            f"{path}: joints: expected one chain from base to tip, in the URDF's order: "
            f"{', '.join(list(model.names)[1:])}"
        )
    for joint in list(model.joints)[1:]:
        if joint.nq != 1 or not _is_hinge(joint):
            name = model.names[joint.id]
            raise RobotError(f"{path}: joint {name}: only hinges with limits can be used")
    return model


def _is_hinge(joint: Any) -> bool:
    """Tell whether a joint is a hinge."""
    return bool(abs(np.linalg.norm(joint_axis(joint)[1]) - 1.0) < 1e-9)


def _mount(model: Any, config: RobotConfig) -> None:
    """Raise the arm onto its pedestal: everything that hangs on the world moves along."""
    how = config.mounting
    turn = pinocchio.rpy.rpyToMatrix(np.radians([how.roll_deg, how.pitch_deg, how.yaw_deg]))
    mount = pinocchio.SE3(turn, np.array([0.0, 0.0, how.height_m]))
    model.jointPlacements[1] = mount * model.jointPlacements[1]
    for index in range(1, model.nframes):
        if model.frames[index].parentJoint == 0:
            model.frames[index].placement = mount * model.frames[index].placement


def _attach(model: Any, tip: str, tool: Tool, path: Path) -> int:
    """Add the tool's mass and the frame ``tcp``."""
    link = model.getFrameId(tip, pinocchio.FrameType.BODY)
    flange = model.frames[link]
    if flange.parentJoint != model.njoints - 1:
        raise RobotError(f"{path}: tip: link {tip!r} does not hang on the last joint")
    tcp = flange.placement * pinocchio.SE3(tool.tcp2flange)
    if tool.mass > 0:
        start, end = tool.capsule_ends
        length = float(np.linalg.norm(end - start))
        radius = max(tool.capsule_radius, 0.01)
        body = pinocchio.Inertia.FromCylinder(tool.mass, radius, max(length, radius))
        along = (end - start) / length if length > 0 else np.array([0.0, 0.0, 1.0])
        turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along)
        middle = flange.placement * pinocchio.SE3(turn.matrix(), (start + end) / 2)
        model.appendBodyToJoint(flange.parentJoint, body, middle)
    frame = pinocchio.Frame(
        "tcp",
        flange.parentJoint,
        link,
        tcp,
        pinocchio.FrameType.OP_FRAME,
    )
    return int(model.addFrame(frame))


def build_chain(
    model: Any,
    tip_frame: int,
    config: RobotConfig,
    tool: Tool,
    tree: ElementTree.Element,
    urdf: Path,
    path: Path,
) -> Chain:
    """Take the arm's geometry out of the model as plain arrays.

    Parameters
    ----------
    model : pinocchio.Model
        From `build_model`.
    tip_frame : int
        Index of frame ``tcp``.
    config : RobotConfig
        Ignored pairs and pedestal.
    tool : Tool
        Its capsule is added.
    tree : Element
        The URDF, from `read_urdf`.
    urdf, path : Path
        The URDF and the robot.yaml, named in errors.

    Returns
    -------
    Chain
        Arrays are read-only.
    """
    capsules = link_capsules(model, config, tree, urdf, path)
    if config.mounting.pedestal_radius_m > 0:
        radius = config.mounting.pedestal_radius_m
        height = max(config.mounting.height_m - radius, 0.0)
        capsules.append(("pedestal", -1, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, height]]), radius))
    if tool.capsule_radius > 0:
        link = model.getFrameId(config.tip, pinocchio.FrameType.BODY)
        flange = model.frames[link].placement
        axis = tool.capsule_ends @ flange.rotation.T + flange.translation
        capsules.append(("tool", model.njoints - 2, axis, tool.capsule_radius))
    links = [link for link, *_ in capsules]
    joints = [joint for _, joint, *_ in capsules]
    pairs = _pairs(links, joints, config)
    indices = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    joint_array = np.array(joints, dtype=np.int64)
    indices.setflags(write=False)
    joint_array.setflags(write=False)
    return Chain(
        placements=read_only([place.homogeneous for place in list(model.jointPlacements)[1:]]),
        axes=read_only([joint_axis(joint)[1] for joint in list(model.joints)[1:]]),
        tip=read_only(model.frames[tip_frame].placement.homogeneous),
        capsule_joints=joint_array,
        capsule_ends=read_only(np.reshape([ends for _, _, ends, _ in capsules], (-1, 2, 3))),
        capsule_radii=read_only([radius for *_, radius in capsules]),
        capsule_links=tuple(links),
        capsule_pairs=indices,
    )


def _pairs(links: list[str], joints: list[int], config: RobotConfig) -> list[tuple[int, int]]:
    """List the pairs of capsules that can collide and must not, those of two bodies in a row."""
    ignored = {frozenset(pair) for pair in config.ignored_pairs}
    parts = [capsule_part(links, index) for index in range(len(links))]
    last = max(joints, default=-1)
    pairs = []
    for first in range(len(links)):
        for second in range(first + 1, len(links)):
            names = frozenset((links[first], links[second]))
            their_parts = frozenset((parts[first], parts[second]))
            near, far = sorted((joints[first], joints[second]))
            # The wrist's links carry the tool: they cannot reach it.
            wrist = "tool" in names and near >= last - 2
            left_out = names in ignored or their_parts in ignored
            if far - near > 1 and not left_out and not wrist:
                pairs.append((first, second))
    return sorted(pairs, key=lambda pair: (joints[pair[0]], joints[pair[1]]))
