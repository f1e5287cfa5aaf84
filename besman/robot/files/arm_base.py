"""What stands below an arm and is held: gantries, torsos, and mobile bases that no wheel moves."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError, nearest
from besman.foreign.urdf_text import joint_ends, link_names

HINGES = ("revolute", "continuous")
SLIDES = ("prismatic", "planar", "floating")
_SHAPES = ("visual", "collision")
_DEGREES_ON_A_PLANE = 3


def joints_above(tree: ElementTree.Element, tip: str, urdf: Path) -> list[ElementTree.Element]:
    """Return all joints from the root to a link.

    Raises
    ------
    RobotError
        If the link is not there.
    """
    links = link_names(tree)
    if tip not in links:
        raise RobotError(f"{urdf}: tip: no link {tip!r}; {nearest(tip, links)}")
    above = {joint_ends(joint)[1]: joint for joint in tree.findall("joint")}
    path: list[ElementTree.Element] = []
    link = tip
    while link in above:
        path.insert(0, above[link])
        link = joint_ends(above[link])[0]
    return path


def split_at_base(
    tree: ElementTree.Element, tip: str, urdf: Path, base: str | None = None
) -> tuple[list[ElementTree.Element], list[ElementTree.Element]]:
    """Return the joints from the root to a link: those that the arm stands on, and the rest.

    Parameters
    ----------
    tree : Element
    tip : str
        The link.
    urdf : Path
        Named in errors.
    base : str, optional
        Link that the arm stands on; without it the one that a mobile base's joints lead to.

    Raises
    ------
    RobotError
        If a link is not there, or the base is not above the tip.
    """
    path = joints_above(tree, tip, urdf)
    if base is None:
        moved = mobile_base_joints(tree)
        last = [index for index, joint in enumerate(path) if joint.get("name") in moved]
        count = last[-1] + 1 if last else 0
        return path[:count], path[count:]
    if base not in link_names(tree):
        raise RobotError(f"{urdf}: base: no link {base!r}; {nearest(base, link_names(tree))}")
    links = [joint_ends(joint)[0] for joint in path]
    if base not in links:
        raise RobotError(
            f"{urdf}: base: link {base!r} is not between the root and the tip {tip!r}; expected "
            f"one of {', '.join(links) or 'none, the tip is the root'}"
        )
    index = links.index(base)
    return path[:index], path[index:]


def mobile_base_joints(tree: ElementTree.Element) -> set[str]:
    """Return the names of the joints by which a description lets its base drive about.

    Simulators move a base by sliding joints and hinges in a row between links that are nothing: no
    link above such a joint has a shape, and one of them at least slides. Where no link has a shape
    there is nothing to tell them by.
    """
    shaped = {
        str(link.get("name"))
        for link in tree.findall("link")
        if any(link.find(kind) is not None for kind in _SHAPES)
    }
    if not shaped:
        return set()
    joints = tree.findall("joint")
    children = {joint_ends(joint)[1] for joint in joints}
    drives = set[str]()
    for root in link_names(tree):
        if root not in children:
            drives |= _driving(_bare_rows(joints, root, shaped))
    return drives


def _bare_rows(
    joints: list[ElementTree.Element], root: str, shaped: set[str]
) -> list[list[ElementTree.Element]]:
    """Return the rows of joints that lead from a root to the first links that have a shape."""
    rows, waiting = [], [(root, list[ElementTree.Element]())]
    for link, row in waiting:
        below = [] if link in shaped else [one for one in joints if joint_ends(one)[0] == link]
        waiting += [(joint_ends(one)[1], [*row, one]) for one in below]
        if not below:
            rows.append(row)
    return rows


def _driving(rows: list[list[ElementTree.Element]]) -> set[str]:
    """Return the names of the joints of rows by which a base drives."""
    drives = set[str]()
    for row in rows:
        moving = [joint for joint in row if joint.get("type") in (*SLIDES, *HINGES)]
        # A base has three degrees of freedom on a plane, six in space; what moves behind is the
        # arm's.
        most = _DEGREES_ON_A_PLANE
        for number, least in ((2 * most, most), (most, 1)):
            if sum(joint.get("type") in SLIDES for joint in moving[:number]) >= least:
                drives |= {str(joint.get("name")) for joint in moving[:number]}
                break
    return drives
