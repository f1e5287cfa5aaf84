"""Capsules for a robot.yaml: fitted once, when an arm is brought in."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio

from besman.exceptions import RobotError
from besman.robot.config import RobotConfig
from besman.robot.files import carved_capsules
from besman.robot.files.link_pieces import Surface
from besman.robot.files.touching_links import MeshesTouch
from besman.robot.link_shapes import LARGEST_M, collision_shapes, link_capsules
from besman.robot.mesh_reader import MeshReader
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Capsules along links of which there is no shape: a share of the arm's length.
_SLENDERNESS = 0.06
_LEAST_LENGTH_M = 0.03
_SHORT = 0.1
_DIGITS = 4


def use_visual_shapes(tree: ElementTree.Element) -> list[str]:
    """Give links without collision shapes their visual ones; return these links."""
    found = []
    for link in tree.findall("link"):
        if link.find("collision") is None and link.find("visual") is not None:
            found.append(str(link.get("name")))
            for visual in link.findall("visual"):
                shape = ElementTree.SubElement(link, "collision")
                shape.extend([one for one in visual if one.tag in ("origin", "geometry")])
    return found


def fit_shapes(
    model: Any,
    config: RobotConfig,
    tree: ElementTree.Element,
    urdf: Path,
    path: Path,
    progress: Callable[[float], None],
    reader: MeshReader | None = None,
) -> tuple[list[dict[str, Any]], list[str]]:
    """Fit the capsules of a robot.yaml.

    Parameters
    ----------
    model : pinocchio.Model
        The mounted arm.
    config : RobotConfig
        Without capsules.
    tree, urdf, path
        The URDF; it loses the shapes whose meshes cannot be read. Paths are named in errors.
    progress : callable
        Is told the share that is done.
    reader : MeshReader, optional
        Reads the meshes.

    Returns
    -------
    capsules : list of dict
        Of a robot.yaml, in the frames of their links, rounded outwards.
    notes : list of str
        What could not be read, and what stands along links instead.
    """
    notes = []
    while True:
        try:
            capsules = link_capsules(model, config, tree, urdf, path, progress, reader)
            break
        except RobotError as error:
            bad = _drop_named_mesh(tree, str(error))
            if bad is None:
                raise
            notes.append(f"mesh {bad} cannot be read: the link has no shape of it")
    wide: list[str] = []
    collision_shapes(model, tree, urdf, reader, wide)
    notes += [
        f"mesh {one} is wider than {LARGEST_M:g} m, the link has no shape of it; expected metres, "
        'or scale="0.001 0.001 0.001" for millimetres'
        for one in dict.fromkeys(wide)
    ]
    bare = _along_links(model, config, {joint for _, joint, *_ in capsules})
    if bare:
        links = ", ".join(link for link, *_ in bare)
        notes.append(f"capsules along {links}: no shape is given")
    return [_in_link(model, *one) for one in [*capsules, *bare]], notes


def _drop_named_mesh(tree: ElementTree.Element, message: str) -> str | None:
    """Take away the shapes of the mesh that a message names; return its path."""
    named = {str(mesh.get("filename")) for mesh in tree.iterfind("link/collision/geometry/mesh")}
    bad = max((one for one in named if one in message), key=len, default=None)
    for link in tree.findall("link"):
        for shape in link.findall("collision"):
            if bad is not None and shape.find(f"geometry/mesh[@filename='{bad}']") is not None:
                link.remove(shape)
    return bad


def _along_links(
    model: Any, config: RobotConfig, covered: set[int]
) -> list[tuple[str, int, FloatArray, float]]:
    """Return a capsule from each joint to the next where nothing encloses what it moves."""
    ends = [place.translation for place in list(model.jointPlacements)[2:]]
    tip = model.frames[model.getFrameId(config.tip, pinocchio.FrameType.BODY)]
    ends.append(tip.placement.translation)
    lengths = [float(np.linalg.norm(end)) for end in ends]
    whole = max(sum(lengths), _LEAST_LENGTH_M)
    radius = _SLENDERNESS * whole
    # Joints that nearly cross have no link of their own between them.
    shortest = max(_SHORT * whole, _LEAST_LENGTH_M)
    found = []
    for joint, (end, length) in enumerate(zip(ends, lengths, strict=True)):
        link = moved_link(model, joint)
        if joint not in covered and length >= shortest and link is not None:
            found.append((link, joint, np.stack([np.zeros(3), end]), min(radius, length / 2)))
    return found


def moved_link(model: Any, joint: int) -> str | None:
    """Return the first link that a joint moves."""
    for frame in model.frames:
        if frame.type == pinocchio.FrameType.BODY and frame.parentJoint == joint + 1:
            return str(frame.name)
    return None


def _in_link(model: Any, link: str, joint: int, ends: FloatArray, radius: float) -> dict[str, Any]:
    """Return a capsule in its link's frame, rounded outwards."""
    frame = model.frames[model.getFrameId(link, pinocchio.FrameType.BODY)]
    placed = (ends - frame.placement.translation) @ frame.placement.rotation
    rounded = np.round(placed, _DIGITS) + 0.0
    moved = float(np.max(np.linalg.norm(rounded - placed, axis=1)))
    step = 10.0**-_DIGITS
    return {
        "link": link,
        "ends_m": rounded.tolist(),
        "radius_m": round(math.ceil((radius + moved) / step - 1e-6) * step, _DIGITS),
    }


def carve(
    capsules: list[dict[str, Any]],
    robot: Robot,
    surfaces: Sequence[Surface],
    meshes_touch: MeshesTouch,
    progress: Callable[[float], None],
) -> tuple[list[dict[str, Any]], dict[str, IntArray]]:
    """Split those capsules of a robot.yaml that cost room.

    Parameters
    ----------
    capsules : list of dict
    robot : Robot
        With them.
    surfaces, meshes_touch, progress
        As in `besman.robot.files.carved_capsules.carve_capsules`.

    Returns
    -------
    capsules : list of dict
    owners : dict of array, shape (F,)
        Which of a link's capsules holds each triangle of its whole surface, by link.
    """
    carved = carved_capsules.carve_capsules(robot, surfaces, meshes_touch, progress)
    joints = dict(zip(robot.chain.capsule_links, robot.chain.capsule_joints.tolist(), strict=True))
    others = {link: found for link, found in carved.items() if found.changed}
    result = [one for one in capsules if one["link"] not in others]
    for link, found in others.items():
        result += [_in_link(robot.model, link, joints[link], *one) for one in found.capsules]
    return result, {link: found.owner for link, found in carved.items()}
