"""An arm as it looks: meshes of its links where there are some, else their capsules, on a floor."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from besman.config.yaml_file import load_config
from besman.pictures.camera import CameraView
from besman.robot.config import RobotConfig
from besman.robot.link_shapes import link_meshes
from besman.robot.model import Robot, find_robot, read_robot_urdf
from besman.robot.mujoco_model import arm_spec

FloatArray = npt.NDArray[np.float64]

HIDDEN_GROUP = 5
_EXTENT_M = 2.0
_ARM = [0.80, 0.83, 0.87, 1.0]
_PEDESTAL = [0.45, 0.48, 0.52, 1.0]
_FLOOR_M = 5.0
# The rod ends before the tool centre point, where things are held.
_ROD_M, _ROD_SHORT_M = 0.012, 0.04
# The light comes from above, left of who looks, so that shadows on the floor show heights.
_LIGHT_LEFT_DEG, _LIGHT_UP_DEG = 40.0, 60.0


def arm_visuals(robot: Robot, view: CameraView, width: int, height: int) -> mujoco.MjModel:
    """Build the model that pictures are drawn with: the arm alone, light, and a floor.

    Parameters
    ----------
    robot : Robot
        The arm.
    view : CameraView
        Where it is looked at from.
    width, height : int
        Greatest size of a picture, pixels.

    Returns
    -------
    mujoco.MjModel
        Joints are the arm's. Geoms of `HIDDEN_GROUP` are not to be drawn.
    """
    spec, _ = arm_spec(robot, 0.002)
    _set_quality(spec, width, height)
    meshes = robot_meshes(robot)
    meshed = {link for link, *_ in meshes}
    capsules = [geom for body in spec.bodies for geom in body.geoms]
    for link, geom in zip(_capsule_links(robot, spec), capsules, strict=True):
        hidden = link in meshed or link == "pedestal"
        geom.group, geom.rgba = (HIDDEN_GROUP if hidden else 0), _ARM
    for index, (_, joint, vertices, triangles) in enumerate(meshes):
        spec.add_mesh(
            name=f"mesh{index}",
            uservert=vertices.ravel(),
            userface=triangles.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        body = spec.worldbody if joint < 0 else spec.body(robot.joint_names[joint])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"mesh{index}", rgba=_ARM, mass=0.0)
    _add_mount(spec, robot)
    _add_pedestal(spec, robot)
    _add_room(spec, view)
    return spec.compile()


def _set_quality(spec: mujoco.MjSpec, width: int, height: int) -> None:
    """Choose what a picture costs: these are five times as fast as the defaults without a GPU."""
    quality, view = spec.visual.quality, spec.visual.global_
    quality.offsamples, quality.shadowsize = 0, 1024
    # The shadows' map covers the floor: at its edge there would be specks.
    spec.visual.map.shadowclip = 1.5 * _FLOOR_M / _EXTENT_M
    view.offwidth, view.offheight = width, height
    light = spec.visual.headlight
    light.ambient, light.diffuse, light.specular = [0.45] * 3, [0.35] * 3, [0.05] * 3
    spec.stat.extent, spec.stat.center = _EXTENT_M, [0.0, 0.0, 0.5]
    spec.visual.map.znear, spec.visual.map.zfar = 0.02, 50.0


def _capsule_links(robot: Robot, spec: mujoco.MjSpec) -> list[str]:
    """Return the link of every capsule of the arm, in the order of the bodies."""
    chain = robot.chain
    order = np.argsort(np.asarray(chain.capsule_joints), kind="stable")
    links = [chain.capsule_links[index] for index in order]
    return [link for link in links if link != "tool"]


def robot_meshes(robot: Robot) -> list[tuple[str, int, Any, Any]]:
    """Read the meshes of an arm's links; see `besman.robot.link_shapes.link_meshes`."""
    path = find_robot(robot.source)
    tree, urdf = read_robot_urdf(load_config(path, RobotConfig), path)
    return link_meshes(robot.model, tree, urdf)


def mount_rod(robot: Robot) -> tuple[FloatArray, float] | None:
    """Return the rod that joins the tool to the flange.

    Returns
    -------
    pair of array, shape (2, 3), and float, or None
        Ends in the last joint's frame and radius, metres; None where the tool is at the flange.
    """
    tip = robot.chain.tip
    flange = (tip @ np.linalg.inv(robot.tool.tcp2flange))[:3, 3]
    way = tip[:3, 3] - flange
    length = float(np.linalg.norm(way))
    if length <= 2 * _ROD_SHORT_M:
        return None
    return np.stack([flange, flange + way * (1.0 - _ROD_SHORT_M / length)]), _ROD_M


def pedestal_radius(robot: Robot) -> float | None:
    """Return the radius of the column below the base, metres; None where there is none."""
    links = list(robot.chain.capsule_links)
    if "pedestal" not in links or robot.base_height <= 0:
        return None
    return float(robot.chain.capsule_radii[links.index("pedestal")])


def _add_mount(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Join the tool, which stands in the task's scene, to the flange by a rod."""
    rod = mount_rod(robot)
    if rod is None:
        return
    spec.body(robot.joint_names[-1]).add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=rod[0].ravel(),
        size=[rod[1], 0.0, 0.0],
        rgba=_PEDESTAL,
        mass=0.0,
    )


def _add_pedestal(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Put the base on a column."""
    radius = pedestal_radius(robot)
    if radius is None:
        return
    half = robot.base_height / 2
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        pos=[0.0, 0.0, half],
        size=[radius, half, 0.0],
        rgba=_PEDESTAL,
    )


def _add_room(spec: mujoco.MjSpec, view: CameraView) -> None:
    """Add floor, sky and light."""
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.97, 0.98, 1.0],
        rgb2=[0.80, 0.84, 0.90],
        width=64,
        height=64 * 6,
    )
    spec.add_texture(
        name="floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.88, 0.89, 0.91],
        rgb2=[0.83, 0.84, 0.87],
        width=256,
        height=256,
    )
    # A square of the floor is half a metre wide.
    floor = spec.add_material(name="floor", texrepeat=[1.0, 1.0], texuniform=True)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"
    middle = np.array([view.centre[0], view.centre[1], 0.0])
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=middle,
        size=[_FLOOR_M, _FLOOR_M, 0.1],
        material="floor",
    )
    turn, up = np.radians(view.azimuth - _LIGHT_LEFT_DEG), np.radians(_LIGHT_UP_DEG)
    towards = np.array([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), -np.sin(up)])
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=middle - 6.0 * towards,
        dir=towards,
        diffuse=[0.55] * 3,
        specular=[0.1] * 3,
        castshadow=True,
    )
