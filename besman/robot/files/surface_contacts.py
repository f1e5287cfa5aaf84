"""Where the surfaces of two links come near each other: which regions, which capsules' parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.robot.files.link_pieces import Surface, whole_surface
from besman.robot.files.touching_links import PartsMeet
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Side = tuple[int, FloatArray, IntArray]
Placed = tuple[int, Any]

# Of one pose; a contact is of two triangles.
_MOST_CONTACTS = 20_000


def meeting_regions(
    model: Any,
    sides: tuple[Side, Side],
    labels: Sequence[IntArray],
    poses: FloatArray,
    margin_m: float,
    enough: int,
) -> BoolArray:
    """Find the regions of two links that come within a margin of each other in any pose.

    Parameters
    ----------
    model : pinocchio.Model
        The arm.
    sides : two of (joint, vertices, triangles)
        Joint that moves the link (-1: none), vertices (V, 3) in its frame, metres, triangles
        (F, 3).
    labels : two int arrays, shape (F,)
        Region of each triangle, from 0.
    poses : array, shape (B, n)
        Joint angles, rad.
    margin_m : float
    enough : int
        After so many poses in which they do no further ones are looked at.

    Returns
    -------
    bool array, shape (R, S)
        Which regions of the first come near which of the second link.
    """
    import coal

    request = coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, _MOST_CONTACTS)
    request.security_margin = margin_m
    shapes = [surface_mesh(*side[1:]) for side in sides]
    found = np.zeros([int(label.max(initial=0)) + 1 for label in labels], dtype=np.bool_)
    for places in zip(*(_places(model, side[0], poses) for side in sides), strict=True):
        result = coal.CollisionResult()
        coal.collide(shapes[0], places[0], shapes[1], places[1], request, result)
        met = [(one.b1, one.b2) for one in result.getContacts()]
        if met:
            first, second = np.array(met).T
            found[labels[0][first], labels[1][second]] = True
            enough -= 1
        if enough <= 0:
            break
    return found


def surfaces_meet(
    model: Any, sides: tuple[Placed, Placed], poses: FloatArray, margin_m: float
) -> bool:
    """Tell whether two surfaces come within a margin of each other in any pose.

    Parameters
    ----------
    model, poses, margin_m
        As in `meeting_regions`.
    sides : two of (joint, surface)
        Joint that moves the surface (-1: none), and that from `surface_mesh`.
    """
    import coal

    request = coal.CollisionRequest()
    request.security_margin = margin_m
    (_, one), (_, other) = sides
    places = zip(*(_places(model, joint, poses) for joint, _ in sides), strict=True)
    return any(
        coal.collide(one, here, other, there, request, coal.CollisionResult())
        for here, there in places
    )


def parts_contacts(
    robot: Robot, surfaces: Sequence[Surface], owners: Mapping[str, IntArray]
) -> PartsMeet:
    """Return what holds the surfaces against each other that capsules of an arm enclose.

    Every triangle belongs to one capsule that encloses it, so that links touch where two of these
    surfaces do.

    Parameters
    ----------
    robot : Robot
        With its capsules.
    surfaces : sequence of (link, joint, vertices, triangles)
        As from `besman.robot.link_shapes.link_surfaces`.
    owners : mapping of array, shape (F,)
        Which of a link's capsules holds each triangle of its `whole_surface`, by name.
    """
    chain = robot.chain
    names = np.array(chain.capsule_links)
    known: dict[str, tuple[FloatArray, IntArray, IntArray]] = {}
    built: dict[int, Placed | None] = {}

    def build(capsule: int) -> Placed | None:
        name = chain.capsule_links[capsule]
        if name not in known:
            mine = np.flatnonzero(names == name)
            known[name] = (*whole_surface(name, surfaces), mine[owners[name]])
        vertices, triangles, owner = known[name]
        own = triangles[owner == capsule]
        # A capsule that others stand in for holds nothing.
        if not len(own):
            return None
        used, inverse = np.unique(own, return_inverse=True)
        mesh = surface_mesh(vertices[used], inverse.reshape(own.shape))
        return int(chain.capsule_joints[capsule]), mesh

    def meet(first: int, second: int, poses: FloatArray, margin_m: float) -> bool:
        if not {chain.capsule_links[first], chain.capsule_links[second]} <= set(owners):
            return True
        for capsule in (first, second):
            if capsule not in built:
                built[capsule] = build(capsule)
        one, other = built[first], built[second]
        if one is None or other is None:
            return False
        return surfaces_meet(robot.model, (one, other), poses, margin_m)

    return meet


def surface_mesh(vertices: FloatArray, triangles: IntArray) -> Any:
    """Return a surface for coal."""
    import coal

    mesh = coal.BVHModelOBB()
    mesh.beginModel(len(triangles), len(vertices))
    mesh.addVertices(np.ascontiguousarray(vertices))
    mesh.addTriangles(np.ascontiguousarray(triangles))
    mesh.endModel()
    return mesh


def _places(model: Any, joint: int, poses: FloatArray) -> list[Any]:
    """Return where a joint's frame is in every pose, for coal."""
    import coal
    import pinocchio

    data, found = model.createData(), []
    for pose in poses:
        pinocchio.forwardKinematics(model, data, pose)
        place = data.oMi[joint + 1]
        found.append(coal.Transform3s(place.rotation, place.translation))
    return found
