"""A stick lies in a holder on the arm's tool and leaves it by contact physics alone.

The arm is driven by its servos, the stick by gravity and by contact with the walls and the back
plate of the holder. Once its tail is clear of the opening, the flight of its centre of mass is
ballistic, down to the floor.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from besman.robot.dynamics import GRAVITY
from besman.robot.model import Robot
from besman.robot.mujoco_model import ARM_BIT, arm_spec, matrix_to_quaternion, servo_controls
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.physics import Run, run_physics
from besman.simulation.tasks import StickThrowConfig

FloatArray = npt.NDArray[np.float64]

_WALL_M = 0.003  # half a wall's thickness
_PLATE_BIT = 2 * ARM_BIT
_FLIGHT_STEP_S = 0.01
# Columns of the sensors, see `throw_model`.
_TAIL, _TCP, _TCP_ROTATION = slice(0, 3), slice(3, 6), slice(6, 10)


@lru_cache(maxsize=8)
def throw_model(robot: Robot, task: StickThrowConfig) -> mujoco.MjModel:
    """Build the scene: arm, holder, stick.

    Sensors: position of the stick's tail in the frame of the tool centre point (3), position (3)
    and orientation (4, wxyz) of the tool centre point in the world.
    """
    spec, last = arm_spec(robot, task.simulation.time_step_s)
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # Friction that is softer than the contact itself lets the stick creep in its holder.
    spec.option.impratio = 10.0
    # Made for scenes of many bodies; here they cost a tenth of the time.
    spec.option.disableflags |= (
        mujoco.mjtDisableBit.mjDSBL_MIDPHASE | mujoco.mjtDisableBit.mjDSBL_ISLAND
    )
    holder = last.add_body(
        name="holder",
        pos=robot.chain.tip[:3, 3],
        quat=matrix_to_quaternion(robot.chain.tip[:3, :3]),
    )
    _add_holder(holder, task)
    stick = spec.worldbody.add_body(name="stick")
    stick.add_freejoint()
    _add_stick(stick, task)
    # The link that carries the holder encloses the stick's tail.
    spec.add_exclude(bodyname1=robot.joint_names[-1], bodyname2="stick")
    _add_sensors(spec)
    return spec.compile()


def _contact(task: StickThrowConfig) -> dict[str, list[float]]:
    """Give the contact parameters of stick and holder."""
    return {
        "solref": [task.simulation.contact_time_s, 1.0],
        "friction": [task.holder.friction, 0.005, 0.0001],
    }


def _add_holder(holder: Any, task: StickThrowConfig) -> None:
    """Add a square tube: plates that the stick's tail meets, and a lip that its shaft meets.

    A rod that is longer than its tube touches it with its tail and at the opening only. Both are
    pairs of shapes with one contact point that moves smoothly, which a long rod on a flat wall
    is not.
    """
    inner = task.stick.radius_m + task.holder.clearance_m
    length, outer = task.holder.length_m, inner + 2 * _WALL_M
    plates = [([0.0, 0.0, -_WALL_M], [outer, outer, _WALL_M])]
    for axis, side in product((0, 1), (-1.0, 1.0)):
        position, size = [0.0, 0.0, length / 2], [outer, outer, length / 2]
        position[axis], size[axis] = side * (inner + _WALL_M), _WALL_M
        plates.append((position, size))
        ends = np.zeros((2, 3))
        ends[:, 2], ends[:, axis] = length - _WALL_M, side * (inner + _WALL_M)
        ends[:, 1 - axis] = -outer, outer
        holder.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=ends.ravel(),
            size=[_WALL_M, 0.0, 0.0],
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


def _add_sensors(spec: mujoco.MjSpec) -> None:
    """Add the sensors that `throw_model` names."""
    site, kinds = mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtSensor
    spec.add_sensor(
        name="tail",
        type=kinds.mjSENS_FRAMEPOS,
        objtype=site,
        objname="tail",
        reftype=site,
        refname="tcp",
    )
    spec.add_sensor(name="tcp", type=kinds.mjSENS_FRAMEPOS, objtype=site, objname="tcp")
    spec.add_sensor(name="turn", type=kinds.mjSENS_FRAMEQUAT, objtype=site, objname="tcp")


def simulate_throws(
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
    model = throw_model(robot, task)
    controls = servo_controls(
        robot, movements.positions, movements.velocities, movements.accelerations
    )
    longest = movements.durations + task.simulation.longest_wait_s
    last = np.ceil(longest / task.simulation.time_step_s).astype(np.int64) - 1

    def finished(run: Run, span: slice) -> npt.NDArray[np.bool_]:
        return _is_clear(run, span, task).any(axis=1) | (last < span.stop)

    initial = _initial_qpos(model, task, movements.positions[:, 0])
    return _judge(run_physics(model, initial, controls, finished), task, movements, last, paths)


def _initial_qpos(model: mujoco.MjModel, task: StickThrowConfig, starts: FloatArray) -> FloatArray:
    """Lay the stick's tail on the back plate, its axis along TCP z."""
    data = mujoco.MjData(model)
    qpos = np.empty((len(starts), model.nq))
    n = starts.shape[1]
    for index, start in enumerate(starts):
        data.qpos[:n] = start
        mujoco.mj_kinematics(model, data)
        rotation = data.site("tcp").xmat.reshape(3, 3)
        qpos[index, :n] = start
        qpos[index, n : n + 3] = data.site("tcp").xpos + rotation[:, 2] * task.stick.length_m / 2
        qpos[index, n + 3 :] = matrix_to_quaternion(rotation)
    return qpos


def _is_clear(run: Run, span: slice, task: StickThrowConfig) -> npt.NDArray[np.bool_]:
    """Tell when (B, steps) the stick's tail is clear of the holder."""
    tail = run.sensors[:, span, _TAIL]
    ahead = tail[..., 2] - task.holder.length_m
    aside = np.hypot(tail[..., 0], tail[..., 1])
    outside = (ahead > 0) | (aside > 2 * (task.stick.radius_m + task.holder.clearance_m))
    return np.asarray(outside & (np.hypot(ahead, aside) > task.simulation.clear_distance_m))


def _judge(
    run: Run,
    task: StickThrowConfig,
    movements: Movements,
    last: npt.NDArray[np.int64],
    paths: bool,
) -> Episodes:
    """Find out what came of every throw, up to its last step."""
    batch, steps, n = movements.positions.shape
    rows = np.arange(batch)
    clear = _is_clear(run, slice(None), task) & (np.arange(steps) <= last[:, None])
    released = np.asarray(clear.any(axis=1))
    at = np.where(released, clear.argmax(axis=1), np.minimum(run.steps - 1, last))
    position, velocity = run.qpos[rows, at, n : n + 3], run.qvel[rows, at, n : n + 3]
    touchdown = ballistic_touchdown(position, velocity)
    during = np.arange(steps) <= at[:, None]
    deviation = np.abs(run.qpos[:, :, :n] - _next(movements.positions)).max(axis=2)
    tracking = np.where(during, np.nan_to_num(deviation, nan=np.inf), 0.0).max(axis=1)
    # How far the tail ever came, as a share of the way out.
    out = np.where(during, run.sensors[:, :, 2], 0.0).max(axis=1) / task.holder.length_m
    speed = np.linalg.norm(velocity, axis=1)
    judged = [
        _failure(bool(released[row]), speed[row], tracking[row], out[row], task) for row in rows
    ]
    thrown = (released & np.isfinite(tracking))[:, None]
    return Episodes(
        outcomes=np.where(thrown, touchdown, np.nan),
        end_poses=np.concatenate(
            [run.sensors[rows, at, _TCP], run.sensors[rows, at, _TCP_ROTATION]], axis=1
        ),
        tracking_errors=tracking,
        shortfalls=np.array([shortfall for _, shortfall in judged]),
        failures=tuple(failure for failure, _ in judged),
        object_paths=tuple(
            np.concatenate([run.qpos[i, : at[i] + 1, n : n + 3], flight(position[i], velocity[i])])
            for i in rows
        )
        if paths
        else (),
    )


def _next(positions: FloatArray) -> FloatArray:
    """Shift by one sample: states are those after a step."""
    return np.concatenate([positions[:, 1:], positions[:, -1:]], axis=1)


def _failure(
    released: bool, speed: float, tracking: float, out: float, task: StickThrowConfig
) -> tuple[str, float]:
    """Name what went wrong in one episode, and how wrong it went (0 to 1)."""
    if not np.isfinite(tracking):
        return "unstable simulation", 1.0
    if tracking > task.failure.greatest_tracking_error_rad:
        return "arm did not follow", 1.0
    if not released:
        return "stick not released", float(np.clip(1.0 - out, 0.0, 1.0))
    if speed < task.failure.least_release_speed_m_s:
        return "stick dropped", 1.0 - speed / task.failure.least_release_speed_m_s
    return "", 0.0


def ballistic_touchdown(position: npt.ArrayLike, velocity: npt.ArrayLike) -> FloatArray:
    """Follow a free flight to the floor z = 0.

    Parameters
    ----------
    position, velocity : array, shape (..., 3)
        Metres, m/s; z up.

    Returns
    -------
    array, shape (..., 3)
        Metres; NaN where the flight begins below the floor.
    """
    position, velocity = np.asarray(position), np.asarray(velocity)
    height, up = position[..., 2], velocity[..., 2]
    with np.errstate(invalid="ignore"):
        duration = (up + np.sqrt(up**2 + 2.0 * GRAVITY * height)) / GRAVITY
    landed = position + velocity * duration[..., None]
    landed[..., 2] = 0.0
    return np.where((height >= 0.0)[..., None], landed, np.nan)


def flight(position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Sample a free flight (F, 3) from a state (3,) to the floor, metres."""
    landed = ballistic_touchdown(position, velocity)
    if not np.isfinite(landed).all():
        return np.empty((0, 3))
    up = velocity[2]
    duration = (up + np.sqrt(up**2 + 2.0 * GRAVITY * position[2])) / GRAVITY
    time = np.append(np.arange(_FLIGHT_STEP_S, duration, _FLIGHT_STEP_S), duration)[:, None]
    path = position + velocity * time
    path[:, 2] -= 0.5 * GRAVITY * time[:, 0] ** 2
    path[-1] = landed
    return path
