"""Room that an arm has beside itself: capsules split, and pairs left out that say nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from besman.robot.files import fitted_shapes
from besman.robot.files.surface_contacts import parts_contacts
from besman.robot.files.touching_links import (
    MeshesTouch,
    always_overlapping,
    find_ignored_pairs,
    mesh_contacts,
    random_poses,
)
from besman.robot.link_shapes import collision_shapes, link_surfaces
from besman.robot.mesh_reader import MeshReader
from besman.robot.model import Robot

_NEAR_M = 0.01
_LOOKED_POSES = 200


def leave_room(
    content: dict[str, Any],
    build: Callable[[], Robot],
    tree: ElementTree.Element,
    urdf: Path,
    reader: MeshReader,
    progress: Callable[[float], None],
) -> list[str]:
    """Split capsules that cost room, leave out pairs that say nothing.

    Parameters
    ----------
    content : dict
        Of a robot.yaml: its capsules and ignored pairs are written.
    build : callable
        Returns the arm of the content as it is then.
    tree, urdf
        Its URDF.
    reader : MeshReader
        Reads the meshes.
    progress : callable
        Is told the share done, up to three quarters.

    Returns
    -------
    list of str
        A line for each pair: why it is left out, or that it leaves no pose clear.
    """
    robot = build()
    shapes = collision_shapes(robot.model, tree, urdf, reader)
    contacts = mesh_contacts(robot.model, [one[:4] for one in shapes])
    surfaces = link_surfaces(shapes)
    content["capsules"], owners = fitted_shapes.carve(
        content["capsules"], robot, surfaces, contacts, lambda share: progress(0.5 * share)
    )
    robot = build()
    pairs, notes = find_ignored_pairs(robot, contacts, parts_contacts(robot, surfaces, owners))
    content["ignored_pairs"] = [list(pair) for pair in pairs]
    progress(0.75)
    return notes + _never_clear(build(), contacts)


def _never_clear(robot: Robot, contacts: MeshesTouch) -> list[str]:
    """Name the pairs of links that leave no pose clear, and tell whether their meshes do."""
    poses, said = random_poses(robot, _LOOKED_POSES), []
    for pair in always_overlapping(robot):
        if {"pedestal", "tool"} & set(pair):
            continue
        met = contacts(*pair, poses, _NEAR_M)
        why = "look at the origins and the scale of their meshes"
        if met is None or met[0] < met[1]:
            why = "their meshes do not; name the pair under ignored_pairs if it cannot touch"
        else:
            why = f"their meshes come within {100 * _NEAR_M:g} cm in every pose too: {why}"
        said.append(
            f"links {pair[0]}, {pair[1]}: their capsules overlap in every pose, so that none is "
            f"clear; {why}"
        )
    return said
