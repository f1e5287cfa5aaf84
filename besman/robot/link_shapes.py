"""The shapes of an arm's links: meshes and primitives of the URDF, and capsules around them."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio

from besman.exceptions import RobotError, in_one_line, nearest
from besman.robot.capsules import fit_capsule, fit_capsules
from besman.robot.config import RobotConfig

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def link_capsules(
    model: Any, config: RobotConfig, tree: ElementTree.Element, urdf: Path, path: Path
) -> list[tuple[str, int, FloatArray, float]]:
    """List the capsules of the links: the config's, or else fitted to the URDF's shapes.

    Parameters
    ----------
    model : pinocchio.Model
        The mounted arm.
    config : RobotConfig
        With the capsules, if any.
    tree : Element
        The URDF, from `besman.robot.urdf_file.read_urdf`.
    urdf, path : Path
        The URDF and the robot.yaml, named in errors.

    Returns
    -------
    list of (link, joint, ends, radius)
        Joint that moves the link (-1: none), ends (2, 3) in that joint's frame, metres.

    Raises
    ------
    RobotError
        If a link is not there, or a mesh cannot be read.
    """
    if config.capsules:
        return [_from_config(model, capsule, path) for capsule in config.capsules]
    found = []
    for link, joint, placed, geometry, mirrored in _collision_shapes(model, tree, urdf):
        if hasattr(geometry, "tri_indices"):
            capsules = fit_capsules(*_mesh(geometry, placed, mirrored))
        else:
            capsules = _enclose_primitive(geometry, placed)
        found += [(link, joint, ends, radius) for ends, radius in capsules]
    return found


def link_meshes(
    model: Any, tree: ElementTree.Element, urdf: Path
) -> list[tuple[str, int, FloatArray, IntArray]]:
    """Read the collision meshes of the links.

    Parameters
    ----------
    model, tree, urdf
        As in `link_capsules`.

    Returns
    -------
    list of (link, joint, vertices, triangles)
        Vertices (V, 3) in the frame of the joint that moves the link (-1: in the world), metres;
        triangles (F, 3) index them.
    """
    return [
        (link, joint, *_mesh(geometry, placed, mirrored))
        for link, joint, placed, geometry, mirrored in _collision_shapes(model, tree, urdf)
        if hasattr(geometry, "tri_indices")
    ]


def _collision_shapes(
    model: Any, tree: ElementTree.Element, urdf: Path
) -> list[tuple[str, int, Any, Any, bool]]:
    """List link, joint, pose in the joint's frame, geometry of every collision shape.

    Last is whether its scale mirrors it.
    """
    text = ElementTree.tostring(tree, encoding="unicode")
    try:
        plain = pinocchio.buildModelFromXML(text)
        shapes = pinocchio.buildGeomFromUrdfString(plain, text, pinocchio.GeometryType.COLLISION)
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"{urdf}: collision meshes: {in_one_line(error)}") from None
    found = []
    for item in shapes.geometryObjects:
        link = plain.frames[item.parentFrame]
        frame = model.frames[model.getFrameId(link.name, pinocchio.FrameType.BODY)]
        pose = frame.placement * link.placement.actInv(item.placement)
        mirrored = bool(np.prod(item.meshScale) < 0)
        found.append((link.name, frame.parentJoint - 1, pose, item.geometry, mirrored))
    return found


def _mesh(geometry: Any, pose: Any, mirrored: bool) -> tuple[FloatArray, IntArray]:
    """Return vertices (V, 3) in the joint's frame, metres, and triangles (F, 3)."""
    # Pinocchio has scaled the vertices already: ``meshScale`` is what it scaled them by.
    vertices = np.asarray(geometry.vertices())
    faces = [geometry.tri_indices(face) for face in range(geometry.num_tris)]
    triangles = np.array([[face[corner] for corner in range(3)] for face in faces], np.int64)
    # In a mirror, triangles that are counted anticlockwise from outside are so from inside.
    return vertices @ pose.rotation.T + pose.translation, triangles[:, ::-1 if mirrored else 1]


def _enclose_primitive(geometry: Any, pose: Any) -> list[tuple[FloatArray, float]]:
    """Return the capsule around a sphere, cylinder or box; nothing for any other shape."""
    if hasattr(geometry, "halfSide"):
        corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
        placed = corners * np.asarray(geometry.halfSide) @ pose.rotation.T + pose.translation
        return [fit_capsule(placed)]
    if not hasattr(geometry, "radius"):
        return []
    half = float(getattr(geometry, "halfLength", 0.0))
    axis = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])
    return [(axis @ pose.rotation.T + pose.translation, float(geometry.radius))]


def _from_config(model: Any, capsule: Any, path: Path) -> tuple[str, int, FloatArray, float]:
    """Bring a capsule of the config into the frame of the joint that moves it."""
    link = capsule.link
    if not model.existFrame(link, pinocchio.FrameType.BODY):
        links = [frame.name for frame in model.frames if frame.type == pinocchio.FrameType.BODY]
        raise RobotError(f"{path}: capsules: no link {link!r}; {nearest(link, links)}")
    frame = model.frames[model.getFrameId(link, pinocchio.FrameType.BODY)]
    ends = np.array(capsule.ends_m) @ frame.placement.rotation.T + frame.placement.translation
    return link, frame.parentJoint - 1, ends, capsule.radius_m
