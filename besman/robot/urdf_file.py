"""Reading a URDF that may come from anywhere: one chain-like tree, no entities, no stray paths."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError
from besman.foreign.names import fault_of_characters
from besman.foreign.urdf_text import MOST_CHARACTERS, UrdfTextError, parse_urdf

_PACKAGE = "package://"
# Characters: no path is longer.
_LONGEST_ADDRESS = 1000


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
        If the file is no URDF, has entities, a loop, names or numbers of which no arm is made, or a
        mesh outside the folder.
    """
    if urdf.stat().st_size > MOST_CHARACTERS:
        raise RobotError(f"{urdf}: expected a URDF of at most {MOST_CHARACTERS // 10**6} MB")
    try:
        tree = parse_urdf(urdf.read_text(encoding="utf-8"))
    except UnicodeDecodeError:
        raise RobotError(f"{urdf}: not valid XML: expected text in UTF-8") from None
    except UrdfTextError as error:
        raise RobotError(f"{urdf}: {error}") from None
    for mesh in tree.iter("mesh"):
        mesh.set("filename", str(mesh_path(mesh.get("filename", ""), urdf, folder)))
    return tree


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
    fault = fault_of_characters(address)
    if fault is not None or len(address) > _LONGEST_ADDRESS:
        raise RobotError(f"{urdf}: mesh {address!r:.60} {fault or 'is no path: too long'}")
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
