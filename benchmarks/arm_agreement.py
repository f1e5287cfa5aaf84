"""What an arm that came in has in common with its file, as other libraries read that."""

from __future__ import annotations

import io
import logging
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio

from besman.config.yaml_file import load_config
from besman.robot.config import RobotConfig
from besman.robot.files.joint_limits import FILE
from besman.robot.files.mjcf_file import is_mjcf
from besman.robot.files.mjcf_meshes import compile_bare
from besman.robot.files.touching_links import random_poses
from besman.robot.model import Robot, load_robot
from besman.robot.urdf_file import read_urdf_text

FloatArray = npt.NDArray[np.float64]

POSES = 20


def agreement(file: Path, path: Path) -> dict[str, float]:
    """Say how far an arm is from its file.

    Parameters
    ----------
    file : Path
        The description: of a xacro the URDF that was made of it is read.
    path : Path
        The robot.yaml.

    Returns
    -------
    dict of float
        The flange's greatest distance, metres, and turn, rad, in 20 random poses, by library; the
        greatest relative difference of limits that are the file's; the relative one of the mass
        that the first joint moves.
    """
    config, robot = load_config(path, RobotConfig), load_robot(path, "none")
    poses = random_poses(robot, POSES, seed=5)
    flanges = _flanges(robot, config, poses)
    content = file.read_bytes()
    if is_mjcf(content[:20_000]):
        found = {"mujoco": _apart(flanges, _by_mujoco(file, config, poses))}
        masses = _mujoco_mass(file, config)
        return found | {"mass": _relative(_moved_mass(robot, config), masses)}
    written = path.parent / config.urdf
    tree = read_urdf_text(written)
    bare = _without_shapes(tree)
    root = _root(tree)
    found = {
        "yourdfpy": _apart(flanges, _by_yourdfpy(bare, root, config, poses)),
        "limits": _limits(tree, config),
    }
    try:
        mass = _pinocchio_mass(bare, config)
    except ValueError:
        # Pinocchio does not read the file as it is.
        return found
    return found | {
        "pinocchio": _apart(flanges, _by_pinocchio(bare, config, poses)),
        "mass": _relative(_moved_mass(robot, config), mass),
    }


def _flanges(robot: Robot, config: RobotConfig, poses: FloatArray) -> FloatArray:
    """Return the tip link in the root of the file, (B, 4, 4), without the mounting."""
    data, frame = (
        robot.model.createData(),
        robot.model.getFrameId(config.tip, pinocchio.FrameType.BODY),
    )
    lower = pinocchio.SE3(np.eye(3), np.array([0.0, 0.0, config.mounting.height_m]))
    placed = []
    for pose in poses:
        pinocchio.framesForwardKinematics(robot.model, data, pose)
        placed.append((lower.inverse() * data.oMf[frame]).homogeneous)
    return np.array(placed)


def _apart(ours: FloatArray, theirs: FloatArray) -> float:
    """Return the greatest difference of an element of two poses."""
    return float(np.abs(ours - theirs).max())


def _relative(one: float, other: float) -> float:
    return abs(one - other) / max(abs(other), 1e-9)


def _root(tree: ElementTree.Element) -> str:
    """Return the link that no joint moves."""
    children = {joint.find("child").get("link") for joint in tree.findall("joint")}  # type: ignore[union-attr]
    return next(str(link.get("name")) for link in tree.findall("link")
                if link.get("name") not in children)  # fmt: skip


def _without_shapes(tree: ElementTree.Element) -> bytes:
    """Return a URDF's text without shapes; joints that share a link's name get another one."""
    bare = ElementTree.fromstring(ElementTree.tostring(tree))
    links = {link.get("name") for link in bare.findall("link")}
    for link in bare.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    for joint in bare.findall("joint"):
        if joint.get("name") in links:
            joint.set("name", f"{joint.get('name')} (joint)")
    return ElementTree.tostring(bare)


def _values(config: RobotConfig, pose: FloatArray) -> dict[str, float]:
    """Return joint values by name: the arm's and the held ones."""
    values = dict(zip((joint.name for joint in config.joints), pose.tolist(), strict=True))
    return {**config.held, **values}


def _by_yourdfpy(bare: bytes, root: str, config: RobotConfig, poses: FloatArray) -> FloatArray:
    """Place the tip by yourdfpy."""
    import yourdfpy

    logging.getLogger("yourdfpy.urdf").setLevel(logging.CRITICAL)
    robot = yourdfpy.URDF.load(io.BytesIO(bare), load_meshes=False, build_scene_graph=True)
    names = set(robot.joint_map)
    placed = []
    for pose in poses:
        values = {name if name in names else f"{name} (joint)": value
                  for name, value in _values(config, pose).items()}  # fmt: skip
        rest = {name: 0.0 for name in robot.actuated_joint_names}
        robot.update_cfg({**rest, **{k: v for k, v in values.items() if k in rest}})
        placed.append(robot.get_transform(config.tip, root))
    return np.array(placed)


def _pinocchio_model(bare: bytes) -> Any:
    return pinocchio.buildModelFromXML(bare.decode())


def _set_joint(model: Any, pose: FloatArray, name: str, value: float) -> None:
    """Write a joint's value into a configuration of Pinocchio's."""
    name = name if model.existJointName(name) else f"{name} (joint)"
    joint = model.joints[model.getJointId(name)]
    parts = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    pose[joint.idx_q : joint.idx_q + joint.nq] = parts


def _by_pinocchio(bare: bytes, config: RobotConfig, poses: FloatArray) -> FloatArray:
    """Place the tip by Pinocchio."""
    model = _pinocchio_model(bare)
    data = model.createData()
    frame = model.getFrameId(config.tip, pinocchio.FrameType.BODY)
    placed = []
    for pose in poses:
        whole = pinocchio.neutral(model)
        for name, value in _values(config, pose).items():
            _set_joint(model, whole, name, value)
        pinocchio.framesForwardKinematics(model, data, whole)
        placed.append(data.oMf[frame].homogeneous)
    return np.array(placed)


def _pinocchio_mass(bare: bytes, config: RobotConfig) -> float:
    """Return the mass that the first joint moves."""
    model = _pinocchio_model(bare)
    data = model.createData()
    pinocchio.computeSubtreeMasses(model, data)
    first = config.joints[0].name
    return float(data.mass[model.getJointId(first if model.existJointName(first) else
                                            f"{first} (joint)")])  # fmt: skip


def _moved_mass(robot: Robot, config: RobotConfig) -> float:
    """Return the mass that the arm moves, without what was assumed for links that have none."""
    whole = sum(inertia.mass for inertia in list(robot.model.inertias)[1:])
    return float(whole - sum(one.mass_kg for one in config.inertia.values()))


def _limits(tree: ElementTree.Element, config: RobotConfig) -> float:
    """Return the greatest relative difference of the limits that are said to be the file's."""
    joints = {joint.get("name"): joint.find("limit") for joint in tree.findall("joint")}
    most = 0.0
    for joint in config.joints:
        limit = joints[joint.name]
        given = {
            "position_deg": [np.degrees(float(limit.get(key, "0"))) for key in ("lower", "upper")]
            if limit is not None else [],
            "velocity_deg_s": [np.degrees(float(limit.get("velocity", "0")))]
            if limit is not None else [],
            "torque_nm": [float(limit.get("effort", "0"))] if limit is not None else [],
        }  # fmt: skip
        for key, theirs in given.items():
            if joint.origin.get(key) == FILE:
                ours = np.ravel(getattr(joint, key))
                scale = np.maximum(np.abs(theirs), 1.0)
                most = max(most, float(np.max(np.abs(ours - theirs) / scale)))
    return most


def _by_mujoco(file: Path, config: RobotConfig, poses: FloatArray) -> FloatArray:
    """Place the tip, a body, a site or a joint's link, by MuJoCo."""
    import mujoco

    # Without pictures and missing meshes, which MuJoCo would refuse.
    model, _ = compile_bare(file)
    data = mujoco.MjData(model)
    placed = []
    for pose in poses:
        data.qpos[:] = model.qpos0
        for name, value in _values(config, pose).items():
            data.qpos[model.jnt_qposadr[model.joint(name).id]] = value
        mujoco.mj_kinematics(model, data)
        at = np.eye(4)
        name = config.tip.removesuffix(" (site)")
        # What has no name of its own is called by its number.
        unnamed = re.fullmatch(r"body(\d+)", name)
        if name != config.tip or (_no_body(model, name) and not unnamed):
            what = data.site(name)
        else:
            what = data.body(int(unnamed[1]) if unnamed and _no_body(model, name) else name)
        at[:3, 3], at[:3, :3] = what.xpos, what.xmat.reshape(3, 3)
        placed.append(at)
    return np.array(placed)


def _no_body(model: Any, name: str) -> bool:
    """Tell whether no body is called so."""
    return name not in {model.body(one).name for one in range(model.nbody)}


def _mujoco_mass(file: Path, config: RobotConfig) -> float:
    """Return the mass that the first joint moves, by MuJoCo."""

    # Without pictures and missing meshes, which MuJoCo would refuse.
    model, _ = compile_bare(file)
    joint = model.joint(config.joints[0].name)
    return float(model.body_subtreemass[int(joint.bodyid[0])])
