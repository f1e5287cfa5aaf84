"""The arm in Drake, and the shapes that touch: rebuilt from the same robot and task as in MuJoCo.

Contact is hydroelastic: a compliant solid whose pressure grows with depth meets a rigid surface,
and forces act on the whole patch between them [1]_. MuJoCo has soft constraints at points in its
place, so that what both engines say does not hang on one model of contact.

References
----------
.. [1] R. Elandt, E. Drumwright, M. Sherman, A. Ruina: A pressure field model for fast, robust
   approximation of net contact force and moment between nominally rigid objects, IROS 2019,
   DOI 10.1109/IROS40897.2019.8968548.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.exceptions import VerificationError, in_one_line, why_not_there
from besman.robot.dynamics import true_inertias
from besman.robot.model import Robot
from besman.robot.mujoco_model import servo_gains
from besman.robot.parts import GRAVITY

FloatArray = npt.NDArray[np.float64]

# A capsule without length is a sphere.
_LEAST_LENGTH_M = 1e-6
# Drake wants a stiffness for each servo; that of a brake on a hinge is none.
_NO_STIFFNESS = 1e-9
# A dry friction is full from this speed on.
_STICTION_RAD_S = 1e-3


@dataclass(frozen=True)
class ContactModel:
    """What Drake wants to know of contacts and the task does not say.

    Attributes
    ----------
    modulus_pa : float
        Hydroelastic modulus of what is thrown or pulled: that of PTFE, the softer of the two.
    dissipation_s_m : float
        Hunt and Crossley's: what strikes at 1 / dissipation keeps half of its speed.
    edge_m : float
        Longest edge of the meshes of its surface.
    substeps : int
        Steps for each step of the task.
    """

    modulus_pa: float = 5e8
    dissipation_s_m: float = 20.0
    edge_m: float = 0.003
    substeps: int = 2


@dataclass(eq=False)
class DrakeScene:
    """A scene that is being built, then simulated.

    Parameters
    ----------
    robot : Robot
        The arm with its tool.
    time_step_s : float
        Of the task: the servos get their set-points so often.
    friction : float
        Coefficient of sliding friction of the contacts.
    contact : ContactModel

    Attributes
    ----------
    plant, graph, diagram : MultibodyPlant, SceneGraph, Diagram
        The diagram is there once `finish` was called.
    arm : ModelInstanceIndex
    links : list of RigidBody
        World first; the last one carries the tool.
    tcp : Frame
        The tool centre point.
    brakes : list of ModelInstanceIndex
        Of hinges with dry friction.
    """

    robot: Robot
    time_step_s: float
    friction: float
    contact: ContactModel = ContactModel()
    plant: Any = field(init=False)
    graph: Any = field(init=False)
    diagram: Any = field(init=False, default=None)
    arm: Any = field(init=False)
    links: list[Any] = field(init=False)
    tcp: Any = field(init=False)
    brakes: list[Any] = field(init=False, default_factory=list)
    _builder: Any = field(init=False)
    _n_arm_brakes: int = field(init=False, default=0)
    _arm_shapes: list[Any] = field(init=False, default_factory=list)
    _last_link_shapes: list[Any] = field(init=False, default_factory=list)
    _thing_shapes: list[Any] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        modules = load_drake()
        self._builder = modules.framework.DiagramBuilder()
        self.plant, self.graph = modules.plant.AddMultibodyPlantSceneGraph(
            self._builder, self.time_step_s / self.contact.substeps
        )
        plant = self.plant
        plant.set_contact_model(modules.plant.ContactModel.kHydroelasticWithFallback)
        # Friction goes with the normal impulse of the same step. The lagged model takes that of the
        # step before, as stiff as a contact is then: what strikes loses fifty times too much speed.
        plant.set_discrete_contact_approximation(
            modules.plant.DiscreteContactApproximation.kSimilar
        )
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -GRAVITY])
        self._add_arm()
        tip = self.robot.chain.tip
        self.tcp = plant.AddFrame(
            modules.tree.FixedOffsetFrame("tcp", self.links[-1].body_frame(), as_transform(tip))
        )

    def _add_arm(self) -> None:
        """Add links, hinges and servos."""
        modules, plant, robot = load_drake(), self.plant, self.robot
        self.arm = plant.AddModelInstance("arm")
        chain, inertias, gains = robot.chain, true_inertias(robot), servo_gains(robot)
        drives = robot.drives
        self.links, hinges = [plant.world_body()], []
        for index, name in enumerate(robot.joint_names):
            tensor = inertias.tensors[index]
            try:
                inertia = modules.tree.SpatialInertia.MakeFromCentralInertia(
                    inertias.masses[index],
                    inertias.centres[index],
                    modules.tree.RotationalInertia(
                        *np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]
                    ),
                )
            except RuntimeError as error:
                raise VerificationError(
                    f"joint {name}: drake takes no such inertia: {in_one_line(error)}"
                ) from None
            link = plant.AddRigidBody(name, self.arm, inertia)
            joint = plant.AddJoint(
                modules.tree.RevoluteJoint(
                    name,
                    self._mount(f"{name}_mount", self.links[-1], chain.placements[index]),
                    link.body_frame(),
                    chain.axes[index],
                    drives.damping[index],
                )
            )
            servo = plant.AddJointActuator(name, joint, robot.limits.torque[index])
            stiffer = drives.gains[index]
            servo.set_controller_gains(
                modules.tree.PdControllerGains(
                    p=stiffer * gains.kp[index], d=stiffer * gains.kv[index]
                )
            )
            self.links.append(link)
            hinges.append(joint)
        # After the servos: what these are asked for comes first.
        for joint, torque in zip(hinges, drives.friction, strict=True):
            if torque > 0:
                self._add_dry_friction(joint, torque)
                self._n_arm_brakes += 1
        for index, radius in enumerate(chain.capsule_radii):
            if chain.capsule_links[index] != "tool":
                self._add_link_shape(chain.capsule_joints[index] + 1, index, radius)

    def _add_link_shape(self, link: int, index: int, radius: float) -> None:
        """Add a capsule of a link."""
        ends = self.robot.chain.capsule_ends[index]
        shape = self.add_rod(self.links[link], ends[0], ends[1], radius, False)
        if link == len(self.links) - 1:
            self._last_link_shapes.append(shape)

    def _mount(self, name: str, parent: Any, pose: FloatArray) -> Any:
        """Add a frame to a body."""
        offset = load_drake().tree.FixedOffsetFrame(name, parent.body_frame(), as_transform(pose))
        return self.plant.AddFrame(offset)

    def add_rod(
        self, body: Any, first: FloatArray, second: FloatArray, radius: float, is_thing: bool
    ) -> Any:
        """Add a capsule from a place to another one in the body's frame, metres.

        Parameters
        ----------
        body : RigidBody
        first, second : array, shape (3,)
        radius : float
        is_thing : bool
            Whether it is what is thrown or pulled: compliant, and it meets what is not.
        """
        geometry = load_drake().geometry
        length = float(np.linalg.norm(second - first))
        pose = np.eye(4)
        pose[:3, 3] = (first + second) / 2
        if length < _LEAST_LENGTH_M:
            return self.add_shape(body, pose, geometry.Sphere(radius), is_thing)
        pose[:3, :3] = _turn_to((second - first) / length)
        return self.add_shape(body, pose, geometry.Capsule(radius, length), is_thing)

    def add_box(self, body: Any, pose: FloatArray, half: npt.ArrayLike) -> Any:
        """Add a rigid box with half lengths (3,), metres, at a pose (4, 4) in the body's frame."""
        box = load_drake().geometry.Box(*(2.0 * np.asarray(half, dtype=np.float64)))
        return self.add_shape(body, pose, box, False)

    def add_shape(self, body: Any, pose: FloatArray, shape: Any, is_thing: bool) -> Any:
        """Add a shape at a pose (4, 4) in the body's frame; see `add_rod`."""
        modules, contact = load_drake(), self.contact
        properties = modules.geometry.ProximityProperties()
        if is_thing:
            modules.geometry.AddCompliantHydroelasticProperties(
                contact.edge_m, contact.modulus_pa, properties
            )
        else:
            modules.geometry.AddRigidHydroelasticProperties(4 * contact.edge_m, properties)
        modules.geometry.AddContactMaterial(
            dissipation=contact.dissipation_s_m,
            friction=modules.plant.CoulombFriction(self.friction, self.friction),
            properties=properties,
        )
        mine = self._thing_shapes if is_thing else self._arm_shapes
        shape_id = self.plant.RegisterCollisionGeometry(
            body, as_transform(pose), shape, f"shape{len(mine)}", properties
        )
        mine.append(shape_id)
        return shape_id

    def add_free_rod(self, name: str, length: float, radius: float, mass: float) -> Any:
        """Add a free body: a solid capsule along z, whole length in metres, frame in its middle."""
        inertia = load_drake().tree.SpatialInertia.SolidCapsuleWithMass(
            mass, radius, length - 2 * radius, [0.0, 0.0, 1.0]
        )
        body = self.plant.AddRigidBody(name, self.plant.AddModelInstance(name), inertia)
        end = np.array([0.0, 0.0, length / 2 - radius])
        self.add_rod(body, -end, end, radius, True)
        return body

    def add_free_ball(self, name: str, radius: float, mass: float) -> Any:
        """Add a free body: a solid ball, frame in its middle."""
        inertia = load_drake().tree.SpatialInertia.SolidSphereWithMass(mass, radius)
        body = self.plant.AddRigidBody(name, self.plant.AddModelInstance(name), inertia)
        self.add_rod(body, np.zeros(3), np.zeros(3), radius, True)
        return body

    def add_brake(self, joint: Any, torque: float) -> None:
        """Let a hinge that has no servo have a dry friction (Nm)."""
        self._add_dry_friction(joint, torque)
        self.brakes.append(joint.model_instance())

    def asked_state(self, setpoints: FloatArray) -> FloatArray:
        """Return what is asked of the arm's servos and brakes for set-points (n,), rad."""
        rest = np.zeros(len(setpoints) + 2 * self._n_arm_brakes)
        return np.concatenate([setpoints, rest])

    def _add_dry_friction(self, joint: Any, torque: float) -> None:
        """Add a damper whose torque (Nm) is limited."""
        brake = self.plant.AddJointActuator(f"{joint.name()}_friction", joint, torque)
        brake.set_controller_gains(
            load_drake().tree.PdControllerGains(p=_NO_STIFFNESS, d=torque / _STICTION_RAD_S)
        )

    def finish(self, last_link_is_apart: bool = False) -> None:
        """End the building.

        Parameters
        ----------
        last_link_is_apart : bool
            Whether the link that carries the tool does not meet what is thrown.
        """
        geometry = load_drake().geometry
        self.plant.Finalize()
        # Self-collision is measured on the movement itself, exactly and without contact forces.
        apart = geometry.CollisionFilterDeclaration()
        apart.ExcludeWithin(geometry.GeometrySet(self._arm_shapes))
        if last_link_is_apart:
            apart.ExcludeBetween(
                geometry.GeometrySet(self._last_link_shapes),
                geometry.GeometrySet(self._thing_shapes),
            )
        self.graph.collision_filter_manager().Apply(apart)
        self.diagram = self._builder.Build()


@dataclass(frozen=True)
class DrakeModules:
    """The modules of Drake that scenes need."""

    framework: Any
    analysis: Any
    geometry: Any
    math: Any
    plant: Any
    tree: Any


def load_drake() -> DrakeModules:
    """Import Drake.

    Raises
    ------
    VerificationError
        If it is not installed.
    """
    try:
        from pydrake import geometry, math
        from pydrake.multibody import plant, tree
        from pydrake.systems import analysis, framework
    except ImportError as error:
        why = why_not_there(error, "pydrake", "besman[verify]")
        raise VerificationError(f"verify: {why}") from None
    return DrakeModules(framework, analysis, geometry, math, plant, tree)


def as_transform(pose: FloatArray) -> Any:
    """Return a pose (4, 4) as Drake's rigid transform."""
    return load_drake().math.RigidTransform(np.asarray(pose, dtype=np.float64))


def _turn_to(direction: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) that takes z to a direction (3,) of length 1."""
    aside = np.eye(3)[np.abs(direction).argmin()]
    x = np.cross(aside, direction)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(direction, x), direction])
