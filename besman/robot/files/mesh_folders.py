"""Where the meshes of an arm's file are: what ``package://`` and relative addresses lead to."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError
from besman.foreign.names import fault_of_characters
from besman.foreign.paths import file_alike, is_file, is_folder

_SCHEMES = ("package://", "model://")
# Characters: no path is longer.
_LONGEST_ADDRESS = 1000
# Folders above a URDF that are looked through; packages lie in each other no deeper.
_HIGHEST = 8
_MOST_NEIGHBOURS = 300
# Where a package keeps its URDFs, beside the folder of its meshes.
_URDF_FOLDERS = {"urdf", "urdfs", "robots", "robot", "xacro", "sdf", "mjcf", "model", "models"}
_PACKAGE_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
_LONGEST_PACKAGE_FILE = 200_000


@dataclass(frozen=True)
class MeshFolders:
    """The only folders that meshes are read from.

    Attributes
    ----------
    home : Path
        Relative addresses must lie below it, and so must those of packages that are not listed.
    packages : dict of Path
        Folder of every ROS package, by its name.
    guessed : tuple of str
        Packages that no folder is called by, and that were taken for one that has their files.
    """

    home: Path
    packages: Mapping[str, Path] = field(default_factory=dict)
    guessed: tuple[str, ...] = ()


def split_address(address: str) -> tuple[str, str] | None:
    """Return package and path of ``package://NAME/PATH``, None for any other address."""
    for scheme in _SCHEMES:
        if address.startswith(scheme):
            package, _, rest = address.removeprefix(scheme).partition("/")
            return package, rest
    return None


def mesh_path(
    address: str, urdf: Path, folder: Path, packages: Mapping[str, Path] | None = None
) -> Path:
    """Turn the address of a mesh into an absolute path, whether or not there is a file.

    Parameters
    ----------
    address : str
        ``package://NAME/PATH``, ``file://PATH`` or a path relative to the URDF.
    urdf : Path
        The URDF.
    folder : Path
        What ``package://`` addresses of packages that are not listed start from; no mesh may be
        outside it, or outside its package.
    packages : dict of Path, optional
        Folders of packages.

    Raises
    ------
    RobotError
        If the path is outside these folders.
    """
    home = folder.resolve()
    fault = fault_of_characters(address)
    if fault is not None or len(address) > _LONGEST_ADDRESS:
        raise RobotError(f"{urdf}: mesh {address!r:.60} {fault or 'is no path: too long'}")
    inside = split_address(address)
    if inside is not None and packages and inside[0] in packages:
        home = packages[inside[0]].resolve()
        path = home / inside[1]
    elif inside is not None:
        package, rest = inside
        # A folder that is itself the package, as in a checkout.
        is_package = package == home.name and not (home / package).is_dir()
        path = home / rest if is_package else home / package / rest
    else:
        path = urdf.resolve().parent / address.removeprefix("file://")
    found = path.resolve()
    if not found.is_relative_to(home):
        raise RobotError(
            f"{urdf}: mesh {address!r} is outside {home}; expected it below that folder "
            "(robots add --out: a folder that holds URDF and meshes; --package NAME=FOLDER)"
        )
    return found if is_file(found) else file_alike(found) or found


def find_mesh_folders(
    tree: ElementTree.Element, urdf: Path, given: Mapping[str, Path], folder: Path | None = None
) -> MeshFolders:
    """Find the folders that a URDF's meshes are in.

    A package is the folder of ``--package``; else the one above the URDF that is called so; else
    one whose ``package.xml`` says so, above the URDF or beside what is above it; else one of
    ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``; else a folder above the URDF with the file.

    Parameters
    ----------
    tree : Element
        The URDF, its addresses as they were written.
    urdf : Path
        Its file.
    given : dict of Path
        Folders by package, of ``--package``.
    folder : Path, optional
        What relative addresses must lie below; without it the URDF's package, or its folder.
    """
    above = folders_above(urdf)
    addresses = {mesh.get("filename", "") for mesh in tree.iter("mesh")}
    packages: dict[str, Path] = {}
    guessed = []
    for address in sorted(addresses):
        inside = split_address(address)
        if inside is None or inside[0] in packages or not inside[0]:
            continue
        found = given.get(inside[0]) or find_package(inside[0], above)
        if found is None:
            found = next((one for one in above[:4] if is_file(one / inside[1])), None)
            if found is not None:
                guessed.append(f"{inside[0]} is taken for the folder {found}")
        if found is not None:
            packages[inside[0]] = found.resolve()
    home = folder.resolve() if folder is not None else home_of(above, set(packages.values()))
    return MeshFolders(home, packages, tuple(guessed))


def folders_above(file: Path) -> list[Path]:
    """Return the folders above a file that are looked through, nearest first."""
    return list(file.resolve().parents)[:_HIGHEST]


def home_of(above: list[Path], packages: Collection[Path] = ()) -> Path:
    """Return the folder that relative addresses must lie below.

    Parameters
    ----------
    above : list of Path
        From `folders_above`.
    packages : collection of Path
        Folders of packages that are known.
    """
    for one in above[:5]:
        if one in packages or is_file(one / "package.xml"):
            return one
    # Of a maker's arms each may have a folder of its own: mjcf/ARM/arm.xml, meshes/ARM/link1.stl.
    for one, parent in pairwise(above[:3]):
        if one.name.lower() in _URDF_FOLDERS:
            return parent
    return above[0]


def find_package(name: str, above: list[Path]) -> Path | None:
    """Return the folder of a ROS package, None if there is none.

    Parameters
    ----------
    name : str
    above : list of Path
        Folders above the file that names it, nearest first.
    """
    if fault_of_characters(name) is not None or name in (".", "..") or "\\" in name:
        return None
    for one in above:
        if one.name == name:
            return one
    for one in above:
        if is_folder(one / name):
            return one / name
    for one in above[:4]:
        if _package_name(one) == name:
            return one
        for beside in _neighbours(one):
            if _package_name(beside) == name:
                return beside
    return _in_workspaces(name)


def _neighbours(folder: Path) -> list[Path]:
    """Return the folders in a folder, none of a very full one."""
    try:
        with os.scandir(folder) as entries:
            found = [Path(entry.path) for entry in entries if entry.is_dir()]
    except OSError:
        return []
    return sorted(found) if len(found) <= _MOST_NEIGHBOURS else []


def _package_name(folder: Path) -> str | None:
    """Return what a folder's ``package.xml`` says it is called."""
    file = folder / "package.xml"
    try:
        if not file.is_file() or file.stat().st_size > _LONGEST_PACKAGE_FILE:
            return None
        found = _PACKAGE_NAME.search(file.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return None
    return None if found is None else found.group(1)


def _in_workspaces(name: str) -> Path | None:
    """Look for a package where ROS does."""
    for one in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
        for folder in (Path(one), Path(one) / name) if one else ():
            if folder.name == name and is_folder(folder):
                return folder
    for one in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if one and is_folder(Path(one) / "share" / name):
            return Path(one) / "share" / name
    return None


def places_tried(address: str, urdf: Path, folders: MeshFolders) -> str:
    """Say where a mesh that is not there was looked for."""
    inside = split_address(address)
    if inside is not None and inside[0] not in folders.packages:
        return (
            f"no folder called {inside[0]} above {urdf.resolve().parent}, no package.xml of that "
            "name, none in ROS_PACKAGE_PATH or AMENT_PREFIX_PATH; give --package "
            f"{inside[0]}=FOLDER"
        )
    try:
        return f"no file {mesh_path(address, urdf, folders.home, folders.packages)}"
    except RobotError as error:
        return str(error).removeprefix(f"{urdf}: ")


def list_faults(faults: Mapping[str, str]) -> list[str]:
    """Say of meshes why they cannot be used, in one line for all of a package with one reason.

    Parameters
    ----------
    faults : dict of str
        A line by address: ``mesh PATH: REASON``.
    """
    alike: dict[tuple[str, str], list[str]] = {}
    for address, fault in sorted(faults.items()):
        package, path = split_address(address) or ("", address)
        name = path.rpartition("/")[2]
        reason = fault.rpartition(name)[2] if name in fault else fault
        alike.setdefault((package, reason), []).append(fault)
    said = []
    for (package, _), (first, *others) in alike.items():
        whose = f" of package {package}" if package else ""
        count = f"{len(others) + 1} meshes{whose}, the first "
        said.append(count + first.removeprefix("mesh ") if others else first)
    return said


def parse_packages(texts: Sequence[str]) -> dict[str, Path]:
    """Parse ``NAME=FOLDER``, for each package.

    Raises
    ------
    RobotError
        If one is not so, or the folder is not there.
    """
    found = {}
    for text in texts:
        name, equals, folder = text.partition("=")
        if not name or not equals or not is_folder(Path(folder)):
            raise RobotError(
                f"--package: got {text!r:.200}, expected NAME=FOLDER with a folder that is there"
            )
        found[name] = Path(folder)
    return found
