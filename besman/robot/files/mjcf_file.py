"""MJCF: what MuJoCo compiles of it, as a URDF and meshes."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from besman.exceptions import RobotError, in_one_line
from besman.robot.files.mesh_folders import folders_above, home_of
from besman.robot.files.mjcf_meshes import compile_without
from besman.robot.mujoco_log import silence_mujoco

FloatArray = npt.NDArray[np.float64]

_MOST_CHARACTERS = 20_000_000
_MOST_FILES = 200
_DECLARATION = re.compile(r"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)
_ROOT = re.compile(rb"<\s*(?:robot|mujoco)(?=[\s>/])")
# Sites that stand for a flange.
_FLANGE_SITE = re.compile(r"attachment|flange|tool0|(^|_)ee(_|$)|end_effector|grip_site", re.I)
_FOLDERS = ("meshdir", "texturedir", "assetdir")


@dataclass
class CompiledArm:
    """What a MJCF describes.

    Attributes
    ----------
    tree : Element
        A URDF; addresses of meshes are their names in `meshes`.
    meshes : dict of bytes
        Binary STL files, metres.
    home : dict of float
        Angles of the keyframe ``home`` by joint, rad; empty without one.
    notes : list of str
        What was left out.
    """

    tree: ElementTree.Element
    meshes: dict[str, bytes] = field(default_factory=dict)
    home: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def is_mjcf(content: bytes) -> bool:
    """Tell whether a file is MJCF by its first element."""
    found = _ROOT.search(content)
    return found is not None and b"mujoco" in found.group(0)


def read_mjcf(path: Path, allowed: Collection[Path] = ()) -> CompiledArm:
    """Compile a MJCF and describe what hangs on its world as a URDF.

    Parameters
    ----------
    path : Path
        The file; what it includes must be in its folder or below, or in its package
        (`besman.robot.files.mesh_folders.home_of`).
    allowed : collection of Path
        Further folders that may be read, those of ``--package``.

    Raises
    ------
    RobotError
        If MuJoCo does not compile it, or it includes files that are elsewhere.
    """
    import mujoco

    _refuse_files_outside(path, allowed)
    notes: list[str] = []
    silence_mujoco()
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        try:
            model, notes = compile_without(path)
        except ValueError:
            notes = []
        if not notes:
            raise RobotError(f"{path}: cannot be used as MJCF: {in_one_line(error)}") from None
    name = ElementTree.fromstring(path.read_bytes()).get("model", path.stem)  # noqa: S314
    arm = _Writer(model, name).write()
    arm.notes += notes
    return arm


def _refuse_files_outside(path: Path, allowed: Collection[Path]) -> None:
    """Refuse a MJCF that has entities, or reads what is not below its folders."""
    home = path.resolve().parent
    package = home_of(folders_above(path))
    roots = [home, package, *(one.resolve() for one in allowed)]
    waiting, seen = [path.resolve()], set[Path]()
    while waiting:
        file = waiting.pop()
        if file in seen or len(seen) > _MOST_FILES:
            continue
        seen.add(file)
        for one in _files_of(file, home, path):
            if not any(one.is_relative_to(root) for root in roots):
                raise RobotError(
                    f"{path}: the file {str(one)!r:.200} is outside {package}; expected what a "
                    "MJCF includes below that folder (robots add --package NAME=FOLDER: another "
                    "folder that may be read)"
                )
            if one.suffix.lower() in (".xml", ".mjcf") and one.is_file():
                waiting.append(one)


def _files_of(file: Path, home: Path, path: Path) -> list[Path]:
    """Return the files that a MJCF names, in every folder that they may be meant in."""
    try:
        text = file.read_text(encoding="utf-8")
        if len(text) > _MOST_CHARACTERS or _DECLARATION.search(text):
            raise RobotError(f"{path}: document types and entities are not allowed in a MJCF")
        # Entities are refused above.
        tree = ElementTree.fromstring(text)  # noqa: S314
    except (OSError, UnicodeDecodeError, ElementTree.ParseError) as error:
        raise RobotError(f"{path}: {file.name}: not valid XML: {in_one_line(error)}") from None
    folders = {home, file.parent}
    for compiler in tree.iter("compiler"):
        folders |= {home / compiler.get(key, "") for key in _FOLDERS}
    named = [one for element in tree.iter() for key, one in element.items()
             if key.startswith("file") and one]  # fmt: skip
    inside = [(folder / one).resolve() for folder in folders for one in named]
    outside = [folder.resolve() for folder in folders if named]
    return [*inside, *outside]


class _Writer:
    """Writes the bodies of a compiled model as links of a URDF."""

    def __init__(self, model: Any, name: str) -> None:
        self.model = model
        self.out = CompiledArm(ElementTree.Element("robot", {"name": name}))
        self.followed = self._couplings()

    def write(self) -> CompiledArm:
        """Write all bodies that hang on the world, and the angles of the keyframe."""
        self._link("world")
        left_out = set[int]()
        arms = [b for b in range(1, self.model.nbody) if self.model.body_parentid[b] == 0]
        fixed = [b for b in arms if not self._is_free(b)]
        for body in range(1, self.model.nbody):
            parent = int(self.model.body_parentid[body])
            is_loose = parent == 0 and bool(fixed) and self._is_free(body)
            if is_loose or parent in left_out:
                left_out.add(body)
                continue
            self._body(body, self._body_name(parent))
        if left_out:
            self.out.notes.append(f"{len(left_out)} bodies that lie loose are left out")
        if np.any(self.model.dof_armature > 0):
            self.out.notes.append("armature of the joints is left out")
        self._keyframe()
        return self.out

    def _is_free(self, body: int) -> bool:
        """Tell whether a body floats."""
        first, count = int(self.model.body_jntadr[body]), int(self.model.body_jntnum[body])
        return any(int(self.model.jnt_type[first + one]) == 0 for one in range(count))

    def _name(self, kind: str, index: int) -> str:
        """Return the name of a body, joint or site, or one that it gets."""
        return getattr(self.model, kind)(index).name or f"{kind}{index}"

    def _body_name(self, body: int) -> str:
        return "world" if body == 0 else self._name("body", body)

    def _link(self, name: str) -> ElementTree.Element:
        return ElementTree.SubElement(self.out.tree, "link", {"name": name})

    def _joint(
        self, name: str, kind: str, ends: tuple[str, str], place: FloatArray
    ) -> ElementTree.Element:
        """Add a joint at a pose (4, 4) in its parent."""
        joint = ElementTree.SubElement(self.out.tree, "joint", {"name": name, "type": kind})
        ElementTree.SubElement(joint, "parent", {"link": ends[0]})
        ElementTree.SubElement(joint, "child", {"link": ends[1]})
        joint.append(_origin(place))
        return joint

    def _body(self, body: int, parent: str) -> None:
        """Write a body: its joints, one after the other, then its link."""
        model, name = self.model, self._body_name(body)
        place = _pose(model.body_pos[body], model.body_quat[body])
        first = int(model.body_jntadr[body])
        for index in range(first, first + int(model.body_jntnum[body])):
            kind = int(model.jnt_type[index])
            if kind < 2:
                what = "floats" if kind == 0 else "has a ball joint"
                self.out.notes.append(f"body {name} {what}: it is fixed")
                continue
            anchor = np.array(model.jnt_pos[index])
            between = f"{name} {self._name('jnt', index)}"
            self._link(between)
            self._moving(index, (parent, between), place @ _shift(anchor))
            parent, place = between, _shift(-anchor)
        self._joint(f"{name} (fixed)", "fixed", (parent, name), place)
        link = self._link(name)
        self._inertial(link, body)
        self._shapes(link, body)
        for site in np.flatnonzero(model.site_bodyid == body):
            title = model.site(int(site)).name
            if not _FLANGE_SITE.search(title):
                continue
            bodies = {self._body_name(one) for one in range(model.nbody)}
            flange = f"{title} (site)" if title in bodies else title
            self._link(flange)
            pose = _pose(model.site_pos[site], model.site_quat[site])
            self._joint(f"{flange} (fixed)", "fixed", (name, flange), pose)

    def _moving(self, index: int, ends: tuple[str, str], place: FloatArray) -> None:
        """Write a hinge or sliding joint with its limits."""
        model = self.model
        axis, reference = model.jnt_axis[index], float(model.qpos0[model.jnt_qposadr[index]])
        is_hinge = int(model.jnt_type[index]) == 3
        if is_hinge:
            place = place @ _turn(axis, -reference)
        else:
            place = place @ _shift(-reference * np.array(axis))
        limited = bool(model.jnt_limited[index])
        kind = ("revolute" if limited else "continuous") if is_hinge else "prismatic"
        joint = self._joint(self._name("jnt", index), kind, ends, place)
        ElementTree.SubElement(joint, "axis", {"xyz": _words(axis)})
        low, high = model.jnt_range[index] if limited else (0.0, 0.0)
        limit = {"lower": repr(float(low)), "upper": repr(float(high)), "velocity": "0"}
        ElementTree.SubElement(joint, "limit", limit | {"effort": repr(self._effort(index))})
        dof = int(model.jnt_dofadr[index])
        losses = {
            "damping": repr(float(np.ravel(model.dof_damping[dof])[0])),
            "friction": repr(float(model.dof_frictionloss[dof])),
        }
        ElementTree.SubElement(joint, "dynamics", losses)
        if index in self.followed:
            ElementTree.SubElement(joint, "mimic", self.followed[index])

    def _effort(self, joint: int) -> float:
        """Return the greatest force of a joint's motors, 0 where it is not given."""
        model = self.model
        if model.jnt_actfrclimited[joint]:
            return float(np.abs(model.jnt_actfrcrange[joint]).max())
        most = 0.0
        for motor in range(model.nu):
            # Transmission 0: to a joint.
            if int(model.actuator_trntype[motor]) or int(model.actuator_trnid[motor, 0]) != joint:
                continue
            gear = abs(float(model.actuator_gear[motor, 0]))
            if model.actuator_forcelimited[motor]:
                most += gear * float(np.abs(model.actuator_forcerange[motor]).max())
            elif model.actuator_ctrllimited[motor] and int(model.actuator_biastype[motor]) == 0:
                gain = abs(float(model.actuator_gainprm[motor, 0]))
                most += gear * gain * float(np.abs(model.actuator_ctrlrange[motor]).max())
        return most

    def _couplings(self) -> dict[int, dict[str, str]]:
        """Return the joints that follow another one, as URDF's ``<mimic>``."""
        import mujoco

        model, found = self.model, {}
        for one in range(model.neq):
            other = int(model.eq_obj2id[one])
            if int(model.eq_type[one]) == int(mujoco.mjtEq.mjEQ_JOINT) and other >= 0:
                found[int(model.eq_obj1id[one])] = {
                    "joint": self._name("jnt", other),
                    "multiplier": repr(float(model.eq_data[one, 1])),
                    "offset": repr(float(model.eq_data[one, 0])),
                }
        return found

    def _inertial(self, link: ElementTree.Element, body: int) -> None:
        """Write mass and moments of inertia."""
        model = self.model
        if model.body_mass[body] <= 0:
            return
        inertial = ElementTree.SubElement(link, "inertial")
        inertial.append(_origin(_pose(model.body_ipos[body], model.body_iquat[body])))
        ElementTree.SubElement(inertial, "mass", {"value": repr(float(model.body_mass[body]))})
        moments = dict.fromkeys(("ixy", "ixz", "iyz"), "0")
        for key, value in zip(("ixx", "iyy", "izz"), model.body_inertia[body], strict=True):
            moments[key] = repr(float(value))
        ElementTree.SubElement(inertial, "inertia", moments)

    def _shapes(self, link: ElementTree.Element, body: int) -> None:
        """Write what a body is made of: what touches, else what is seen."""
        model = self.model
        all_of_it = np.flatnonzero(model.geom_bodyid == body)
        touching = [g for g in all_of_it if model.geom_contype[g] | model.geom_conaffinity[g]]
        for geom in touching or all_of_it:
            pose = _pose(model.geom_pos[geom], model.geom_quat[geom])
            for shift, shape in self._geometry(int(geom)):
                element = ElementTree.SubElement(link, "collision")
                element.append(_origin(pose @ _shift(np.array([0.0, 0.0, shift]))))
                ElementTree.SubElement(element, "geometry").append(shape)

    def _geometry(self, geom: int) -> list[tuple[float, ElementTree.Element]]:
        """Return a geom's shapes, each with how far along its z it is."""
        import mujoco

        kinds, size = mujoco.mjtGeom, [float(one) for one in self.model.geom_size[geom]]
        kind = int(self.model.geom_type[geom])
        if kind == kinds.mjGEOM_MESH:
            name = self._mesh(int(self.model.geom_dataid[geom]))
            return [(0.0, ElementTree.Element("mesh", {"filename": name}))]
        ball = ElementTree.Element("sphere", {"radius": repr(size[0])})
        if kind == kinds.mjGEOM_SPHERE:
            return [(0.0, ball)]
        if kind in (kinds.mjGEOM_CYLINDER, kinds.mjGEOM_CAPSULE):
            words = {"radius": repr(size[0]), "length": repr(2 * size[1])}
            middle = (0.0, ElementTree.Element("cylinder", words))
            round_ends = [(size[1], ball), (-size[1], ball)]
            return [middle, *(round_ends if kind == kinds.mjGEOM_CAPSULE else [])]
        if kind in (kinds.mjGEOM_BOX, kinds.mjGEOM_ELLIPSOID):
            words = {"size": _words(2 * np.array(size))}
            return [(0.0, ElementTree.Element("box", words))]
        return []

    def _mesh(self, mesh: int) -> str:
        """Add a mesh; return its name."""
        model = self.model
        name = re.sub(r"[^\w.-]+", "_", self._name("mesh", mesh)) + f"_{mesh}.stl"
        if name not in self.out.meshes:
            start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            first, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
            vertices = model.mesh_vert[start : start + count]
            self.out.meshes[name] = _stl(vertices[model.mesh_face[first : first + faces]])
        return name

    def _keyframe(self) -> None:
        """Take the angles of the keyframe ``home``."""
        model = self.model
        keys = [key for key in range(model.nkey) if model.key(key).name == "home"]
        for joint in range(model.njnt) if keys else ():
            if int(model.jnt_type[joint]) == 3:
                value = model.key_qpos[keys[0], model.jnt_qposadr[joint]]
                self.out.home[self._name("jnt", joint)] = float(value)


def _stl(corners: npt.NDArray[np.float32]) -> bytes:
    """Return triangles (F, 3, 3) as binary STL; its normals are left to the reader."""
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(corners), dtype=record)
    rows["corners"] = corners
    return b"\0" * 80 + len(rows).to_bytes(4, "little") + rows.tobytes()


def _words(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def _origin(pose: FloatArray) -> ElementTree.Element:
    """Return a URDF's ``<origin>``."""
    import pinocchio

    rpy = pinocchio.rpy.matrixToRpy(pose[:3, :3])
    return ElementTree.Element("origin", {"xyz": _words(pose[:3, 3]), "rpy": _words(rpy)})


def _pose(position: Any, quaternion: Any) -> FloatArray:
    """Return a pose (4, 4) of a position and a quaternion, w first."""
    import mujoco

    pose, rotation = np.eye(4), np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.asarray(quaternion, dtype=np.float64))
    pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), position
    return pose


def _shift(way: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = way
    return pose


def _turn(axis: Any, angle: float) -> FloatArray:
    """Return the turn (4, 4) by an angle about an axis."""
    half = angle / 2
    return _pose(np.zeros(3), [np.cos(half), *(np.sin(half) * np.asarray(axis))])
