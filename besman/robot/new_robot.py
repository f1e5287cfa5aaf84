"""A robot.yaml for an arm of which there is a URDF."""

from __future__ import annotations

import io
import logging
import math
import os
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import yaml

from besman.exceptions import BesmanError, RobotError, in_one_line, nearest
from besman.foreign.numbers import parse_number
from besman.foreign.urdf_text import joint_ends, link_names
from besman.robot.model import list_robots, load_robot
from besman.robot.urdf_file import read_urdf

# URDF has no limits of acceleration; this is what planners take for arms of which nothing is known.
_ACCELERATION_RAD_S2 = 10.0
_RESERVED = ("add", "check")
_HEADER = """\
# Written by besman robots add from {urdf}. Look at every number, above all at those under assumed.
"""


def add_robot(urdf: Path, tip: str, name: str | None = None, folder: Path | None = None) -> Path:
    """Write a robot.yaml for the chain from a URDF's root to a link.

    Parameters
    ----------
    urdf : Path
        The URDF.
    tip : str
        Link that tools are mounted on, z pointing away from the arm.
    name : str, optional
        Name of the robot; without it the URDF's.
    folder : Path, optional
        Where robot.yaml is written; without it beside the URDF. Meshes may be below it only.

    Returns
    -------
    Path
        The robot.yaml, which can be loaded.

    Raises
    ------
    RobotError
        If the URDF cannot be used, the link is not there, a limit is missing, the name is taken,
        or there is a robot.yaml already.
    """
    if not urdf.is_file():
        raise RobotError(f"{urdf}: no such file; expected a URDF")
    path = (folder or urdf.parent) / "robot.yaml"
    if path.exists():
        raise RobotError(f"{path}: is there already; nothing is overwritten, give another --out")
    inside = folder is not None and urdf.resolve().is_relative_to(folder.resolve())
    tree = read_urdf(urdf, folder if inside and folder is not None else urdf.parent)
    name = _check_name(name or str(tree.get("name", "")), urdf)
    content, assumed = _describe(find_chain(tree, tip, urdf), urdf)
    _validate(tree, urdf)
    source = os.path.relpath(urdf.resolve(), path.parent.resolve())
    content = {"name": name, "urdf": Path(source).as_posix(), "tip": tip} | content
    content["assumed"] = assumed
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None)
    _write_new(path, _HEADER.format(urdf=urdf.name) + text)
    try:
        load_robot(path)
    except BesmanError:
        path.unlink()
        raise
    return path


def _write_new(path: Path, text: str) -> None:
    """Write a file that is not there; one that came into being meanwhile is not overwritten."""
    made = False
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            made = True
            file.write(text)
    except OSError as error:
        if made:
            path.unlink(missing_ok=True)
        raise RobotError(f"{path}: cannot be written: {error.strerror}") from None


def _check_name(name: str, urdf: Path) -> str:
    """Refuse names that cannot be used or are taken."""
    if not re.fullmatch(r"[A-Za-z0-9][\w.-]*", name) or name in _RESERVED:
        raise RobotError(
            f"{urdf}: name: got {name!r}, expected letters, digits, '_', '.' and '-', and none of "
            f"{', '.join(_RESERVED)}; give one with --name"
        )
    if name in list_robots():
        raise RobotError(f"{urdf}: name: there is a robot {name!r} already; give another --name")
    return name


def _validate(tree: ElementTree.Element, urdf: Path) -> None:
    """Refuse what a second reader of URDFs finds wrong."""
    import yourdfpy

    # The library logs what it then raises.
    logging.getLogger("yourdfpy.urdf").setLevel(logging.CRITICAL)
    text = ElementTree.tostring(tree, encoding="utf-8")
    try:
        robot = yourdfpy.URDF.load(io.BytesIO(text), build_scene_graph=False, load_meshes=False)
        robot.validate()
        faults = [in_one_line(error) for error in robot.errors]
    except (ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
        faults = [in_one_line(error)]
    if faults:
        more = f"; and {len(faults) - 3} more" if len(faults) > 3 else ""
        raise RobotError(f"{urdf}: cannot be used as URDF: {'; '.join(faults[:3])}{more}")


def find_chain(tree: ElementTree.Element, tip: str, urdf: Path) -> list[ElementTree.Element]:
    """Return the moving joints from the root to a link.

    Raises
    ------
    RobotError
        If the link is not there, or nothing moves it.
    """
    links = link_names(tree)
    if tip not in links:
        raise RobotError(f"{urdf}: tip: no link {tip!r}; {nearest(tip, links)}")
    above = {joint_ends(joint)[1]: joint for joint in tree.findall("joint")}
    chain: list[ElementTree.Element] = []
    link = tip
    while link in above:
        chain.insert(0, above[link])
        link = joint_ends(above[link])[0]
    chain = [joint for joint in chain if joint.get("type") != "fixed"]
    if not chain:
        raise RobotError(f"{urdf}: tip: no joint moves the link {tip!r}")
    return chain


def _describe(chain: list[ElementTree.Element], urdf: Path) -> tuple[dict[str, Any], list[str]]:
    """Return the joints, mounting and tools of a robot.yaml, and what is assumed in it."""
    joints, assumed = [], []
    for joint in chain:
        name, kind = str(joint.get("name")), joint.get("type")
        if kind not in ("revolute", "continuous"):
            raise RobotError(f"{urdf}: joint {name}: only hinges can be used, got {kind!r}")
        speed, torque = _limit(joint, "velocity", urdf), _limit(joint, "effort", urdf)
        if kind == "continuous":
            low, high = -360.0, 360.0
            assumed.append(f"position of {name}, which is continuous")
        else:
            low, high = (math.degrees(_number(joint, key, urdf)) for key in ("lower", "upper"))
        if not low < high:
            raise RobotError(
                f"{urdf}: joint {name}: expected <limit> with lower below upper, got "
                f"{math.radians(low):g} and {math.radians(high):g}"
            )
        home = 0.0 if low < 0.0 < high else (low + high) / 2
        joints.append(
            {
                "name": name,
                "position_deg": [_rounded(low), _rounded(high)],
                "velocity_deg_s": _rounded(math.degrees(speed)),
                "acceleration_rad_s2": _ACCELERATION_RAD_S2,
                "torque_nm": torque,
                "home_deg": _rounded(home),
            }
        )
    assumed += ["accelerations of all joints", "home", "mounting: base on the floor"]
    # A person's fingers point where the tool points.
    hand = {"hand_to_tcp_wxyz": [_rounded(v) for v in (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)]}
    content = {
        "joints": joints,
        "mounting": {"height_m": 0.0, "yaw_deg": 0.0, "pedestal_radius_m": 0.0},
        "tools": {"none": hand},
        "default_tool": "none",
    }
    return content, assumed


def _limit(joint: ElementTree.Element, key: str, urdf: Path) -> float:
    """Read a limit that must be above zero."""
    value = _number(joint, key, urdf)
    if not value > 0:
        raise RobotError(
            f"{urdf}: joint {joint.get('name')}: <limit> {key}: got {value:g}, expected more than 0"
        )
    return value


def _number(joint: ElementTree.Element, key: str, urdf: Path) -> float:
    """Read a number of a joint's ``<limit>``."""
    element = joint.find("limit")
    text = None if element is None else element.get(key)
    try:
        value = parse_number(str(text))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RobotError(
            f"{urdf}: joint {joint.get('name')}: <limit> {key}: got {text!r:.60}, expected a "
            "number; limits of position, velocity and effort are needed"
        )
    return value


def _rounded(value: float) -> float:
    """Round to what a person would write."""
    return round(float(value), 6)
