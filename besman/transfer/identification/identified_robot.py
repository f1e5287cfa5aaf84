"""A robot.yaml with what executions say of the arm, beside the old one."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import yaml

from besman.config.resources import resource_folder
from besman.config.yaml_file import load_config
from besman.io.atomic_files import make_folder, write_json, write_text
from besman.robot.config import RobotConfig
from besman.robot.model import find_robot, find_urdf, load_robot
from besman.transfer.identification.fit import DriveFit
from besman.transfer.identification.quantities import PAYLOAD

_DIGITS = 5


def place_of_identified(source: str, run: Path, out: Path | None = None) -> tuple[Path, str]:
    """Return where an identified robot.yaml goes, and what the robot is called: nothing is there.

    Parameters
    ----------
    source : str
        The old robot: the name of one that comes with besman, or the path of a robot.yaml.
    run : Path
        The run. Robots that come with besman go to its folder ``identified``.
    out : Path, optional
        The folder; default that of the old robot.yaml.
    """
    old = find_robot(source)
    comes_along = old.resolve().is_relative_to(resource_folder("robots").resolve())
    folder = out or (run / "identified" if comes_along else old.parent)
    base = re.sub(r"_identified\d*$", "", load_config(old, RobotConfig).name)
    number = 1
    while True:
        ending = f"identified{number if number > 1 else ''}"
        path = folder / f"{base}.{ending}.yaml"
        if not path.exists() and not _beside(path).exists():
            return path, f"{base}_{ending}"
        number += 1


def write_identified(
    place: tuple[Path, str], source: str, fit: DriveFit, told_by: str, results: dict[str, Any]
) -> None:
    """Write a robot.yaml, and what was found as JSON beside it.

    Parameters
    ----------
    place : path and name
        See `place_of_identified`.
    source : str
        The old robot.
    fit : DriveFit
    told_by : str
        What the numbers come from, in words.
    results : dict
        For the JSON file.

    Raises
    ------
    RobotError, FileError
        If it cannot be written or, as it was written, be loaded.
    """
    path, name = place
    old = find_robot(source)
    config = load_config(old, RobotConfig)
    content = config.model_dump(mode="json", exclude_unset=True) | {"name": name}
    content |= _addresses(config, old, path.parent)
    for at, quantity in enumerate(fit.quantities):
        if not fit.found.told[at]:
            continue
        value = float(f"{fit.found.values[at]:.{_DIGITS}g}")
        if quantity.key == PAYLOAD:
            content[PAYLOAD] = value
            continue
        joint = content["joints"][quantity.joint]
        joint[quantity.key] = value
        said = f"{told_by}, standard deviation {fit.found.deviations[at]:.2g}"
        joint["origin"] = joint.get("origin", {}) | {quantity.key: said}
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None)
    make_folder(path.parent)
    write_text(path, f"# {name}: {told_by}; what was found is in {_beside(path).name}.\n{text}")
    write_json(_beside(path), results)
    load_robot(path)


def _beside(path: Path) -> Path:
    """Return the JSON file of a robot.yaml."""
    return path.with_suffix(".json")


def _addresses(config: RobotConfig, old: Path, folder: Path) -> dict[str, Any]:
    """Return the robot.yaml's relative addresses as seen from another folder."""
    if folder.resolve() == old.parent.resolve():
        return {}

    def seen(place: Path) -> str:
        return Path(os.path.relpath(place.resolve(), folder.resolve())).as_posix()

    urdf, meshes = find_urdf(config.urdf, old)
    changed: dict[str, Any] = {}
    if ":" not in config.urdf:
        changed = {"urdf": seen(urdf), "mesh_folder": seen(meshes)}
    if config.mesh_folder is not None:
        changed["mesh_folder"] = seen(old.parent / config.mesh_folder)
    if config.packages:
        changed["packages"] = {
            name: seen(old.parent / one) for name, one in config.packages.items()
        }
    return changed
