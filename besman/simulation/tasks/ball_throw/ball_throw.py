"""A ball lies in a scoop on the arm's tool and leaves it by contact physics alone.

The scoop is a plate with a rim of flat walls that lean outwards. Once the ball is clear of it, its
flight is ballistic, without drag, down to the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
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
from besman.simulation.task import TimeStep
from besman.simulation.tasks.stick_throw.throw_and_flight import (
    ThrowConfig,
    ThrownThing,
    ThrowSimulationConfig,
    ThrowSuccessConfig,
    simulate_throw,
)

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]

_WALL_M = 0.002  # half a wall's thickness
_N_WALLS = 8


class BallConfig(Config):
    """The ball, solid; by default a tennis ball's size and mass."""

    radius_m: Annotated[float, Field(gt=0.005, le=0.1)] = 0.033
    mass_kg: Positive = 0.058


class ScoopConfig(Config):
    """The scoop: a plate below the ball at the TCP, and a rim around it; open along TCP z.

    Attributes
    ----------
    depth_m : float
        Height of the rim above the plate.
    wall_deg : float
        Angle between the walls of the rim and the plate; 90 is a cup.
    clearance_m : float
        Between the ball on the plate and each wall.
    friction : float
        Coefficient of sliding friction between ball and scoop.
    """

    depth_m: Positive = 0.03
    wall_deg: Annotated[float, Field(ge=20, le=90)] = 60.0
    clearance_m: NotNegative = 0.002
    friction: NotNegative = 0.3


class BallThrowSimulationConfig(ThrowSimulationConfig):
    """How the throw is computed; see `ThrowSimulationConfig`."""

    time_step_s: TimeStep = 0.0015
    contact_time_s: Positive = 0.003


class BallThrowSuccessConfig(ThrowSuccessConfig):
    """A throw succeeds if it lands within this distance of the target, as in thesis 7.2.1."""

    success_radius_m: Positive = 0.10


class BallThrowConfig(ThrowConfig):
    """A ball is thrown at a target on the floor.

    Attributes
    ----------
    kind : "ball_throw"
    tool : str
        Tool of the robot that is the scoop: its TCP is the ball's centre, TCP z the opening.
    target_m : pair of float or None
        Target on the floor, metres ahead of the robot's base and to its left; null: the person's
        own, as ``select.target`` says.
    ball, scoop, simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["ball_throw"]
    tool: str = "scoop"
    target_m: tuple[float, float] | None = (2.0, 0.0)
    ball: BallConfig = BallConfig()
    scoop: ScoopConfig = ScoopConfig()
    simulation: BallThrowSimulationConfig = BallThrowSimulationConfig()
    success: BallThrowSuccessConfig = BallThrowSuccessConfig()

    needs: ClassVar[str] = (
        "target on the floor (target_m of the task, or one by select.target: select.object names "
        "the thrown object's marker, select.landing a landing file)"
    )

    def aimed_by_plan(self) -> BallThrowConfig:
        """Return the same task without a target of its own."""
        return self.model_copy(update={"target_m": None})

    def place(self, plan: AnyPlan, robot: Robot) -> AnyPlan:
        """Return the plan with the task's target, if it has one."""
        if self.target_m is None:
            return plan
        return replace(plan, target=np.array([*self.target_m, 0.0]))

    def simulate(
        self, robot: Robot, plans: Sequence[AnyPlan], movements: Movements, paths: bool
    ) -> Episodes:
        """Throw; the paths are those of the ball's centre."""
        model = ball_model(robot, self)
        initial = lay_in_tool(model, movements.positions[:, 0], 0.0)
        thing = thrown_ball(self)
        return simulate_throw(robot, self, model, initial, thing, movements, paths)


def thrown_ball(task: BallThrowConfig) -> ThrownThing:
    """Say of places of the ball when it is clear of the scoop, whatever simulates it."""

    def is_clear(place: FloatArray) -> npt.NDArray[np.bool_]:
        return np.asarray(np.linalg.norm(place, axis=-1) > task.simulation.clear_distance_m)

    def way_out(place: FloatArray) -> FloatArray:
        return np.asarray(place[..., 2] / task.scoop.depth_m)

    return ThrownThing("ball", is_clear, way_out)


@lru_cache(maxsize=8)
def ball_model(robot: Robot, task: BallThrowConfig) -> mujoco.MjModel:
    """Build the scene: arm, scoop, ball.

    Sensors: position of the ball in the frame of the tool centre point (3), position (3) and
    orientation (4, wxyz) of the tool centre point in the world.
    """
    import mujoco

    spec, last = arm_spec(robot, task.simulation.time_step_s)
    set_contact_options(spec)
    _add_scoop(add_tool_body(last, robot, "scoop"), task)
    ball = spec.worldbody.add_body(name="ball")
    ball.add_freejoint()
    ball.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[task.ball.radius_m, 0.0, 0.0],
        mass=task.ball.mass_kg,
        contype=0,
        conaffinity=ARM_BIT,
        **contact(task.simulation.contact_time_s, task.scoop.friction),
    )
    ball.add_site(name="ball")
    add_point_sensor(spec, "ball")
    add_tool_sensors(spec)
    fix_pairs(spec, "ball")
    return spec.compile()


def _add_scoop(scoop: Any, task: BallThrowConfig) -> None:
    """Add a plate and a rim."""
    import mujoco

    for pose, size in scoop_plates(task):
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, pose[:3, :3].ravel())
        scoop.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=pose[:3, 3],
            quat=quaternion,
            size=size,
            mass=0.0,
            contype=ARM_BIT,
            conaffinity=0,
            **contact(task.simulation.contact_time_s, task.scoop.friction),
        )


def scoop_plates(task: BallThrowConfig) -> list[tuple[FloatArray, FloatArray]]:
    """Return the plates of the scoop; every wall would touch a ball larger by the clearance.

    Returns
    -------
    list of (array (4, 4), array (3,))
        Poses in the frame of the tool centre point and half lengths, metres: the one below the
        ball, then the walls of the rim.
    """
    radius, steep = task.ball.radius_m, np.radians(task.scoop.wall_deg)
    reach = radius + task.scoop.clearance_m
    # Where the walls, tangents of the larger ball, meet the plate; and how long they are.
    foot = (reach - radius * np.cos(steep)) / np.sin(steep)
    length = task.scoop.depth_m / np.sin(steep)
    width = (foot + length * np.cos(steep)) * np.tan(np.pi / _N_WALLS) + _WALL_M
    below = np.eye(4)
    below[2, 3] = -radius - _WALL_M
    plates = [(below, np.array([foot, foot, _WALL_M]))]
    for turn in 2.0 * np.pi / _N_WALLS * np.arange(_N_WALLS):
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        along = np.cos(steep) * out + [0.0, 0.0, np.sin(steep)]
        inwards = -np.sin(steep) * out + [0.0, 0.0, np.cos(steep)]
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([np.cross(along, inwards), along, inwards])
        pose[:3, 3] = foot * out - [0.0, 0.0, radius] + 0.5 * length * along - _WALL_M * inwards
        plates.append((pose, np.array([width, length / 2, _WALL_M])))
    return plates
