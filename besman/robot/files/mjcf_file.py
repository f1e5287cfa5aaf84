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
from besman.robot.files.mjcf_meshes import compile_bare
from besman.robot.files.mjcf_sources import refuse_files_outside
from besman.robot.mujoco_log import silence_mujoco

FloatArray = npt.NDArray[np.float64]

_ROOT = re.compile(rb"<\s*(?:robot|mujoco)(?=[\s>/])")
# Sites that stand for a flange.
# Things have fewer: what floats and has as many is a robot.
_FEWEST_HINGES = 3
_FLANGE_SITE = re.compile(r"attachment|flange|tool0|(^|_)ee(_|$)|end_effector|grip_site", re.I)


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
    parts : list of str
        Names of the files that it includes, without their endings.
    """

    tree: ElementTree.Element
    meshes: dict[str, bytes] = field(default_factory=dict)
    home: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    parts: list[str] = field(default_factory=list)


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
        (`besman.robot.files.mjcf_sources`).
    allowed : collection of Path
        Further folders that may be read, those of ``--package``.

    Raises
    ------
    RobotError
        If MuJoCo does not compile it, or it includes files that are elsewhere.
    """
    parts = refuse_files_outside(path, allowed)
    silence_mujoco()
    try:
        model, notes = compile_bare(path)
    except ValueError as error:
        raise RobotError(f"{path}: cannot be used as MJCF: {in_one_line(error)}") from None
    root = ElementTree.fromstring(path.read_bytes())  # noqa: S314
    if model.nbody == 1 and root.find("body") is not None:
        raise RobotError(
            f"{path}: its bodies stand outside <worldbody>, where MuJoCo passes over them: a part "
            "of another file; expected the one that includes it"
        )
    arm = _Writer(model, root.get("model", path.stem)).write()
    arm.notes += notes
    arm.parts += [one.stem for one in parts]
    return arm


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
        stands = any(self._hinges(b) >= _FEWEST_HINGES for b in fixed)
        for body in range(1, self.model.nbody):
            parent = int(self.model.body_parentid[body])
            # What floats is no thing but a robot where nothing else has as many hinges.
            is_thing = stands or self._hinges(body) < _FEWEST_HINGES
            is_loose = bool(fixed) and self._is_free(body) and is_thing
            # A puck on rails: to be pushed by the robot that stands there.
            slides = int(self.model.body_jntnum[body]) > 0 and self._hinges(body) == 0
            if (parent == 0 and (is_loose or (stands and slides))) or parent in left_out:
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

    def _hinges(self, root: int) -> int:
        """Count the hinges of a body that hangs on the world, and of all that hangs on it."""
        own = self.model.body_rootid[self.model.jnt_bodyid] == root
        return int(np.sum(own & (np.array(self.model.jnt_type) == 3)))

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
        limit = {"lower": repr(float(low)), "upper": repr(float(high))}
        most = {"velocity": repr(self._speed(index)), "effort": repr(self._effort(index))}
        ElementTree.SubElement(joint, "limit", limit | most)
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
        for motor in self._motors(joint):
            gear = abs(float(model.actuator_gear[motor, 0]))
            if model.actuator_forcelimited[motor]:
                most += gear * float(np.abs(model.actuator_forcerange[motor]).max())
            elif model.actuator_ctrllimited[motor] and int(model.actuator_biastype[motor]) == 0:
                gain = abs(float(model.actuator_gainprm[motor, 0]))
                most += gear * gain * float(np.abs(model.actuator_ctrlrange[motor]).max())
        return most

    def _motors(self, joint: int) -> list[int]:
        """Return the motors of a joint, in its own frame or its parent's."""
        import mujoco

        model, kinds = self.model, mujoco.mjtTrn
        to_joint = np.isin(model.actuator_trntype, (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT))
        own = to_joint & (model.actuator_trnid[:, 0] == joint)
        return [int(one) for one in np.flatnonzero(own)]

    def _speed(self, joint: int) -> float:
        """Return the greatest speed that a joint's speed controllers take, 0 where it is not given.

        Such a one has a bias of -kv times the speed and none of the position.
        """
        model, most = self.model, 0.0
        for motor in self._motors(joint):
            gain = model.actuator_gainprm[motor, 0]
            stiffness, damping = model.actuator_biasprm[motor, 1:3]
            is_speed = gain > 0 and stiffness == 0 and np.isclose(damping, -gain)
            if is_speed and model.actuator_ctrllimited[motor] and model.actuator_gear[motor, 0]:
                fastest = np.abs(model.actuator_ctrlrange[motor]).max()
                most = max(most, float(fastest / abs(model.actuator_gear[motor, 0])))
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
