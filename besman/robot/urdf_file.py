"""Reading a URDF that may come from anywhere: one chain-like tree, no entities, no stray paths."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Collection, Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from besman.exceptions import RobotError
from besman.foreign.numbers import parse_number
from besman.foreign.paths import is_file
from besman.foreign.urdf_text import MOST_CHARACTERS, UrdfTextError, link_names, parse_urdf
from besman.robot.files.mesh_folders import mesh_path

_ENCODING = re.compile(rb"""^[^>]{0,80}?encoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
# Of one byte a character, as ROS-Industrial's files from Windows have it.
_ENCODINGS = {"iso-8859-1", "iso8859-1", "latin-1", "latin1", "windows-1252", "cp1252", "us-ascii"}
MESH_ENDINGS = (".stl", ".dae", ".obj", ".ply", ".off")
"""Of files that may be meshes."""

MOST_MESH_BYTES = 40_000_000
"""Of one mesh: an arm's link needs a hundredth of it."""

_SHAPES = ("collision", "visual")
# In the head of a COLLADA file.
_UNIT = re.compile(rb"""<unit\b[^>]{0,200}?\bmeter\s*=\s*["']([^"']{1,40})["']""")
_HEAD_BYTES = 20_000


def read_urdf(
    urdf: Path,
    folder: Path,
    packages: Mapping[str, Path] | None = None,
    unusable: dict[str, str] | None = None,
) -> ElementTree.Element:
    """Read a URDF and make the addresses of its meshes absolute.

    Parameters
    ----------
    urdf : Path
        The file.
    folder : Path
        What ``package://`` addresses start from; no mesh may be outside it.
    packages : dict of Path, optional
        Folders of packages that are elsewhere.
    unusable : dict of str, optional
        Addresses of meshes that are outside, not there or too large are added to it, and why; what
        has such a shape is read without it. Without this dict, meshes outside are refused.

    Returns
    -------
    Element
        The root element.

    Raises
    ------
    RobotError
        If the file is no URDF, has entities, a loop, names or numbers of which no arm is made, or a
        mesh outside the folder.
    """
    tree = read_urdf_text(urdf)
    place_meshes(tree, urdf, folder, packages, unusable)
    return tree


def read_urdf_text(urdf: Path) -> ElementTree.Element:
    """Read a URDF and leave the addresses of its meshes as they are.

    Parameters
    ----------
    urdf : Path

    Raises
    ------
    RobotError
        If the file is no URDF of which an arm is made.
    """
    try:
        if urdf.stat().st_size > MOST_CHARACTERS:
            raise RobotError(f"{urdf}: expected a URDF of at most {MOST_CHARACTERS // 10**6} MB")
        content = urdf.read_bytes()
    except OSError as error:
        raise RobotError(f"{urdf}: cannot be read: {error.strerror}") from None
    return parse_urdf_bytes(content, urdf)


def parse_urdf_bytes(content: bytes, urdf: Path) -> ElementTree.Element:
    """Parse the content of a URDF; see `read_urdf_text`."""
    declared = _ENCODING.match(content)
    encoding = declared.group(1).decode("ascii").lower() if declared else "utf-8"
    try:
        text = content.decode(encoding if encoding in _ENCODINGS else "utf-8-sig")
    except UnicodeDecodeError:
        raise RobotError(
            f"{urdf}: not valid XML: expected text in UTF-8, or as its first line says"
        ) from None
    try:
        tree = parse_urdf(text)
    except UrdfTextError as error:
        raise RobotError(f"{urdf}: {error}") from None
    if not tree.get("name", "").strip():
        tree.set("name", urdf.stem)
    _drop_empty(tree)
    _split_capsules(tree)
    return tree


def _drop_empty(tree: ElementTree.Element) -> None:
    """Leave out what is a point or a line: it encloses nothing, and simulators refuse it."""
    for link in tree.findall("link"):
        for shape in [one for tag in _SHAPES for one in link.findall(tag)]:
            radii = [one.get("radius") for one in shape.findall("geometry/*")]
            if any(radius is not None and parse_number(radius) == 0 for radius in radii):
                link.remove(shape)


def _split_capsules(tree: ElementTree.Element) -> None:
    """Make a cylinder and two balls of each capsule, which simulators know and URDF does not.

    Its length is that of the cylinder, along z.
    """
    for link in tree.findall("link"):
        for shape in [one for tag in _SHAPES for one in link.findall(tag)]:
            geometry = shape.find("geometry")
            capsule = None if geometry is None else geometry.find("capsule")
            if geometry is None or capsule is None:
                continue
            radius, length = (capsule.get(key, "0") for key in ("radius", "length"))
            geometry.remove(capsule)
            ElementTree.SubElement(geometry, "cylinder", radius=radius, length=length)
            for sign in (1, -1):
                link.append(_ball_at_end(shape, radius, sign * parse_number(length) / 2))


def _ball_at_end(shape: ElementTree.Element, radius: str, along: float) -> ElementTree.Element:
    """Return a ball on a shape's z axis, of the same kind and material."""
    import pinocchio

    origin = shape.find("origin")
    words = {key: "" if origin is None else origin.get(key, "") for key in ("xyz", "rpy")}
    xyz, rpy = (
        np.array([parse_number(word) for word in text.split()] or [0.0] * 3)
        for text in words.values()
    )
    place = xyz + pinocchio.rpy.rpyToMatrix(*rpy)[:, 2] * along
    ball = ElementTree.Element(shape.tag)
    ElementTree.SubElement(ball, "origin", xyz=" ".join(repr(float(one)) for one in place))
    geometry = ElementTree.SubElement(ball, "geometry")
    ElementTree.SubElement(geometry, "sphere", radius=radius)
    return ball


def place_meshes(
    tree: ElementTree.Element,
    urdf: Path,
    folder: Path,
    packages: Mapping[str, Path] | None,
    unusable: dict[str, str] | None,
) -> None:
    """Make the addresses of a URDF's meshes absolute; see `read_urdf`."""
    for link in tree.findall("link"):
        for shape in [one for tag in _SHAPES for one in link.findall(tag)]:
            for mesh in shape.iter("mesh"):
                address = mesh.get("filename", "")
                try:
                    path = mesh_path(address, urdf, folder, packages)
                except RobotError as error:
                    if unusable is None:
                        raise
                    unusable[address] = str(error).removeprefix(f"{urdf}: ")
                    link.remove(shape)
                    break
                fault = _fault_of_mesh(path)
                if unusable is not None and fault is not None:
                    unusable[address] = f"mesh {path}: {fault}"
                    link.remove(shape)
                    break
                mesh.set("filename", str(path))
                unit = _unit_of_mesh(path)
                if unit != 1.0:
                    scale = mesh.get("scale", "").split() or ["1"] * 3
                    mesh.set("scale", " ".join(repr(parse_number(one) * unit) for one in scale))


def _unit_of_mesh(path: Path) -> float:
    """Return the metres of the unit that a COLLADA file is drawn in.

    ROS scales by it, the reader of Pinocchio does not; what is its top it takes as ROS does.
    """
    if path.suffix.lower() != ".dae" or not is_file(path):
        return 1.0
    with path.open("rb") as file:
        found = _UNIT.search(file.read(_HEAD_BYTES))
    try:
        unit = parse_number(found.group(1).decode("ascii", "replace")) if found else 1.0
    except ValueError:
        return 1.0
    return unit if 0 < unit < math.inf else 1.0


def _fault_of_mesh(path: Path) -> str | None:
    """Say why a mesh cannot be used, None if it may be."""
    if not is_file(path):
        return "no such file"
    if path.suffix.lower() not in MESH_ENDINGS:
        return f"{path.suffix or 'no ending'}: expected one of {', '.join(MESH_ENDINGS)}"
    size = path.stat().st_size
    if size > MOST_MESH_BYTES:
        return f"{size / 1e6:.0f} MB, more than {MOST_MESH_BYTES / 1e6:.0f}"
    return None


def joint_in_model(name: str, links: Collection[str]) -> str:
    """Return the name that a joint has in Pinocchio's model, where links have other ones."""
    return f"{name} (joint)" if name in links else name


def _complete_link(link: ElementTree.Element) -> None:
    """Write what a link leaves out, else urdfdom drops its mass and its shapes, and goes on.

    Moments of inertia that are left out are zero; a shape without geometry is none.
    """
    for inertial in link.findall("inertial"):
        mass = inertial.find("mass")
        if mass is None or not mass.get("value", "").strip():
            link.remove(inertial)
            continue
        mass.set("value", mass.get("value", "").strip())
        inertia = inertial.find("inertia")
        inertia = ElementTree.SubElement(inertial, "inertia") if inertia is None else inertia
        for axes in ("xx", "yy", "zz", "xy", "xz", "yz"):
            inertia.set(f"i{axes}", inertia.get(f"i{axes}", "").strip() or "0")
    for shape in [one for tag in _SHAPES for one in link.findall(tag)]:
        geometry = shape.find("geometry")
        if geometry is None or not len(geometry):
            link.remove(shape)


def text_for_model(tree: ElementTree.Element) -> str:
    """Return a URDF's text for other libraries, which refuse what besman reads.

    Pinocchio finds no frame if a joint and a link share a name; a hinge without limits is none.

    Parameters
    ----------
    tree : Element
        Is not changed.
    """
    links = set(link_names(tree))
    apart = copy.deepcopy(tree)
    for link in apart.findall("link"):
        _complete_link(link)
    for joint in apart.findall("joint"):
        joint.set("name", joint_in_model(joint.get("name", ""), links))
        if joint.get("type") in ("revolute", "prismatic"):
            limit = joint.find("limit")
            limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
            for key in ("lower", "upper", "effort", "velocity"):
                # What is left out is zero, which means that it is not given.
                limit.set(key, limit.get(key, "0"))
        mimic = joint.find("mimic")
        if mimic is not None:
            mimic.set("joint", joint_in_model(mimic.get("joint", ""), links))
    return ElementTree.tostring(apart, encoding="unicode")
