"""The shapes of an arm's links: meshes and primitives of the URDF, and capsules around them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio

from besman.exceptions import RobotError, in_one_line, nearest
from besman.robot.capsules import distances_to_axis, fill_sphere, fit_capsule, fit_capsules
from besman.robot.config import RobotConfig
from besman.robot.mesh_reader import MeshReader, triangles_of
from besman.robot.urdf_file import text_for_model

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_CORNERS = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, 8).T
# Primitives of a link that get capsules of their own; more are enclosed together.
LARGEST_M = 20.0
"""No link is wider: a mesh that is was drawn in millimetres, or is a hall."""

_MOST_SHAPES = 4
_ROUNDING_M = 1e-6
# Round shapes as polyhedra.
_SIDES = 24
_BALL_POINTS = 150


def link_capsules(
    model: Any,
    config: RobotConfig,
    tree: ElementTree.Element,
    urdf: Path,
    path: Path,
    progress: Callable[[float], None] = lambda share: None,
    reader: MeshReader | None = None,
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
    reader : MeshReader, optional
        Reads the meshes.

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
    for link, joint, *shape in collision_shapes(model, tree, urdf, reader):
        by_link.setdefault((link, joint), []).append((shape[0], shape[1], shape[2]))
    found = []
    for index, ((link, joint), shapes) in enumerate(by_link.items()):
        found += [(link, joint, ends, radius) for ends, radius in _enclose(shapes)]
        progress((index + 1) / len(by_link))
    return found


def _enclose(shapes: list[tuple[Any, Any, bool]]) -> list[tuple[FloatArray, float]]:
    """Return the capsules around the shapes of a link: few, whatever it is made of."""
    if not any(_is_mesh(shape) for _, shape, _ in shapes):
        single = [one for pose, shape, _ in shapes for one in _enclose_primitive(shape, pose)]
        single = _without_contained(single)
        if len(single) <= _MOST_SHAPES:
            return single
    vertices, triangles = _joined([_surface(*shape) for shape in shapes])
    return fit_capsules(vertices, triangles) if len(triangles) else []


def _without_contained(
    capsules: list[tuple[FloatArray, float]],
) -> list[tuple[FloatArray, float]]:
    """Leave out capsules that lie wholly in another: balls at the ends of a cylinder."""
    kept: list[tuple[FloatArray, float]] = []
    for ends, radius in sorted(capsules, key=lambda one: -one[1]):
        inside = (
            np.max(distances_to_axis(ends, other)) + radius <= wider + _ROUNDING_M
            for other, wider in kept
        )
        if not any(inside):
            kept = [
                (other, wider)
                for other, wider in kept
                if np.max(distances_to_axis(other, ends)) + wider > radius + _ROUNDING_M
            ]
            kept.append((ends, radius))
    return kept


def _joined(
    surfaces: list[tuple[FloatArray, IntArray]],
) -> tuple[FloatArray, IntArray]:
    """Make one mesh of several."""
    starts = np.cumsum([0, *(len(corners) for corners, _ in surfaces)])
    faces = [triangles + start for (_, triangles), start in zip(surfaces, starts, strict=False)]
    return np.vstack([corners for corners, _ in surfaces]), np.vstack(faces)


def _surface(pose: Any, shape: Any, mirrored: bool) -> tuple[FloatArray, IntArray]:
    """Return the triangles of a shape, a polyhedron around it if it is a round one."""
    return _mesh(shape, pose, mirrored) if _is_mesh(shape) else _primitive_mesh(shape, pose)


def _is_mesh(geometry: Any) -> bool:
    """Tell whether a shape is a mesh."""
    return hasattr(geometry, "tri_indices")


def _primitive_mesh(geometry: Any, pose: Any) -> tuple[FloatArray, IntArray]:
    """Return a polyhedron around a box, cylinder, sphere or capsule; nothing for other shapes."""
    corners = _corners(geometry)
    if not len(corners):
        return corners, np.empty((0, 3), np.int64)
    from scipy.spatial import ConvexHull

    # As wide as high: which corners make a triangle does not depend on it, and Qhull's errors do.
    triangles = ConvexHull(corners / np.ptp(corners, axis=0)).simplices.astype(np.int64)
    return corners @ pose.rotation.T + pose.translation, triangles


def _corners(geometry: Any) -> FloatArray:
    """Return points whose hull is a little larger than a primitive, in its own frame, metres."""
    if hasattr(geometry, "halfSide"):
        box: FloatArray = _CORNERS * np.maximum(geometry.halfSide, _ROUNDING_M)
        return box
    if not hasattr(geometry, "radius"):
        return np.zeros((0, 3))
    # What has no thickness would have no hull.
    half, radius = float(getattr(geometry, "halfLength", 0.0)), float(geometry.radius)
    radius = max(radius, _ROUNDING_M)
    ends = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])
    if type(geometry).__name__ in ("Cylinder", "Cone"):
        half = max(half, _ROUNDING_M)
        ends[:, 2] = -half, half
        turn = 2 * np.pi * np.arange(_SIDES) / _SIDES
        rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        rim *= radius / np.cos(np.pi / _SIDES)
        return np.vstack([rim + end for end in ends])
    from scipy.spatial import ConvexHull

    ball = fill_sphere(_BALL_POINTS)
    # The nearest face of their hull shall touch the sphere.
    ball *= radius / float(-ConvexHull(ball).equations[:, 3].max())
    return np.vstack([ball + end for end in ends])


def link_surfaces(
    shapes: Sequence[tuple[str, int, Any, Any, bool]],
) -> list[tuple[str, int, FloatArray, IntArray]]:
    """List the surfaces of collision shapes, primitives as polyhedra around them.

    Parameters
    ----------
    shapes : sequence of (link, joint, pose, geometry, mirrored)
        From `collision_shapes`.

    Returns
    -------
    list of (link, joint, vertices, triangles)
        As from `link_meshes`.
    """
    return [
        (link, joint, *_surface(placed, geometry, mirrored))
        for link, joint, placed, geometry, mirrored in shapes
    ]


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
    model: Any,
    tree: ElementTree.Element,
    urdf: Path,
    reader: MeshReader | None = None,
    left_out: list[str] | None = None,
) -> list[tuple[str, int, Any, Any, bool]]:
    """List the collision shapes of a URDF, but meshes that are wider than any arm.

    Parameters
    ----------
    model, tree, urdf
        As in `link_capsules`.
    reader : MeshReader, optional
        Reads each mesh once.
    left_out : list of str, optional
        The meshes that are too wide are added to it.

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
        kind = pinocchio.GeometryType.COLLISION
        keep = {} if reader is None else {"mesh_loader": reader.loader}
        shapes = pinocchio.buildGeomFromUrdfString(plain, text, kind, **keep)
    except (ValueError, RuntimeError) as error:
        raise RobotError(f"{urdf}: collision meshes: {in_one_line(error)}") from None
    found = []
    for item in shapes.geometryObjects:
        if hasattr(item.geometry, "halfSide") and not np.any(item.geometry.halfSide):
            # A box of no size stands for no shape.
            continue
        link = plain.frames[item.parentFrame]
        frame = model.frames[model.getFrameId(link.name, pinocchio.FrameType.BODY)]
        pose = frame.placement * link.placement.actInv(item.placement)
        mirrored = bool(np.prod(item.meshScale) < 0)
        is_mesh = _is_mesh(item.geometry)
        if is_mesh and np.ptp(item.geometry.vertices(), axis=0).max() > LARGEST_M:
            if left_out is not None:
                left_out.append(str(item.meshPath))
            continue
        shape = reader.same(item) if is_mesh and reader is not None else item.geometry
        found.append((link.name, frame.parentJoint - 1, pose, shape, mirrored))
    return found


def _mesh(geometry: Any, pose: Any, mirrored: bool) -> tuple[FloatArray, IntArray]:
    """Return vertices (V, 3) in the joint's frame, metres, and triangles (F, 3)."""
    # Pinocchio has scaled the vertices already: ``meshScale`` is what it scaled them by.
    vertices = np.asarray(geometry.vertices())
    triangles = triangles_of(geometry)
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
