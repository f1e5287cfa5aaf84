"""A hinged lever with friction is pulled by a hook on the arm's tool.

The lever stands where the demonstration pulled one: its handle begins where the demonstrated
movement begins, and its hinge is where the handle's arc also passes through the movement's end.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

import mujoco
import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.exceptions import RefinementError
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.robot.mujoco_model import ARM_BIT, arm_spec, matrix_to_quaternion, servo_controls
from besman.simulation.episodes import Episodes, Movements, Playback, arm_failure, tracking_errors
from besman.simulation.physics import Run, run_physics
from besman.simulation.scenes import (
    add_tool_body,
    add_tool_capsule,
    add_tool_sensors,
    contact,
    set_contact_options,
)
from besman.simulation.task import (
    ContactSimulationConfig,
    NotNegative,
    Positive,
    RewardConfig,
    SuccessConfig,
    Task,
    Triple,
)
from besman.stage import Config

FloatArray = npt.NDArray[np.float64]

# A chord that is steeper than this does not tell which way is ahead.
_LEAST_LEVEL_M = 0.02
# Nor is a level pull's arc ahead of it; it is above.
_LEAST_BULGE = 1e-3
# Columns of a sensor, see `lever_model`.
_HANDLE = slice(7, 10)


class LeverConfig(Config):
    """The lever: a bar with a handle across its end, on a horizontal hinge.

    Attributes
    ----------
    length_m : float
        From the hinge's axis to the handle's.
    handle_length_m, handle_radius_m : float
        Of the handle.
    bar_side : "left" or "right"
        End of the handle that the bar is at, seen by who pulls; the other leaves room for the arm.
    mass_kg : float
        Spread evenly along the bar.
    friction_nm : float
        Torque of the hinge's dry friction; enough to hold the lever where it is.
    damping_nms : float
        Torque per rad/s of its viscous friction.
    pull_deg : float
        How far it is to be pulled.
    stop_deg : float
        Where it comes to a stop.
    offset_m : triple of float
        Where it stands off the demonstrated place, metres in the robot's world.
    """

    length_m: Positive = 0.28
    handle_length_m: Positive = 0.2
    handle_radius_m: Positive = 0.012
    bar_side: Literal["left", "right"] = "left"
    mass_kg: Positive = 1.0
    friction_nm: NotNegative = 8.0
    damping_nms: NotNegative = 0.5
    pull_deg: Annotated[float, Field(gt=0, lt=170)] = 50.0
    stop_deg: Annotated[float, Field(gt=0, lt=180)] = 100.0
    offset_m: Triple = (0.0, 0.0, 0.0)


class HookConfig(Config):
    """The hook: rods behind, over and in front of the handle, open towards TCP x.

    Attributes
    ----------
    rod_radius_m : float
        Of each rod.
    clearance_m : float
        Between rods and a handle whose axis is at the TCP.
    tip_m : float
        How far the rod in front reaches beyond the handle's axis.
    friction : float
        Coefficient of sliding friction between hook and handle.
    """

    rod_radius_m: Positive = 0.008
    clearance_m: NotNegative = 0.008
    tip_m: NotNegative = 0.01
    friction: NotNegative = 0.3


class LeverSimulationConfig(ContactSimulationConfig):
    """How pulling is computed.

    Attributes
    ----------
    time_step_s, contact_time_s
        See `ContactSimulationConfig`.
    settling_s : float
        The lever is looked at this long after the end of the movement.
    """

    settling_s: NotNegative = 0.2


class LeverRewardConfig(RewardConfig):
    """Reward of pulling: minus the sum of these terms and those of `RewardConfig`.

    Attributes
    ----------
    miss_per_m : float
        Times the arc that the handle's way is short of `pull_deg`.
    slip_per_m : float
        Times the distance between hook and handle at the end.
    """

    miss_per_m: NotNegative = 5.0
    slip_per_m: NotNegative = 1.0


class LeverSuccessConfig(SuccessConfig):
    """Pulling succeeds if the handle's way is at most this much short of `pull_deg`."""

    success_radius_m: Positive = 0.02


class PullLeverConfig(Task):
    """A lever is pulled beyond an angle.

    Attributes
    ----------
    kind : "pull_lever"
    tool : str
        Tool of the robot that is the hook: its TCP is the handle's axis, TCP z points ahead and
        TCP x where the hook is open.
    lever, hook, simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["pull_lever"]
    tool: str = "hook"
    lever: LeverConfig = LeverConfig()
    hook: HookConfig = HookConfig()
    simulation: LeverSimulationConfig = LeverSimulationConfig()
    reward: LeverRewardConfig = LeverRewardConfig()
    success: LeverSuccessConfig = LeverSuccessConfig()

    needs: ClassVar[str] = "demonstrated start and end pose"
    worst: ClassVar[dict[str, float]] = {"slip_m": 1.0}

    @property
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement, seconds."""
        return self.simulation.settling_s

    def place(self, plan: AnyPlan, robot: Robot) -> AnyPlan:
        """Return the plan with the handle's place after the pull as its target."""
        if not np.isfinite([plan.start_pose, plan.goal_pose]).all():
            return replace(plan, target=np.full(3, np.nan))
        angle = np.radians(self.lever.pull_deg)
        return replace(plan, target=self._hinge(plan).handle(angle, self.lever.length_m))

    def scene(self, plan: AnyPlan, robot: Robot) -> Hashable:
        """Return where the lever's hinge is."""
        return self._hinge(plan).key

    def miss(self, plan: AnyPlan, outcome: FloatArray) -> float:
        """Return the arc that the handle's way is short, metres."""
        short = np.radians(self.lever.pull_deg) - self._hinge(plan).angle(outcome)
        return float(self.lever.length_m * np.maximum(short, 0.0))

    def _hinge(self, plan: AnyPlan) -> Hinge:
        """Find the hinge that belongs to a demonstration."""
        return find_hinge(
            plan.start_pose, plan.goal_pose, self.lever.length_m, self.lever.offset_m, plan.name
        )

    def simulate(
        self, robot: Robot, plans: Sequence[AnyPlan], movements: Movements, paths: bool
    ) -> Episodes:
        """Pull; the paths are those of the handle."""
        model = lever_model(robot, self, self._hinge(plans[0]).key)
        return simulate_pulling(robot, self, model, movements, paths)


@dataclass(frozen=True, eq=False)
class Hinge:
    """Where a lever is hinged.

    Attributes
    ----------
    centre : array, shape (3,)
        Where the hinge's axis meets the plane in which the handle's middle moves, metres.
    axes : array, shape (3, 3)
        Columns: to the handle before the pull, where it goes first, the axis of the hinge.
    """

    centre: FloatArray
    axes: FloatArray

    @property
    def key(self) -> tuple[float, ...]:
        """The same as plain numbers."""
        return tuple(np.concatenate([self.centre, self.axes.ravel()]).tolist())

    def handle(self, angle: float, length: float) -> FloatArray:
        """Return where the handle's middle is at an angle (rad) of a lever (m), shape (3,)."""
        turned = self.axes @ np.array([np.cos(angle), np.sin(angle), 0.0])
        return np.asarray(self.centre + length * turned)

    def angle(self, handle: FloatArray) -> float:
        """Return the angle (rad) at which the handle's middle is at a place (3,)."""
        x, y, _ = self.axes.T @ (handle - self.centre)
        return float(np.arctan2(y, x))


def find_hinge(
    start: FloatArray, end: FloatArray, length: float, offset: npt.ArrayLike, name: str = "lever"
) -> Hinge:
    """Find the hinge of a lever whose handle goes from one place to another.

    Of the two circles through both places in their vertical plane it is the one that bulges
    ahead, or up where the pull is level: a person pulls down and towards the body.

    Parameters
    ----------
    start, end : array, shape (7,)
        Poses of the tool in the robot's world; the handle is at their positions, metres.
    length : float
        Of the lever, metres.
    offset : array, shape (3,)
        Moves the whole lever, metres.
    name : str
        Of the motion, for the message.

    Raises
    ------
    RefinementError
        If the places are too close to each other, or too far apart for the lever.
    """
    way = end[:3] - start[:3]
    chord = float(np.linalg.norm(way))
    if not 0.01 <= chord <= 1.98 * length:
        raise RefinementError(
            f"{name}: task pull_lever: the demonstrated movement ends {100 * chord:.1f} cm from "
            f"its start; expected 1 cm to {198 * length:.1f} cm for lever.length_m {length:g}"
        )
    ahead = -way * [1.0, 1.0, 0.0]
    if np.linalg.norm(ahead) < _LEAST_LEVEL_M:
        w, x, y, z = start[3:]
        ahead = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 0.0])
    if np.linalg.norm(ahead) < _LEAST_BULGE:
        ahead = np.array([1.0, 0.0, 0.0])
    along = way / chord
    ahead /= np.linalg.norm(ahead)
    bulge = ahead - (ahead @ along) * along
    if np.linalg.norm(bulge) < _LEAST_BULGE:
        bulge = np.array([0.0, 0.0, 1.0]) - along[2] * along
    bulge /= np.linalg.norm(bulge)
    centre = start[:3] + way / 2 - np.sqrt(length**2 - chord**2 / 4) * bulge
    first = (start[:3] - centre) / length
    axis = np.cross(first, end[:3] - centre)
    axis /= np.linalg.norm(axis)
    return Hinge(centre + np.asarray(offset), np.column_stack([first, np.cross(axis, first), axis]))


@lru_cache(maxsize=64)
def lever_model(robot: Robot, task: PullLeverConfig, hinge: tuple[float, ...]) -> mujoco.MjModel:
    """Build the scene: arm, hook, lever.

    The lever's joint is the last one, 0 before the pull. Sensors: position (3) and orientation
    (4, wxyz) of the tool centre point, position of the handle's middle (3), in the world.

    Parameters
    ----------
    robot : Robot
    task : PullLeverConfig
    hinge : tuple of 12 float
        `Hinge.key`.
    """
    spec, last = arm_spec(robot, task.simulation.time_step_s)
    set_contact_options(spec)
    touch = contact(task.simulation.contact_time_s, task.hook.friction)
    add_tool_capsule(last, robot, **touch)
    _add_hook(add_tool_body(last, robot, "hook"), task, touch)
    _add_lever(spec, task, np.array(hinge[:3]), np.reshape(hinge[3:], (3, 3)), touch)
    add_tool_sensors(spec)
    spec.add_sensor(
        name="handle",
        type=mujoco.mjtSensor.mjSENS_FRAMEPOS,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname="handle",
    )
    return spec.compile()


def _add_hook(hook: Any, task: PullLeverConfig, touch: dict[str, list[float]]) -> None:
    """Add three rods in the plane of TCP x and z."""
    rod = task.hook.rod_radius_m
    reach = task.lever.handle_radius_m + task.hook.clearance_m + rod
    corners = [
        [task.hook.tip_m, 0.0, -reach],
        [-reach, 0.0, -reach],
        [-reach, 0.0, reach],
        [task.hook.tip_m, 0.0, reach],
    ]
    for first, second in pairwise(corners):
        hook.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*first, *second],
            size=[rod, 0.0, 0.0],
            mass=0.0,
            contype=ARM_BIT,
            conaffinity=0,
            **touch,
        )


def _add_lever(
    spec: mujoco.MjSpec,
    task: PullLeverConfig,
    centre: FloatArray,
    axes: FloatArray,
    touch: dict[str, list[float]],
) -> None:
    """Add a bar on a hinge, beside the plane in which the handle's middle moves."""
    lever, conf = spec.worldbody.add_body(name="lever"), task.lever
    lever.pos, lever.quat = centre, matrix_to_quaternion(axes)
    joint = lever.add_joint(
        name="lever",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[0.0, 0.0, 1.0],
        range=[0.0, np.radians(conf.stop_deg)],
    )
    joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
    joint.frictionloss, joint.damping = conf.friction_nm, [conf.damping_nms, 0.0, 0.0]
    left = np.cross([0.0, 0.0, 1.0], axes[:, 0]) @ axes[:, 2]
    sign = np.sign(left) * (1.0 if conf.bar_side == "left" else -1.0)
    side, radius = sign * conf.handle_length_m / 2, conf.handle_radius_m
    rods = [
        ([0.0, 0.0, side], [conf.length_m, 0.0, side], conf.mass_kg),
        ([conf.length_m, 0.0, side], [conf.length_m, 0.0, -side], 0.0),
    ]
    for first, second, mass in rods:
        lever.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[*first, *second],
            size=[radius, 0.0, 0.0],
            mass=mass,
            contype=0,
            conaffinity=ARM_BIT,
            **touch,
        )
    lever.add_site(name="handle", pos=[conf.length_m, 0.0, 0.0])


def simulate_pulling(
    robot: Robot,
    task: PullLeverConfig,
    model: mujoco.MjModel,
    movements: Movements,
    paths: bool = False,
) -> Episodes:
    """Pull.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : PullLeverConfig
        Criteria.
    model : mujoco.MjModel
        See `lever_model`.
    movements : Movements
        Sampled at the task's time step, for at least `settling_s` after they end.
    paths : bool
        Whether to give the handle's path and the playbacks.

    Returns
    -------
    Episodes
        Outcomes are the handle's places at the end.
    """
    controls = servo_controls(
        robot, movements.positions, movements.velocities, movements.accelerations
    )
    ends = movements.durations + task.simulation.settling_s
    last = np.ceil(ends / task.simulation.time_step_s).astype(np.int64) - 1
    initial = np.pad(movements.positions[:, 0], ((0, 0), (0, 1)))

    def finished(_: Run, span: slice) -> npt.NDArray[np.bool_]:
        return np.asarray(last < span.stop)

    run = run_physics(model, initial, controls, finished, movements.perturbations)
    rows = np.arange(len(last))
    tracking = tracking_errors(run.qpos[:, :, :-1], movements, last)
    poses, handle = run.sensors[rows, last, :7], run.sensors[rows, last, _HANDLE]
    slips = np.linalg.norm(handle - poses[:, :3], axis=1)
    share = run.qpos[rows, last, -1] / np.radians(task.lever.pull_deg)
    failures = tuple(_failure(tracking[i], slips[i], share[i], task) for i in rows)
    shortfalls = np.clip(np.nan_to_num(1.0 - share, nan=1.0), 0.0, 1.0)
    return Episodes(
        outcomes=np.where(np.isfinite(tracking)[:, None], handle, np.nan),
        end_poses=poses,
        tracking_errors=tracking,
        shortfalls=shortfalls * [bool(failure) for failure in failures],
        failures=failures,
        object_paths=tuple(run.sensors[i, : last[i] + 1, _HANDLE] for i in rows) if paths else (),
        measures={"slip_m": slips},
        playbacks=tuple(Playback(model, run.qpos[i, : last[i] + 1]) for i in rows) if paths else (),
    )


def _failure(tracking: float, slip: float, share: float, task: PullLeverConfig) -> str:
    """Name what went wrong in one episode."""
    failure = arm_failure(tracking, task.failure.greatest_tracking_error_rad)
    if failure or share >= 1.0:
        return failure
    hook = task.hook
    room = task.lever.handle_radius_m + hook.clearance_m + hook.rod_radius_m + hook.tip_m
    return "hook slipped off the lever" if slip > room else ""
