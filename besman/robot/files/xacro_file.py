"""xacro: expanded to a URDF by the package xacro, in a process that reads its folders alone."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from besman.exceptions import RobotError, nearest
from besman.foreign.paths import is_file
from besman.robot.files.mesh_folders import (
    find_mesh_folders,
    find_package,
    folders_above,
    home_of,
    split_address,
)
from besman.robot.urdf_file import parse_urdf_bytes

_LONGEST_S = 120.0
# A run more for each package and each argument that is used early.
_MOST_TRIES = 40
_HERE = "xacro_folder"


@dataclass(frozen=True)
class ExpandedXacro:
    """What a xacro describes.

    Attributes
    ----------
    tree : Element
        A URDF; relative addresses of meshes are those of a package, `packages` has its folder.
    packages : dict of Path
        Folders by name.
    notes : list of str
        What was assumed: arguments that were left at their defaults.
    """

    tree: ElementTree.Element
    packages: dict[str, Path]
    notes: list[str]


def is_xacro(path: Path, content: bytes) -> bool:
    """Tell whether a file is to be expanded: by its name, or because it declares xacro's names."""
    return path.suffix.lower() == ".xacro" or b"<xacro:" in content


def parse_arguments(texts: Sequence[str]) -> dict[str, str]:
    """Parse ``NAME=VALUE``, for each argument.

    Raises
    ------
    RobotError
        If one is not so.
    """
    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not name or not equals:
            raise RobotError(f"--arg: got {text!r:.200}, expected NAME=VALUE")
        found[name] = value
    return found


def read_xacro(
    path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]
) -> ExpandedXacro:
    """Expand a xacro.

    Parameters
    ----------
    path : Path
        The file. What it includes must be in its ROS package, its folder, or in packages that are
        found or given.
    arguments : dict of str
        Values by name.
    packages : dict of Path
        Folders of packages by name; others are looked for as those of meshes are.

    Raises
    ------
    RobotError
        If the package xacro is missing, an argument is not given or not there, a package is not
        found, or the file reads what is elsewhere or does what no description needs.
    """
    if find_spec("xacro") is None:
        raise RobotError(f"{path}: xacro: package 'xacro' is not installed; pip install "
                         "'besman[xacro]', or expand it to a URDF with ROS's xacro")  # fmt: skip
    above = folders_above(path)
    home = home_of(above)
    known = {name: folder.resolve() for name, folder in packages.items()}
    given = dict(arguments)
    for _ in range(_MOST_TRIES):
        told = _run(path, home, known, given)
        package, early = told.get("package"), _used_early(told)
        if early:
            given |= early
            continue
        if package is None:
            break
        found = find_package(package, above) or _folder_with_files_of(package, path, above)
        if found is None:
            raise RobotError(
                f"{path}: package {package!r}: no folder called so above it, no package.xml of "
                f"that name, none in ROS_PACKAGE_PATH or AMENT_PREFIX_PATH; give --package "
                f"{package}=FOLDER"
            )
        known[package] = found.resolve()
    if not told.get("refused"):
        _refuse_strange_arguments(path, arguments, told["declared"])
    if "urdf" not in told:
        raise RobotError(f"{path}: {_fault(told, path, home)}")
    if not told["links"] and told["macros"]:
        macros = ", ".join(told["macros"][:8])
        raise RobotError(
            f"{path}: xacro: no links, only macros ({macros}); expected the file that calls them"
        )
    tree = parse_urdf_bytes(told["urdf"].encode(), path)
    notes = [
        f"xacro argument {name}: {default!r}, its default"
        for name, default in told["declared"].items()
        if name not in arguments and default is not None
    ]
    return ExpandedXacro(tree, _name_relative_meshes(tree, path, known), notes)


def _used_early(told: Mapping[str, Any]) -> dict[str, str]:
    """Return an argument with its default where a file uses it above the line that declares it.

    So do descriptions whose robot is called by an argument.
    """
    name = str(told.get("error", "")).removeprefix("Undefined substitution argument ")
    default = told["declared"].get(name)
    return {} if default is None or told.get("refused") or "$" in default else {name: default}


def _folder_with_files_of(package: str, path: Path, above: list[Path]) -> Path | None:
    """Return the folder above a file that holds what the file finds in a package, if there is."""
    text = path.read_text(encoding="utf-8", errors="replace")
    for inside in re.findall(rf"\$\(find {re.escape(package)}\)/([\w./-]+)", text):
        for folder in above[:4]:
            if is_file(folder / inside):
                return folder
    return None


def _run(
    path: Path, home: Path, packages: Mapping[str, Path], arguments: Mapping[str, str]
) -> dict[str, Any]:
    """Expand in another process; return what it says."""
    task = {
        "file": str(path.resolve()),
        "folders": [str(home), *map(str, packages.values())],
        "packages": {name: str(folder) for name, folder in packages.items()},
        "arguments": dict(arguments),
    }
    command = [sys.executable, "-m", "besman.robot.files.xacro_process"]
    try:
        # The command is this Python and a module of this package.
        done = subprocess.run(  # noqa: S603
            command, input=json.dumps(task), capture_output=True, text=True, timeout=_LONGEST_S,
            check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise RobotError(f"{path}: xacro did not end in {_LONGEST_S:.0f} s") from None
    try:
        told: dict[str, Any] = json.loads(done.stdout)
    except ValueError:
        last = (done.stderr.strip().splitlines() or ["used up its time or memory"])[-1]
        raise RobotError(f"{path}: xacro ended: {last:.200}") from None
    return told


def _refuse_strange_arguments(
    path: Path, arguments: Mapping[str, str], declared: Mapping[str, str | None]
) -> None:
    """Refuse an argument that no file declares."""
    for name in arguments:
        if name not in declared:
            raise RobotError(f"{path}: --arg: no argument {name!r}; {nearest(name, declared)}")


def _fault(told: Mapping[str, Any], path: Path, home: Path) -> str:
    """Say what is wrong, and what would be possible."""
    error = str(told["error"])
    if told.get("refused"):
        return f"xacro: not allowed: {error}; expected what it reads below {home}"
    declared = told["declared"]
    missing = [name for name, default in declared.items() if default is None]
    others = ", ".join(f"{name}={value}" for name, value in declared.items() if value is not None)
    if "Undefined substitution argument" not in error or not missing:
        # The default of an argument may name a file that is not there.
        more = f"; --arg may change {others}" if others and "No such file" in error else ""
        return f"xacro: {error}{more}"
    given = " ".join(f"--arg {name}=VALUE" for name in missing)
    more = f"; those with a default: {others}" if others else ""
    return f"xacro needs the arguments {', '.join(missing)}; give {given}{more}"


def _name_relative_meshes(
    tree: ElementTree.Element, path: Path, packages: Mapping[str, Path]
) -> dict[str, Path]:
    """Write relative and absolute addresses of meshes as those of a package; return all packages.

    The URDF is written elsewhere than the xacro.
    """
    folders = find_mesh_folders(tree, path, packages)
    found = {**packages, **folders.packages}
    for mesh in tree.iter("mesh"):
        address = mesh.get("filename", "")
        if split_address(address) is not None:
            continue
        file = (path.resolve().parent / address.removeprefix("file://")).resolve()
        for name, folder in [*found.items(), (_HERE, folders.home.resolve())]:
            if file.is_relative_to(folder):
                found[name] = folder
                inside = file.relative_to(folder).as_posix()
                mesh.set("filename", f"package://{name}/{inside}")
                break
    return found
