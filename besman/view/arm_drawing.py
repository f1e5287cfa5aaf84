"""An arm at rest, drawn from its meshes: what is in front hides what is behind."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from besman.pictures.arm_visuals import mount_rod, pedestal_radius, robot_meshes
from besman.records import FloatArray
from besman.robot.model import Robot
from besman.view.decimation import IntArray, Mesh, decimate

_MOST_TRIANGLES = 5000
_AROUND, _RINGS = 12, 4
_LIGHT = np.array([0.35, -0.45, 0.82])
_DARKEST = 0.45
ARM, MOUNT, TOOL = (0.62, 0.68, 0.76), (0.45, 0.48, 0.52), (0.0, 0.45, 0.70)
"""Colours, red, green and blue from 0 to 1."""


class ArmSurface(NamedTuple):
    """An arm in one pose.

    Attributes
    ----------
    triangles : array, shape (F, 3, 3)
        Corners in the world, metres, counter-clockwise seen from outside.
    colours : array, shape (F, 3)
        Before any light.
    """

    triangles: FloatArray
    colours: FloatArray


def arm_surface(robot: Robot, pose: FloatArray) -> ArmSurface:
    """Place the meshes of an arm, capsules where a link has none, its column and its tool.

    Parameters
    ----------
    robot : Robot
    pose : array, shape (n,)
        rad.
    """
    import pinocchio

    data = robot.model.createData()
    pinocchio.forwardKinematics(robot.model, data, np.asarray(pose))
    parts = []
    meshes = _link_meshes(robot)
    parts += [(joint, mesh, ARM) for _, joint, mesh in meshes]
    meshed = {link for link, *_ in meshes}
    chain = robot.chain
    for link, joint, ends, radius in zip(
        chain.capsule_links,
        chain.capsule_joints,
        chain.capsule_ends,
        chain.capsule_radii,
        strict=True,
    ):
        if link not in meshed and link != "pedestal":
            colour = TOOL if link == "tool" else ARM
            parts.append((int(joint), capsule_mesh(ends, float(radius)), colour))
    rod, radius = mount_rod(robot), pedestal_radius(robot)
    if rod is not None:
        parts.append((robot.n - 1, capsule_mesh(*rod), MOUNT))
    if radius is not None:
        column = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, robot.base_height]])
        parts.append((-1, capsule_mesh(column, radius, flat=True), MOUNT))
    placed = [_place(data, joint, mesh) for joint, mesh, _ in parts]
    colours = [np.tile(colour, (len(mesh.triangles), 1)) for _, mesh, colour in parts]
    return ArmSurface(np.concatenate(placed), np.concatenate(colours))


@lru_cache(maxsize=4)
def _link_meshes(robot: Robot) -> tuple[tuple[str, int, Mesh], ...]:
    """Return link, joint and mesh of an arm's links that have one, with so few triangles as drawn.

    Kept, because a page draws an arm in several poses.
    """
    meshes = robot_meshes(robot)
    fewer = decimate([Mesh(*rest) for _, _, *rest in meshes], _MOST_TRIANGLES)
    return tuple((link, at, mesh) for (link, at, *_), mesh in zip(meshes, fewer, strict=True))


def _place(data: Any, joint: int, mesh: Mesh) -> FloatArray:
    """Return the triangles of a mesh in the world, shape (F, 3, 3)."""
    vertices = mesh.vertices
    if joint >= 0:
        pose = data.oMi[joint + 1]
        vertices = vertices @ pose.rotation.T + pose.translation
    placed: FloatArray = vertices[mesh.triangles]
    return placed


def capsule_mesh(ends: FloatArray, radius: float, flat: bool = False) -> Mesh:
    """Return a mesh of a capsule.

    Parameters
    ----------
    ends : array, shape (2, 3)
        Of its axis, metres.
    radius : float
        Metres.
    flat : bool
        A cylinder in its place.
    """
    axis = ends[1] - ends[0]
    length = float(np.linalg.norm(axis))
    z = axis / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [1.0, 0.0, 0.0], z)
    x /= np.linalg.norm(x)
    around = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    circle = np.outer(np.cos(around), x) + np.outer(np.sin(around), np.cross(z, x))
    bows = np.linspace(0.0, np.pi / 2, _RINGS + 1)
    rises = np.zeros_like(bows) if flat else np.sin(bows)
    widths = np.cos(bows)
    lower = [ends[0] - radius * rise * z + radius * wide * circle
             for rise, wide in zip(rises[::-1], widths[::-1], strict=True)]  # fmt: skip
    upper = [ends[1] + radius * rise * z + radius * wide * circle
             for rise, wide in zip(rises, widths, strict=True)]  # fmt: skip
    rings = np.array([*lower, *upper])
    return Mesh(rings.reshape(-1, 3), _ring_triangles(len(rings)))


def _ring_triangles(rings: int) -> IntArray:
    """Join rings of corners by triangles, shape (F, 3)."""
    corner = np.arange(_AROUND)
    after = (corner + 1) % _AROUND
    found = []
    for ring in range(rings - 1):
        low, high = ring * _AROUND, (ring + 1) * _AROUND
        found.append(np.stack([low + corner, low + after, high + after], axis=1))
        found.append(np.stack([low + corner, high + after, high + corner], axis=1))
    return np.concatenate(found).astype(np.int64)


def project(surface: ArmSurface, towards: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Look at an arm from a direction, the nearest last.

    Parameters
    ----------
    surface : ArmSurface
    towards : array, shape (3,)
        From where the eye looks, horizontal or not, to the arm; not vertical.

    Returns
    -------
    corners : array, shape (F, 3, 2)
        Rightwards and upwards in the picture, metres.
    colours : array, shape (F, 3)
        In the light.
    """
    ahead = np.asarray(towards, dtype=np.float64)
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    triangles = surface.triangles
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(normals, axis=1)
    # Meshes of any origin: a surface that is turned inside out is seen from both sides.
    seen = size > 1e-12
    normals = normals[seen] / size[seen, None]
    away = normals @ ahead
    normals[away > 0] *= -1
    light = _LIGHT / np.linalg.norm(_LIGHT)
    bright = _DARKEST + (1.0 - _DARKEST) * np.clip(normals @ light * 0.6 + 0.4, 0.0, 1.0)
    colours = surface.colours[seen] * bright[:, None]
    order = np.argsort(-(triangles[seen].mean(axis=1) @ ahead), kind="stable")
    corners = np.stack([triangles[seen] @ right, triangles[seen] @ up], axis=-1)
    return corners[order], np.clip(colours[order], 0.0, 1.0)
