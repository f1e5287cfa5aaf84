"""A stick lies in a holder on the arm's tool and leaves it by contact physics alone.

The arm is driven by its servos, the stick by gravity and by contact with the walls and the back
plate of the holder. Once its tail is clear of the opening, the flight of its centre of mass is
ballistic, down to the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.config.stage import Config, NotNegative, Positive
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.robot.mujoco_model import ARM_BIT, arm_spec
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.scenes import (
    add_point_sensor,
    add_tool_body,
    add_tool_sensors,
    contact,
    fix_pairs,
    lay_in_tool,
    set_contact_options,
)
from besman.simulation.tasks.stick_throw.throw_and_flight import (
    ThrowConfig,
    ThrownThing,
    simulate_throw,
)

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]

HALF_WALL_M = 0.003
"""Half the thickness of a holder's wall, metres."""
_PLATE_BIT = 2 * ARM_BIT
# A stick that rattles in its tube touches it for a step or two at a time, and what comes of walls
# that are hard at once is up to the step. These harden over half a millimetre of the four that the
# stick has: it lands as near to where it would with hard walls and a sixteenth of the step, and
# smoothly (`benchmarks/contacts.py`).
_IMPEDANCE = (0.5, 0.95, 0.0005, 0.5, 2.0)


class StickConfig(Config):
    """The stick: a rod with round ends and its mass spread evenly."""

    length_m: Annotated[float, Field(gt=0.05, le=2.0)] = 0.45
    radius_m: Annotated[float, Field(gt=0.001, le=0.02)] = 0.006
    mass_kg: Positive = 0.06


class HolderConfig(Config):
    """The holder: a square tube along TCP z, open in front; its back plate is at the TCP.

    Attributes
    ----------
    length_m : float
        From the back plate to the opening.
    clearance_m : float
        Between the stick's surface and each wall.
    friction : float
        Coefficient of sliding friction between stick and holder.
    """

    length_m: Positive = 0.15
    clearance_m: Positive = 0.002
    friction: NotNegative = 0.05


class StickThrowConfig(ThrowConfig):
    """A stick is thrown at a target on the floor.

    Attributes
    ----------
    kind : "stick_throw"
    tool : str
        Tool of the robot that the holder is mounted on.
    stick, holder, simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["stick_throw"]
    tool: str = "stick_holder"
    stick: StickConfig = StickConfig()
    holder: HolderConfig = HolderConfig()

    needs: ClassVar[str] = (
        "target on the floor (one by select.target: select.object names the thrown object's "
        "marker, select.landing a landing file)"
    )

    def simulate(
        self, robot: Robot, plans: Sequence[AnyPlan], movements: Movements, paths: bool
    ) -> Episodes:
        """Throw; the paths are those of the stick's centre."""
        return simulate_stick_throws(robot, self, movements, paths)


@lru_cache(maxsize=8)
def stick_throw_model(robot: Robot, task: StickThrowConfig) -> mujoco.MjModel:
    """Build the scene: arm, holder, stick.

    Sensors: position of the stick's tail in the frame of the tool centre point (3), position (3)
    and orientation (4, wxyz) of the tool centre point in the world.
    """
    import mujoco

    spec, last = arm_spec(robot, task.simulation.time_step_s)
    set_contact_options(spec)
    # Three contacts that slide most of the time: conjugate gradients get there in two thirds of
    # the time of Newton's method, whose Hessian changes with each of them. So solved the stick is
    # 2 um (median) from where it would be if they were solved to 1e-12.
    spec.option.solver = mujoco.mjtSolver.mjSOL_CG
    spec.option.tolerance = 1e-5
    holder = add_tool_body(last, robot, "holder")
    _add_holder(holder, task, holder_length(robot, task))
    stick = spec.worldbody.add_body(name="stick")
    stick.add_freejoint()
    _add_stick(stick, task)
    # The link that carries the holder encloses the stick's tail.
    spec.add_exclude(bodyname1=robot.joint_names[-1], bodyname2="stick")
    add_point_sensor(spec, "tail")
    add_tool_sensors(spec)
    fix_pairs(spec, "stick")
    return spec.compile()


def _contact(task: StickThrowConfig) -> dict[str, list[float]]:
    """Give the contact parameters of stick and holder."""
    return contact(task.simulation.contact_time_s, task.holder.friction, _IMPEDANCE)


def holder_length(robot: Robot, task: StickThrowConfig) -> float:
    """Return how long the tube is, metres: a small arm's is shorter."""
    return task.holder.length_m * robot.tool.scale


def _add_holder(holder: Any, task: StickThrowConfig, length: float) -> None:
    """Add a square tube: plates that the stick's tail meets, and a lip that its shaft meets.

    A rod that is longer than its tube touches it with its tail and at the opening only. Both are
    pairs of shapes with one contact point that moves smoothly, which a long rod on a flat wall
    is not.
    """
    import mujoco

    inner = task.stick.radius_m + task.holder.clearance_m
    outer = inner + 2 * HALF_WALL_M
    plates = [([0.0, 0.0, -HALF_WALL_M], [outer, outer, HALF_WALL_M])]
    for axis, side in product((0, 1), (-1.0, 1.0)):
        position, size = [0.0, 0.0, length / 2], [outer, outer, length / 2]
        position[axis], size[axis] = side * (inner + HALF_WALL_M), HALF_WALL_M
        plates.append((position, size))
        ends = np.zeros((2, 3))
        ends[:, 2], ends[:, axis] = length - HALF_WALL_M, side * (inner + HALF_WALL_M)
        ends[:, 1 - axis] = -outer, outer
        holder.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=ends.ravel(),
            size=[HALF_WALL_M, 0.0, 0.0],
            mass=0.0,
            contype=ARM_BIT,
            conaffinity=0,
            **_contact(task),
        )
    for position, size in plates:
        holder.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=position,
            size=size,
            mass=0.0,
            contype=_PLATE_BIT,
            conaffinity=0,
            **_contact(task),
        )


def _add_stick(stick: Any, task: StickThrowConfig) -> None:
    """Add a rod along z; its tail alone meets the holder's plates."""
    import mujoco

    half, radius = task.stick.length_m / 2, task.stick.radius_m
    stick.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[radius, half - radius, 0.0],
        mass=task.stick.mass_kg,
        contype=0,
        conaffinity=ARM_BIT,
        **_contact(task),
    )
    stick.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        pos=[0.0, 0.0, radius - half],
        size=[radius, 0.0, 0.0],
        mass=0.0,
        contype=0,
        conaffinity=_PLATE_BIT,
        **_contact(task),
    )
    stick.add_site(name="tail", pos=[0.0, 0.0, -half])


def simulate_stick_throws(
    robot: Robot, task: StickThrowConfig, movements: Movements, paths: bool = False
) -> Episodes:
    """Throw.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : StickThrowConfig
        Scene and criteria.
    movements : Movements
        Sampled at the task's time step, for at least `longest_wait_s` after they end.
    paths : bool
        Whether to give the stick's path.

    Returns
    -------
    Episodes
        Outcomes are where the stick's centre of mass meets the floor z = 0.
    """
    model = stick_throw_model(robot, task)
    initial = lay_in_tool(model, movements.positions[:, 0], task.stick.length_m / 2)
    return simulate_throw(robot, task, model, initial, thrown_stick(robot, task), movements, paths)


def thrown_stick(robot: Robot, task: StickThrowConfig) -> ThrownThing:
    """Say of places of the stick's tail when it is clear of the holder, whatever simulates it."""
    length = holder_length(robot, task)

    def is_clear(tail: FloatArray) -> npt.NDArray[np.bool_]:
        ahead = tail[..., 2] - length
        aside = np.hypot(tail[..., 0], tail[..., 1])
        outside = (ahead > 0) | (aside > 2 * (task.stick.radius_m + task.holder.clearance_m))
        return np.asarray(outside & (np.hypot(ahead, aside) > task.simulation.clear_distance_m))

    def way_out(tail: FloatArray) -> FloatArray:
        return np.asarray(tail[..., 2] / length)

    return ThrownThing("stick", is_clear, way_out)
