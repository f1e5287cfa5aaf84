"""What is doubtful in an arm's shapes: capsules against meshes, pairs that always touch, flange."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from besman.robot.files.standing import ALONG_AXIS, outward_axis
from besman.robot.files.touching_links import always_overlapping
from besman.robot.model import Robot

FloatArray = npt.NDArray[np.float64]

# What a mesh may stand out of its capsules: they are rounded to a tenth of a millimetre.
_OUTSIDE_M = 0.0005
# What a capsule may stand out of the box around its mesh, and as a share of that box.
_BEYOND_M, _BEYOND_SHARE = 0.05, 0.5


def shape_doubts(robot: Robot, tree: ElementTree.Element, urdf: Path) -> list[str]:
    """Hold the capsules of an arm against the meshes of its links.

    Parameters
    ----------
    robot : Robot
    tree : Element
        Its URDF with its meshes' addresses, from `besman.robot.model.read_robot_urdf`.
    urdf : Path
        Named in errors.

    Returns
    -------
    list of str
        A line for each link whose mesh stands out of its capsules, or whose capsules are much
        larger.
    """
    from besman.robot.link_shapes import link_meshes

    corners: dict[tuple[str, int], list[FloatArray]] = {}
    for link, joint, vertices, _ in link_meshes(robot.model, tree, urdf):
        corners.setdefault((link, joint), []).append(vertices)
    said = []
    for (link, joint), parts in corners.items():
        ends, radii = _capsules_of(robot, link, joint)
        if not len(radii):
            continue
        points = np.concatenate(parts)
        outside = float(distance_outside(points, ends, radii).max())
        if outside > _OUTSIDE_M:
            said.append(f"capsules of link {link}: its mesh stands out by {1000 * outside:.1f} mm")
        size = np.ptp(points, axis=0)
        reach = radii[:, None, None]
        low, high = (ends - reach).min(axis=(0, 1)), (ends + reach).max(axis=(0, 1))
        beyond = float(max((points.min(axis=0) - low).max(), (high - points.max(axis=0)).max()))
        if beyond > max(_BEYOND_M, _BEYOND_SHARE * float(size.max())):
            said.append(
                f"capsules of link {link}: they reach {100 * beyond:.0f} cm beyond its mesh, which "
                f"is {100 * float(size.max()):.0f} cm long"
            )
    return said


def _capsules_of(robot: Robot, link: str, joint: int) -> tuple[FloatArray, FloatArray]:
    """Return ends (C, 2, 3) and radii (C,) of a link's capsules, in the frame of its joint."""
    chain = robot.chain
    rows = [
        row
        for row, name in enumerate(chain.capsule_links)
        if name == link and chain.capsule_joints[row] == joint
    ]
    return chain.capsule_ends[rows], chain.capsule_radii[rows]


def distance_outside(points: FloatArray, ends: FloatArray, radii: FloatArray) -> FloatArray:
    """Return how far points are outside of the nearest of some capsules, negative inside.

    Parameters
    ----------
    points : array, shape (N, 3)
        Metres.
    ends : array, shape (C, 2, 3)
        Of the capsules' axes.
    radii : array, shape (C,)

    Returns
    -------
    array, shape (N,)
        Metres.
    """
    nearest = np.full(len(points), np.inf)
    for (first, second), radius in zip(ends, radii, strict=True):
        along = second - first
        share = (points - first) @ along / max(float(along @ along), 1e-18)
        feet = first + np.clip(share, 0.0, 1.0)[:, None] * along
        nearest = np.minimum(nearest, np.linalg.norm(points - feet, axis=1) - radius)
    return nearest


def overlap_doubts(robot: Robot) -> list[str]:
    """Name the pairs of links whose capsules overlap in each of some random poses.

    Parameters
    ----------
    robot : Robot
    """
    return [
        f"links {first}, {second}: their capsules overlap in every pose, so that none is clear; "
        "name them under ignored_pairs, if that is how the arm is built"
        for first, second in always_overlapping(robot)
    ]


def flange_doubts(robot: Robot) -> list[str]:
    """Tell whether the flange's z does not point away from the arm along its last axis (ISO 9787).

    Parameters
    ----------
    robot : Robot
    """
    from besman.geometry.frames import quaternion_to_rotation

    config = robot.content["config"]
    outwards = outward_axis(robot.model, config["tip"])
    if outwards is None:
        return []
    z = quaternion_to_rotation(config["flange_wxyz"])[:, 2]
    along = float(z @ outwards)
    if along >= ALONG_AXIS:
        return []
    turned = float(np.degrees(np.arccos(np.clip(along, -1.0, 1.0))))
    return [
        f"flange: z of link {config['tip']} is {turned:.0f} degrees off the last axis away from "
        "the arm, where tools are mounted (ISO 9787); flange_wxyz turns it"
    ]
