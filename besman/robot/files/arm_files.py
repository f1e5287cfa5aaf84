"""Names and files of an arm that is brought in: none is taken, none is overwritten."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError
from besman.robot.files.mjcf_file import CompiledArm
from besman.robot.model import list_robots

RESERVED = ("add", "check", "show", "try")
"""What is a command of ``besman robots``."""

# A file system takes 255 bytes with the ending.
_LONGEST_NAME = 100


def write_arm(arm: CompiledArm, folder: Path, name: str, made: list[Path]) -> Path:
    """Write the URDF and the meshes of a compiled MJCF, or of a xacro; return the URDF."""
    urdf, meshes = folder / f"{name}.urdf", folder / f"{name}_meshes"
    for there in (urdf, meshes):
        if there.exists():
            raise RobotError(
                f"{there}: is there already; nothing is overwritten, give another --name"
            )
    try:
        if arm.meshes:
            meshes.mkdir(parents=True)
            made.append(meshes)
        for one, content in arm.meshes.items():
            made.append(meshes / one)
            (meshes / one).write_bytes(content)
    except OSError as error:
        raise RobotError(f"{meshes}: cannot be written: {error.strerror}") from None
    for mesh in arm.tree.iter("mesh") if arm.meshes else ():
        mesh.set("filename", f"{meshes.name}/{mesh.get('filename')}")
    ElementTree.indent(arm.tree)
    write_new(urdf, ElementTree.tostring(arm.tree, encoding="unicode") + "\n")
    made.append(urdf)
    return urdf


def write_new(path: Path, text: str) -> None:
    """Write a file that is not there; one that came into being meanwhile is not overwritten."""
    made = False
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            made = True
            file.write(text)
    except OSError as error:
        if made:
            with suppress(OSError):
                path.unlink()
        raise RobotError(f"{path}: cannot be written: {error.strerror}") from None


def free_name(name: str) -> str:
    """Return a name that a file may bear, and that no robot here has."""
    usable = re.sub(r"[\s/\\:]+", "_", name.strip())[:_LONGEST_NAME]
    return f"my_{usable}" if usable in (*list_robots(), *RESERVED) else usable


def check_name(name: str, urdf: Path) -> str:
    """Refuse names that cannot be used or are taken."""
    if not re.fullmatch(r"[A-Za-z0-9][\w.-]*", name) or name in RESERVED:
        raise RobotError(
            f"{urdf}: name: got {name!r}, expected letters, digits, '_', '.' and '-', and none of "
            f"{', '.join(RESERVED)}; give one with --name"
        )
    if name in list_robots():
        raise RobotError(f"{urdf}: name: there is a robot {name!r} already; give another --name")
    return name
