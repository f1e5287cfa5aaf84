"""A robot.yaml for an arm that somebody else has described."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import yaml

from besman.exceptions import RobotError
from besman.records import FloatArray
from besman.robot.collision import distances
from besman.robot.config import RobotConfig
from besman.robot.files.arm_base import split_at_base
from besman.robot.files.arm_chain import find_chain, find_tip, held_joints
from besman.robot.files.arm_files import check_name, free_name, write_arm, write_new
from besman.robot.files.joint_limits import assume_torques, parse_limit_list, read_joints
from besman.robot.files.known_limits import arm_titles, find_known_arm
from besman.robot.files.mesh_folders import (
    MeshFolders,
    find_mesh_folders,
    list_faults,
    places_tried,
    split_address,
)
from besman.robot.files.mjcf_file import CompiledArm, is_mjcf, read_mjcf
from besman.robot.files.second_reader import refuse_faults
from besman.robot.files.xacro_file import is_xacro, read_xacro
from besman.robot.model import (
    Robot,
    build_robot,
    joint_limits,
    load_robot,
    mount_tool,
    read_robot_urdf,
)
from besman.robot.urdf_file import place_meshes, read_urdf_text
from besman.work.display import Display, no_display

DESCRIPTIONS = (".urdf", ".xml", ".mjcf", ".xacro")
"""Endings of files that describe arms."""

_HEADER = """\
# Written by besman robots add from {urdf}. Look at every number, above all at those under assumed.
"""
_MOST_LISTED = 3
_HEAD_BYTES = 20_000


@dataclass(frozen=True)
class Wishes:
    """What a user may say about an arm that is brought in.

    Attributes
    ----------
    tip : str, optional
        Link that tools are mounted on; without it one is found.
    name : str, optional
        Name of the robot; without it the file's.
    folder : Path, optional
        Where the robot.yaml is written; without it beside the file.
    packages : dict of Path
        Folders of ``package://NAME``, by name.
    velocity, torque : str, optional
        Degrees/s and Nm, one number or one for each joint, where the file gives none.
    arguments : dict of str
        Of a xacro, by name.
    base : str, optional
        Link that the arm stands on: what moves it is held. Without it the root's.
    """

    tip: str | None = None
    name: str | None = None
    folder: Path | None = None
    packages: Mapping[str, Path] | None = None
    velocity: str | None = None
    torque: str | None = None
    arguments: Mapping[str, str] | None = None
    base: str | None = None


def add_robot(
    urdf: Path,
    tip: str | None = None,
    name: str | None = None,
    folder: Path | None = None,
    *,
    packages: Mapping[str, Path] | None = None,
    velocity: str | None = None,
    torque: str | None = None,
    arguments: Mapping[str, str] | None = None,
    base: str | None = None,
    show: Display = no_display,
) -> Path:
    """Write a robot.yaml for the arm that a file describes.

    Parameters
    ----------
    urdf : Path
        The URDF, xacro or MJCF; of the latter two a URDF is written too, of a MJCF its meshes.
    tip, name, folder, packages, velocity, torque, arguments, base
        See `Wishes`.
    show : Display, optional
        Shows how far it is.

    Returns
    -------
    Path
        ``NAME.yaml``, which can be loaded.

    Raises
    ------
    RobotError
        If the file cannot be used, the link is not there, more than one could be meant, the name is
        taken, or there is such a file already. Nothing is left behind then.
    """
    wishes = Wishes(tip, name, folder, packages, velocity, torque, arguments, base)
    if not urdf.is_file():
        raise RobotError(f"{urdf}: no such file; expected a URDF, xacro or MJCF")
    wanted = () if folder is None else (*reversed(folder.parents), folder)
    made = [one for one in wanted if not one.exists()]
    try:
        return _bring(urdf, wishes, show, made)
    except BaseException:
        for one in reversed(made):
            with suppress(OSError):
                one.rmdir() if one.is_dir() else one.unlink()
        raise


def _bring(file: Path, wishes: Wishes, show: Display, made: list[Path]) -> Path:
    """Write all files of an arm; each that is made is added to a list."""
    arm, wishes = _compile(file, wishes)
    tree = read_urdf_text(file) if arm is None else arm.tree
    name = check_name(wishes.name or free_name(str(tree.get("name", ""))), file)
    folder = wishes.folder or file.parent
    path = folder / f"{name}.yaml"
    if path.exists():
        raise RobotError(
            f"{path}: is there already; nothing is overwritten, give another --name or --out"
        )
    urdf, home = file, None
    if arm is not None:
        urdf, home = write_arm(arm, folder, name, made), arm.home
        tree = read_urdf_text(urdf)
    try:
        titles = arm_titles(tree, [file.stem, *(arm.parts if arm else []), name])
        content = _describe(tree, urdf, path, titles, wishes, show)
    except RobotError as error:
        # What was written of another file is deleted again: that one is named.
        raise RobotError(str(error).replace(str(urdf), str(file))) from None
    if arm is not None:
        content["assumed"] += arm.notes
    if home and _set_home(content, home, urdf, path):
        content["assumed"] = [one for one in content["assumed"] if not one.startswith("home")]
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None)
    write_new(path, _HEADER.format(urdf=file.name) + text)
    made.append(path)
    load_robot(path)
    return path


def _compile(file: Path, wishes: Wishes) -> tuple[CompiledArm | None, Wishes]:
    """Read what is no URDF yet; return None for one that is, and the packages that were found."""
    content = file.read_bytes()
    if is_mjcf(content[:_HEAD_BYTES]):
        return read_mjcf(file, (wishes.packages or {}).values()), wishes
    if not is_xacro(file, content):
        if wishes.arguments:
            raise RobotError(f"{file}: --arg: a URDF takes no arguments; expected a xacro")
        return None, wishes
    found = read_xacro(file, wishes.arguments or {}, wishes.packages or {})
    return CompiledArm(found.tree, notes=found.notes), replace(wishes, packages=found.packages)


def _set_home(content: dict[str, Any], home: Mapping[str, float], urdf: Path, path: Path) -> bool:
    """Take a home that the file gives, if it is within limits and nothing touches there."""
    given = [dict(joint) for joint in content["joints"]]
    for joint in given:
        joint["home_deg"] = round(math.degrees(home.get(joint["name"], math.nan)), 6)
        low, high = joint["position_deg"]
        if not low <= joint["home_deg"] <= high:
            return False
    config = _as_config(content | {"joints": given})
    robot = build_robot(config, "none", *read_robot_urdf(config, path), path, str(path))
    if distances(robot.chain, robot.home).min() <= 0:
        return False
    content["joints"] = given
    return True


def _describe(
    tree: ElementTree.Element,
    urdf: Path,
    path: Path,
    titles: list[str],
    wishes: Wishes,
    show: Display,
) -> dict[str, Any]:
    """Return the content of a robot.yaml; its limits may be known by what the arm is called."""
    tip = wishes.tip or find_tip(tree, urdf, wishes.base)
    chain = find_chain(tree, tip, urdf, wishes.base)
    held, standing = _held_values(tree, tip, urdf, wishes.base)
    names = [str(joint.get("name")) for joint in chain]
    known = find_known_arm(titles, len(chain))
    joints, assumed = read_joints(
        chain,
        urdf,
        parse_limit_list(wishes.velocity, "--velocity", names),
        parse_limit_list(wishes.torque, "--torque", names),
        known,
    )
    used = [joint["origin"][key] for joint in joints for key in joint["origin"]]
    if known is not None and known.arm in used:
        assumed.append(f"limits that the file does not give: {known.arm}'s, from {known.source}")
    refuse_faults(tree, urdf)
    notes = [] if wishes.tip else [f"tip: {tip}, the end of the longest chain"]
    folders, faults = _place_meshes(tree, urdf, wishes)
    base = path.parent.resolve()
    content = {
        "name": path.name.removesuffix(".yaml"),
        "urdf": _relative(urdf.resolve(), base),
        "tip": tip,
        "mesh_folder": _relative(folders.home, base),
        "packages": {key: _relative(one, base) for key, one in folders.packages.items()},
        "joints": joints,
        "held": held,
        "mounting": {"height_m": 0.0, "yaw_deg": 0.0, "pedestal_radius_m": 0.0},
    }
    notes += [f"joint {key} is held at {value:g}" for key, value in held.items()] + standing
    notes += [*folders.guessed, *faults]
    moves_about = bool(held) or bool(split_at_base(tree, tip, urdf, wishes.base)[0])
    return _complete(content, tree, urdf, path, [*notes, *assumed], moves_about, show)


def _relative(folder: Path, base: Path) -> str:
    """Return a path as seen from the folder of the robot.yaml."""
    return Path(os.path.relpath(folder, base)).as_posix()


def _held_values(
    tree: ElementTree.Element, tip: str, urdf: Path, base: str | None
) -> tuple[dict[str, float], list[str]]:
    """Return where joints before the tip are held: at zero, or as near as they can; and notes."""
    held, notes = {}, []
    below = split_at_base(tree, tip, urdf, base)[0]
    for joint in held_joints(tree, tip, urdf, base):
        limit, kind = joint.find("limit"), joint.get("type")
        if kind in ("planar", "floating") and joint in below:
            notes.append(f"joint {joint.get('name')} is {kind}: it is fixed")
            continue
        if kind != "prismatic" and joint not in below:
            raise RobotError(
                f"{urdf}: joint {joint.get('name')}: only hinges and sliding joints can be used, "
                f"got {kind!r:.60}"
            )
        ends = [0.0 if limit is None else float(limit.get(key, "0")) for key in ("lower", "upper")]
        least, most = (-math.inf, math.inf) if kind == "continuous" else (min(ends), max(ends))
        held[str(joint.get("name"))] = min(max(0.0, least), most)
    return held, notes


def _place_meshes(
    tree: ElementTree.Element, urdf: Path, wishes: Wishes
) -> tuple[MeshFolders, list[str]]:
    """Find the meshes; return their folders, and what is said of those that cannot be used."""
    inside = wishes.folder is not None and urdf.resolve().is_relative_to(wishes.folder.resolve())
    home = wishes.folder if inside else None
    folders = find_mesh_folders(tree, urdf, wishes.packages or {}, home)
    unusable: dict[str, str] = {}
    place_meshes(tree, urdf, folders.home, folders.packages, unusable)
    for address in unusable:
        inside_package = split_address(address)
        if inside_package is not None and inside_package[0] not in folders.packages:
            unusable[address] += f": {places_tried(address, urdf, folders)}"
    said = list_faults(unusable)
    if len(said) > _MOST_LISTED:
        said = [
            *said[:_MOST_LISTED],
            f"meshes cannot be used for {len(said) - _MOST_LISTED} more reasons",
        ]
    return folders, said


def _complete(
    content: dict[str, Any],
    tree: ElementTree.Element,
    urdf: Path,
    path: Path,
    notes: list[str],
    moves_about: bool,
    show: Display,
) -> dict[str, Any]:
    """Add what is computed: capsules, masses, torques, mounting, home, ignored pairs."""
    from besman.robot.files import assumed_masses, fitted_shapes
    from besman.robot.files.self_room import leave_room
    from besman.robot.files.standing import (
        arm_reach,
        assume_mounting,
        assume_tool_scale,
        base_offset,
        find_home,
        flange_rotation,
    )
    from besman.robot.mesh_reader import MeshReader
    from besman.robot.pinocchio_model import build_model

    def model_now() -> Any:
        config = _as_config(content)
        tool = mount_tool("none", config)
        return config, build_model(config, tool, joint_limits(config.joints), tree, urdf, path)[0]

    reader = MeshReader()
    notes += _visual_note(fitted_shapes.use_visual_shapes(tree))
    config, model = model_now()
    progress, end = show("capsules")
    content["capsules"], said = fitted_shapes.fit_shapes(
        model, config, tree, urdf, path, progress, reader
    )
    end(True)
    config = _as_config(content)
    content["inertia"], weights = assumed_masses.assume_masses(model, config)
    config, model = model_now()
    accelerations = [joint["acceleration_rad_s2"] for joint in content["joints"]]
    reach, shoulder = arm_reach(model, content["tip"])
    asked = (accelerations, content["tip"], reach)
    weights += assumed_masses.lighten_masses(content["inertia"], content["joints"], model, *asked)
    config, model = model_now()
    weights += assume_torques(content["joints"], model, *asked)
    content["mounting"] = assume_mounting(reach, shoulder, moves_about, base_offset(model, config))
    quaternion, flange = flange_rotation(model, content["tip"])
    if flange:
        content["flange_wxyz"] = [round(float(part), 9) for part in quaternion]
    progress, end = show("poses")

    arm_now = partial(_build_arm, content, tree, urdf, path)
    ignored = leave_room(content, arm_now, tree, urdf, reader, progress)
    found = _write_home(content["joints"], *find_home(arm_now(), reach))
    end(True)
    notes += [*said, *weights, *([flange] if flange else []), *ignored, found]
    content["tool_scale"], shorter = assume_tool_scale(reach)
    content["assumed"] = [*notes, *shorter, _mounting_note(content, reach)]
    return {key: value for key, value in content.items() if value or key == "mounting"}


def _build_arm(content: dict[str, Any], tree: ElementTree.Element, urdf: Path, path: Path) -> Robot:
    """Return the arm of what is known so far."""
    return build_robot(_as_config(content), "none", tree, urdf, path, str(path))


def _write_home(joints: list[dict[str, Any]], home: FloatArray, is_clear: bool) -> str:
    """Write the home (n,), rad, into the joints; return where it comes from."""
    for joint, angle in zip(joints, np.degrees(home), strict=True):
        joint["home_deg"] = round(float(angle), 6)
    return "home: found by a search" + ("" if is_clear else ", nothing clear was found")


def _visual_note(links: list[str]) -> list[str]:
    """Say that links are held against each other by what is seen of them."""
    text = f"shapes of {len(links)} links: visual ones, no collision shapes are given"
    return [text] if links else []


def _mounting_note(content: Mapping[str, Any], reach: float) -> str:
    """Say how the arm stands."""
    height = content["mounting"]["height_m"]
    return f"mounting: base {height:g} m above the floor, for a reach of {reach:.2f} m"


def _as_config(content: dict[str, Any]) -> RobotConfig:
    """Return what is known so far as a config; torques that are yet unknown are one."""
    joints = [joint | {"torque_nm": joint["torque_nm"] or 1.0} for joint in content["joints"]]
    try:
        return RobotConfig.model_validate(content | {"joints": joints})
    except ValueError as error:
        detail = str(error).splitlines()
        raise RobotError(f"{content['name']}: cannot be used: {'; '.join(detail[1:3])}") from error
