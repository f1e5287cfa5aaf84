"""Robots and scenes as shapes that a page can draw: meshes of links, and primitives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from besman.geometry.frames import rotation_to_quaternion
from besman.pictures.arm_visuals import mount_rod, pedestal_radius, robot_meshes
from besman.pictures.scene_geoms import scene_geoms
from besman.records import FloatArray
from besman.robot.model import Robot
from besman.view.decimation import Mesh, decimate
from besman.view.packing import Packer

_MOST_TRIANGLES = 8000
WORLD = -1
_PRIMITIVES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): ("sphere", 1),
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): ("capsule", 2),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): ("cylinder", 2),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): ("ellipsoid", 3),
    int(mujoco.mjtGeom.mjGEOM_BOX): ("box", 3),
}


def robot_content(robot: Robot, packer: Packer, others: Sequence[Robot] = ()) -> dict[str, Any]:
    """Describe an arm for the page.

    Parameters
    ----------
    robot : Robot
        The arm with its tool.
    packer : Packer
        Takes its meshes.
    others : sequence of Robot
        Other arms of the same robot, which are shown too: links that they move are left out.

    Returns
    -------
    dict
        ``name``, ``tool``, ``joints`` (names), ``placements`` (n x 16), ``axes``, ``tip`` as in
        `besman.robot.parts.Chain`, ``home`` (rad), and ``shapes``; see `scene_shapes`.
    """
    chain = robot.chain
    return {
        "name": robot.name,
        "tool": robot.tool.name,
        "joints": list(robot.joint_names),
        "placements": [placement.ravel().tolist() for placement in chain.placements],
        "axes": chain.axes.tolist(),
        "tip": chain.tip.ravel().tolist(),
        "home": robot.home.tolist(),
        "shapes": _link_shapes(robot, packer, _moved_links(others)),
    }


def _moved_links(robots: Sequence[Robot]) -> set[str]:
    """Return the links that some joint of the arms moves."""
    return {
        link
        for robot in robots
        for link, joint in zip(robot.chain.capsule_links, robot.chain.capsule_joints, strict=True)
        if joint >= 0
    }


def _link_shapes(robot: Robot, packer: Packer, elsewhere: set[str]) -> list[dict[str, Any]]:
    """List meshes of the links, capsules of those that have none, column and mount."""
    meshes = [one for one in robot_meshes(robot) if one[0] not in elsewhere]
    fewer = decimate([Mesh(*rest) for _, _, *rest in meshes], _MOST_TRIANGLES)
    shapes = [
        {
            "kind": "mesh",
            "frame": joint,
            "role": "robot",
            "vertices": packer.add(mesh.vertices),
            "triangles": packer.add_indices(mesh.triangles),
        }
        for (_, joint, *_), mesh in zip(meshes, fewer, strict=True)
    ]
    meshed = {link for link, *_ in meshes} | {"tool", "pedestal"} | elsewhere
    chain = robot.chain
    for link, joint, ends, radius in zip(
        chain.capsule_links,
        chain.capsule_joints,
        chain.capsule_ends,
        chain.capsule_radii,
        strict=True,
    ):
        if link not in meshed:
            shapes.append(_capsule(ends, radius, int(joint), "robot"))
    radius, rod = pedestal_radius(robot), mount_rod(robot)
    if radius is not None:
        half = robot.base_height / 2
        pose = [0.0, 0.0, half, 1.0, 0.0, 0.0, 0.0]
        shapes.append(_shape("cylinder", [radius, half], WORLD, pose, "column"))
    if rod is not None:
        shapes.append(_capsule(*rod, robot.n - 1, "column"))
    return shapes


def tool_shapes(robot: Robot) -> list[dict[str, Any]]:
    """Describe the tool where no scene brings it: its capsule."""
    tool = robot.tool
    if tool.capsule_radius <= 0:
        return []
    flange = robot.chain.tip @ np.linalg.inv(tool.tcp2flange)
    ends = tool.capsule_ends @ flange[:3, :3].T + flange[:3, 3]
    return [_capsule(ends, tool.capsule_radius, robot.n - 1, "tool")]


def scene_shapes(robot: Robot, model: mujoco.MjModel) -> tuple[list[dict[str, Any]], list[int]]:
    """Describe what a task's scene holds beside the arm.

    Parameters
    ----------
    robot : Robot
        The arm.
    model : mujoco.MjModel
        The scene.

    Returns
    -------
    shapes : list of dict
        ``kind``, ``size`` (metres, as MuJoCo has it), ``frame`` (-1: the world, to n - 1: a joint
        of the arm, from n: one of the bodies), ``pose`` in it (position and quaternion wxyz) and
        ``role``: robot, column, tool, fixed or object.
    bodies : list of int
        Bodies of the model that move by themselves or on the tool.
    """
    geoms = scene_geoms(robot, model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    root = model.body_rootid[model.body(robot.joint_names[0]).id]
    joints = {model.body(name).id: at for at, name in enumerate(robot.joint_names)}
    bodies: list[int] = []
    shapes = []
    for geom, moves in zip(geoms.ids, geoms.moving, strict=True):
        kind, n = _PRIMITIVES.get(int(model.geom_type[geom]), ("", 0))
        if not kind:
            continue
        body = int(model.geom_bodyid[geom])
        # The body that it does not move against.
        anchor = int(model.body_weldid[body])
        if anchor == 0:
            frame = WORLD
        elif anchor in joints:
            frame = joints[anchor]
        else:
            if anchor not in bodies:
                bodies.append(anchor)
            frame = robot.n + bodies.index(anchor)
        of_arm = model.body_rootid[body] == root
        role = "object" if moves else "tool" if of_arm else "fixed"
        size = model.geom_size[geom][:n].tolist()
        shapes.append(_shape(kind, size, frame, _pose_in(data, anchor, geom), role))
    return shapes, bodies


def _pose_in(data: mujoco.MjData, body: int, geom: int) -> list[float]:
    """Return the pose of a geom in the frame of a body: position (m), quaternion wxyz."""
    turn = data.xmat[body].reshape(3, 3)
    place = turn.T @ (data.geom_xpos[geom] - data.xpos[body])
    quaternion = rotation_to_quaternion(turn.T @ data.geom_xmat[geom].reshape(3, 3))
    rounded: list[float] = np.round([*place, *quaternion], 6).tolist()
    return rounded


def _capsule(ends: FloatArray, radius: float, frame: int, role: str) -> dict[str, Any]:
    """Describe a capsule by the ends (2, 3) of its axis, metres."""
    way = ends[1] - ends[0]
    length = float(np.linalg.norm(way))
    z = way / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    quaternion = rotation_to_quaternion(np.stack([x, np.cross(z, x), z], axis=1))
    pose = np.round([*ends.mean(axis=0), *quaternion], 6).tolist()
    return _shape("capsule", [float(radius), length / 2], frame, pose, role)


def _shape(
    kind: str, size: list[float], frame: int, pose: list[float], role: str
) -> dict[str, Any]:
    return {"kind": kind, "size": size, "frame": frame, "pose": pose, "role": role}
