"""Where the surfaces of two links come near each other: which triangles, which capsules' parts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.robot.files.link_pieces import Surface, owners, whole_surface
from besman.robot.files.touching_links import PartsMeet
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Side = tuple[int, FloatArray, IntArray]

# Of one pose; a contact is of two triangles.
_MOST_CONTACTS = 20_000


def meeting_triangles(
    model: Any, first: Side, second: Side, poses: FloatArray, margin_m: float
) -> IntArray:
    """Find the triangles of two links that come within a margin of each other in any pose.

    Parameters
    ----------
    model : pinocchio.Model
        The arm.
    first, second : (joint, vertices, triangles)
        Joint that moves the link (-1: none), vertices (V, 3) in its frame, metres, triangles
        (F, 3).
    poses : array, shape (B, n)
        Joint angles, rad.
    margin_m : float

    Returns
    -------
    int array, shape (K, 2)
        Triangles of the first and of the second link, each pair once, sorted.
    """
    import coal

    request = coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, _MOST_CONTACTS)
    request.security_margin = margin_m
    shapes = [surface_mesh(vertices, triangles) for _, vertices, triangles in (first, second)]
    found = np.empty(0, np.int64)
    count = len(second[2])
    for places in zip(*(_places(model, side[0], poses) for side in (first, second)), strict=True):
        result = coal.CollisionResult()
        coal.collide(shapes[0], places[0], shapes[1], places[1], request, result)
        met = [one.b1 * count + one.b2 for one in result.getContacts()]
        found = np.union1d(found, np.array(met, np.int64))
    return np.stack(np.divmod(found, count), axis=1)


def surfaces_meet(
    model: Any, first: Side, second: Side, poses: FloatArray, margin_m: float
) -> bool:
    """Tell whether two surfaces come within a margin of each other in any pose.

    Parameters
    ----------
    model, first, second, poses, margin_m
        As in `meeting_triangles`.
    """
    import coal

    request = coal.CollisionRequest()
    request.security_margin = margin_m
    shapes = [surface_mesh(vertices, triangles) for _, vertices, triangles in (first, second)]
    places = zip(*(_places(model, side[0], poses) for side in (first, second)), strict=True)
    return any(
        coal.collide(shapes[0], one, shapes[1], other, request, coal.CollisionResult())
        for one, other in places
    )


def parts_contacts(robot: Robot, surfaces: Sequence[Surface]) -> PartsMeet:
    """Return what holds the surfaces against each other that capsules of an arm enclose.

    Every triangle belongs to one capsule that encloses it, so that links touch where two of these
    surfaces do.

    Parameters
    ----------
    robot : Robot
        With its capsules.
    surfaces : sequence of (link, joint, vertices, triangles)
        As from `besman.robot.link_shapes.link_surfaces`.
    """
    chain = robot.chain
    names = np.array(chain.capsule_links)
    known: dict[str, tuple[FloatArray, IntArray, IntArray]] = {}

    def part(capsule: int) -> Side:
        name = chain.capsule_links[capsule]
        mine = np.flatnonzero(names == name)
        if name not in known:
            vertices, triangles = whole_surface(name, surfaces)
            held = [(chain.capsule_ends[at], float(chain.capsule_radii[at])) for at in mine]
            known[name] = (vertices, triangles, mine[owners(held, vertices, triangles)])
        vertices, triangles, owner = known[name]
        own = triangles[owner == capsule]
        used, inverse = np.unique(own, return_inverse=True)
        return int(chain.capsule_joints[capsule]), vertices[used], inverse.reshape(own.shape)

    def meet(first: int, second: int, poses: FloatArray, margin_m: float) -> bool:
        with_surface = {link for link, _, _, triangles in surfaces if len(triangles)}
        if not {chain.capsule_links[first], chain.capsule_links[second]} <= with_surface:
            return True
        sides = part(first), part(second)
        # A capsule that others stand in for holds nothing.
        return all(len(side[2]) for side in sides) and surfaces_meet(
            robot.model, *sides, poses, margin_m
        )

    return meet


def surface_mesh(vertices: FloatArray, triangles: IntArray) -> Any:
    """Return a surface for coal."""
    import coal

    mesh = coal.BVHModelOBBRSS()
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
