"""Reading a URDF that may come from anywhere: one chain-like tree, no entities, no stray paths."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError

_GREATEST_BYTES = 20_000_000
_PACKAGE = "package://"


def read_urdf(urdf: Path, folder: Path) -> ElementTree.Element:
    """Read a URDF and make the addresses of its meshes absolute.

    Parameters
    ----------
    urdf : Path
        The file.
    folder : Path
        What ``package://`` addresses start from; no mesh may be outside it.

    Returns
    -------
    Element
        The root element.

    Raises
    ------
    RobotError
        If the file is no URDF, has entities, a loop, or a mesh outside the folder.
    """
    if urdf.stat().st_size > _GREATEST_BYTES:
        raise RobotError(f"{urdf}: expected a URDF of at most 20 MB")
    try:
        text = urdf.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise RobotError(f"{urdf}: not valid XML: expected text in UTF-8") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise RobotError(f"{urdf}: document types and entities are not allowed in a URDF")
    try:
        tree = ElementTree.fromstring(text)  # noqa: S314 -- entities are refused above
    except ElementTree.ParseError as error:
        raise RobotError(f"{urdf}: not valid XML: {error}") from None
    if tree.tag != "robot" or tree.find("link") is None:
        raise RobotError(f"{urdf}: cannot be used as URDF: expected <robot> with links")
    check_tree(tree, urdf)
    for mesh in tree.iter("mesh"):
        mesh.set("filename", str(mesh_path(mesh.get("filename", ""), urdf, folder)))
    return tree


def link_names(tree: ElementTree.Element) -> list[str]:
    """Return the names of all links."""
    return [str(link.get("name")) for link in tree.findall("link")]


def joint_ends(joint: ElementTree.Element) -> tuple[str, str]:
    """Return the names of a joint's parent and child link ("" where there is none)."""
    ends = []
    for tag in ("parent", "child"):
        element = joint.find(tag)
        ends.append("" if element is None else element.get("link", ""))
    return ends[0], ends[1]


def check_tree(tree: ElementTree.Element, urdf: Path) -> None:
    """Refuse links that hang on themselves, on two joints or on nothing.

    Raises
    ------
    RobotError
        With the joint or link that is at fault.
    """
    links = link_names(tree)
    parents: dict[str, str] = {}
    for joint in tree.findall("joint"):
        name, (parent, child) = joint.get("name"), joint_ends(joint)
        for link in (parent, child):
            if link not in links:
                raise RobotError(f"{urdf}: joint {name}: no link {link!r} in the URDF")
        if child in parents:
            raise RobotError(
                f"{urdf}: loop: link {child!r} hangs on {parents[child]!r} and, by joint {name}, "
                f"on {parent!r}; a URDF is a tree"
            )
        parents[child] = parent
    for link in links:
        above, steps = link, 0
        while above in parents and steps <= len(links):
            above, steps = parents[above], steps + 1
        if above in parents:
            raise RobotError(f"{urdf}: loop: link {link!r} hangs on itself; a URDF is a tree")
    roots = [link for link in links if link not in parents]
    if len(roots) != 1:
        raise RobotError(f"{urdf}: expected one link that hangs on nothing, got {', '.join(roots)}")


def mesh_path(address: str, urdf: Path, folder: Path) -> Path:
    """Turn the address of a mesh into an absolute path, whether or not there is a file.

    Parameters
    ----------
    address : str
        ``package://NAME/PATH``, ``file://PATH`` or a path relative to the URDF.
    urdf, folder : Path
        As in `read_urdf`.

    Raises
    ------
    RobotError
        If the path is outside the folder.
    """
    home = folder.resolve()
    if address.startswith(_PACKAGE):
        inside = address.removeprefix(_PACKAGE)
        package, _, rest = inside.partition("/")
        # A folder that is itself the package, as in a checkout.
        path = home / rest if package == home.name and not (home / package).is_dir() else None
        path = path or home / inside
    else:
        path = urdf.resolve().parent / address.removeprefix("file://")
    path = path.resolve()
    if not path.is_relative_to(home):
        raise RobotError(
            f"{urdf}: mesh {address!r} is outside {home}; expected it below that folder "
            "(robots add --out: a folder that holds URDF and meshes)"
        )
    return path
