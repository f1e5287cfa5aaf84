"""Which files a MJCF is made of: those below its folder and its package, and no others."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError, in_one_line
from besman.foreign.paths import is_file
from besman.robot.files.mesh_folders import folders_above, home_of

_MOST_CHARACTERS = 20_000_000
_MOST_FILES = 200
_DECLARATION = re.compile(r"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)
_FOLDERS = ("meshdir", "assetdir")
# They are not read (`besman.robot.files.mjcf_meshes.compile_bare`).
_UNREAD = ("texture", "skin")
_INCLUDED = ("include", "model")


def refuse_files_outside(path: Path, allowed: Collection[Path] = ()) -> list[Path]:
    """Refuse a MJCF that has entities, or reads what is not below its folders.

    Parameters
    ----------
    path : Path
        The file.
    allowed : collection of Path
        Further folders that may be read.

    Returns
    -------
    list of Path
        What it includes.

    Raises
    ------
    RobotError
        If it, or what it includes, is not so, or is no XML.
    """
    above = folders_above(path)
    package = home_of(above)
    roots = [above[0], package, *_installed_package(above)]
    roots += [one.resolve() for one in allowed]
    trees: dict[Path, ElementTree.Element] = {}
    waiting = [path.resolve()]
    while waiting and len(trees) < _MOST_FILES:
        file = waiting.pop()
        if file in trees:
            continue
        tree = trees[file] = _read(file, path)
        for name in _names_in(tree, _INCLUDED):
            places = _places(name, above[0], file, {""})
            _refuse(places, roots, package, path)
            waiting += [one for one in places if is_file(one)]
    # Folders that any of the files names may be meant in each of them.
    compilers = [one for tree in trees.values() for one in tree.iter("compiler")]
    folders = {one.get(key, "") for one in compilers for key in _FOLDERS if one.get(key)} or {""}
    for file, tree in trees.items():
        tags = {one.tag for one in tree.iter()} - {*_INCLUDED, *_UNREAD}
        for name in _names_in(tree, tags):
            _refuse(_places(name, above[0], file, folders), roots, package, path)
    return list(trees)[1:]


def _refuse(places: list[Path], roots: list[Path], package: Path, path: Path) -> None:
    """Refuse a file that is outside all folders that may be read.

    Of several places that a name may mean, MuJoCo reads one that is there.
    """
    outside = [one for one in places if not any(one.is_relative_to(root) for root in roots)]
    refused = [one for one in outside if is_file(one) or len(outside) == len(places)]
    if refused:
        raise RobotError(
            f"{path}: the file {str(refused[0])!r:.200} is outside {package}; expected what a MJCF "
            "includes below that folder (robots add --package NAME=FOLDER: another folder that may "
            "be read)"
        )


def _installed_package(above: list[Path]) -> list[Path]:
    """Return the folder of the Python package that a file was installed with, if it was."""
    for one in above[1:]:
        if next(one.parent.glob("*.dist-info"), None) is not None:
            return [one]
    return []


def _read(file: Path, path: Path) -> ElementTree.Element:
    """Parse a MJCF, or what one includes."""
    try:
        text = file.read_text(encoding="utf-8")
        if len(text) > _MOST_CHARACTERS or _DECLARATION.search(text):
            raise RobotError(f"{path}: document types and entities are not allowed in a MJCF")
        # Entities are refused above.
        return ElementTree.fromstring(text)  # noqa: S314
    except (OSError, UnicodeDecodeError, ElementTree.ParseError) as error:
        raise RobotError(f"{path}: {file.name}: not valid XML: {in_one_line(error)}") from None


def _names_in(tree: ElementTree.Element, tags: Collection[str]) -> list[str]:
    """Return the files that elements of some kinds name."""
    pairs = [pair for one in tree.iter() if one.tag in tags for pair in one.items()]
    return [name for key, name in pairs if key.startswith("file") and name]


def _places(name: str, home: Path, file: Path, folders: Collection[str]) -> list[Path]:
    """Return all places that a name in a file may mean, those beside the first file first."""
    starts = dict.fromkeys((home, file.parent))
    return [(start / folder / name).resolve() for start in starts for folder in sorted(folders)]
