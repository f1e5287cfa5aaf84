"""The shapes of an arm's links: meshes and primitives of the URDF, and capsules around them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio

from besman.exceptions import RobotError, in_one_line, nearest
from besman.robot.capsules import fit_capsule, fit_capsules
from besman.robot.config import RobotConfig
from besman.robot.urdf_file import text_for_model

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_CORNERS = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, 8).T
# Primitives of a link that get capsules of their own; more are enclosed together.
_MOST_SHAPES = 3


def link_capsules(
    model: Any,
    config: RobotConfig,
    tree: ElementTree.Element,
    urdf: Path,
    path: Path,
    progress: Callable[[float], None] = lambda share: None,
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
    progress : callable, optional
        Is told the share that is fitted.

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
    by_link: dict[tuple[str, int], list[tuple[Any, Any, bool]]] = {}
    for link, joint, *shape in collision_shapes(model, tree, urdf):
        by_link.setdefault((link, joint), []).append((shape[0], shape[1], shape[2]))
    found = []
    for index, ((link, joint), shapes) in enumerate(by_link.items()):
        found += [(link, joint, ends, radius) for ends, radius in _enclose(shapes)]
        progress((index + 1) / len(by_link))
    return found


def _enclose(shapes: list[tuple[Any, Any, bool]]) -> list[tuple[FloatArray, float]]:
    """Return the capsules around the shapes of a link: few, whatever it is made of."""
    if len(shapes) <= _MOST_SHAPES and not any(_is_mesh(shape) for _, shape, _ in shapes):
        return [one for pose, shape, _ in shapes for one in _enclose_primitive(shape, pose)]
    vertices, triangles, count = [], [], 0
    for pose, shape, mirrored in shapes:
        corners, faces = (
            _mesh(shape, pose, mirrored) if _is_mesh(shape) else _primitive_mesh(shape, pose)
        )
        vertices.append(corners)
        triangles.append(faces + count)
        count += len(corners)
    faces = np.vstack(triangles)
    return fit_capsules(np.vstack(vertices), faces) if len(faces) else []


def _is_mesh(geometry: Any) -> bool:
    """Tell whether a shape is a mesh."""
    return hasattr(geometry, "tri_indices")


def _primitive_mesh(geometry: Any, pose: Any) -> tuple[FloatArray, IntArray]:
    """Return a hull around a box, or around the capsules that enclose any other primitive."""
    if hasattr(geometry, "halfSide"):
        corners = _CORNERS * np.asarray(geometry.halfSide) @ pose.rotation.T + pose.translation
    else:
        # A cube around the ball at each end.
        balls = _enclose_primitive(geometry, pose)
        corners = np.vstack(
            [np.zeros((0, 3)), *(end + radius * _CORNERS for ends, radius in balls for end in ends)]
        )
    if not len(corners):
        return corners, np.empty((0, 3), np.int64)
    from scipy.spatial import ConvexHull

    return corners, ConvexHull(corners).simplices.astype(np.int64)


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
        for link, joint, placed, geometry, mirrored in collision_shapes(model, tree, urdf)
        if _is_mesh(geometry)
    ]


def collision_shapes(
    model: Any, tree: ElementTree.Element, urdf: Path
) -> list[tuple[str, int, Any, Any, bool]]:
    """List the collision shapes of a URDF.

    Parameters
    ----------
    model, tree, urdf
        As in `link_capsules`.

    Returns
    -------
    list of (link, joint, pose, geometry, mirrored)
        Joint that moves the link (-1: none), pose in that joint's frame, the shape for coal, and
        whether its scale mirrors it.

    Raises
    ------
    RobotError
        If a mesh cannot be read.
    """
    text = text_for_model(tree)
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
    return vertices @ pose.rotation.T + pose.translation, triangles[:, :: -1 if mirrored else 1]


def _enclose_primitive(geometry: Any, pose: Any) -> list[tuple[FloatArray, float]]:
    """Return the capsule around a sphere, cylinder or box; nothing for any other shape."""
    if hasattr(geometry, "halfSide"):
        placed = _CORNERS * np.asarray(geometry.halfSide) @ pose.rotation.T + pose.translation
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
