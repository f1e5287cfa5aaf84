"""What all throws share: sections of the task, how they are judged, the flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from besman.config.stage import NotNegative, Positive
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.robot.parts import GRAVITY
from besman.simulation.episodes import Episodes, Movements, Playback, arm_failure, tracking_errors
from besman.simulation.physics import SimulatedStates, run_physics
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.task import (
    ContactSimulationConfig,
    SuccessConfig,
    Task,
    TimeStep,
    TrackingFailureConfig,
)

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

_FLIGHT_STEP_S = 0.01
# Columns of the sensors of every throw: the thrown thing in the frame of the tool centre point,
# then the tool centre point in the world.
THING, TCP, TCP_ROTATION = slice(0, 3), slice(3, 6), slice(6, 10)


class ThrowSimulationConfig(ContactSimulationConfig):
    """How a throw is computed.

    Attributes
    ----------
    time_step_s : float
        Step of the simulation.
    contact_time_s : float
        Time constant of a contact (MuJoCo's solref); stiff, or the landing point is wrong.
    clear_distance_m : float
        Distance from what held it at which the thrown thing's flight is ballistic.
    longest_wait_s : float
        How long after the movement it may still leave.
    """

    time_step_s: TimeStep = 0.001
    contact_time_s: Positive = 0.002
    clear_distance_m: Positive = 0.15
    longest_wait_s: NotNegative = 0.3


class FailureConfig(TrackingFailureConfig):
    """What counts as a failed throw.

    Attributes
    ----------
    least_release_speed_m_s : float
        What leaves slower than this was dropped, not thrown.
    greatest_tracking_error_rad : float
        Greatest deviation of any joint from the movement.
    """

    least_release_speed_m_s: NotNegative = 0.7


class ThrowSuccessConfig(SuccessConfig):
    """A throw succeeds if it lands within this distance of the target."""


class ThrowConfig(Task):
    """What the tasks of throwing share."""

    simulation: ThrowSimulationConfig = ThrowSimulationConfig()
    failure: FailureConfig = FailureConfig()
    success: ThrowSuccessConfig = ThrowSuccessConfig()

    @property
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement, seconds."""
        return self.simulation.longest_wait_s

    def residual(self, plan: AnyPlan, episodes: Episodes, index: int) -> FloatArray:
        """Return the way on the floor from target to touchdown, shape (2,), in radii of success."""
        off = episodes.outcomes[index] - self.target(plan)
        return np.asarray(off[:2] / self.success_radius_m)


@dataclass(frozen=True)
class ThrownThing:
    """What is thrown.

    Attributes
    ----------
    name : str
        For the messages.
    is_clear : callable
        Tells of places in the frame of the tool centre point, shape (..., 3), metres, whether it
        is clear of what held it.
    way_out : callable
        Tells of the same places how far it has come, as a share of the way out.
    """

    name: str
    is_clear: Callable[[FloatArray], BoolArray]
    way_out: Callable[[FloatArray], FloatArray]


def simulate_throw(
    robot: Robot,
    task: ThrowConfig,
    model: mujoco.MjModel,
    initial: FloatArray,
    thing: ThrownThing,
    movements: Movements,
    paths: bool,
) -> Episodes:
    """Throw a thing that leaves by contact, and follow its flight.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : ThrowConfig
        Criteria.
    model : mujoco.MjModel
        Joints of the arm, then the thing's free joint; sensors `THING`, `TCP`, `TCP_ROTATION`.
    initial : array, shape (B, nq)
        Where the simulations start, at rest.
    thing : ThrownThing
        What is thrown.
    movements : Movements
        Sampled at the task's time step, for at least `longest_wait_s` after they end.
    paths : bool
        Whether to give the thing's path and the playbacks.

    Returns
    -------
    Episodes
        Outcomes are where the thing's centre of mass meets the floor z = 0.
    """
    step = task.simulation.time_step_s
    controls = servo_setpoints(robot, movements, step)
    last = last_steps(task, movements)

    def finished(run: SimulatedStates, span: slice) -> BoolArray:
        clear = thing.is_clear(run.sensors[:, span, THING])
        return np.asarray(clear.any(axis=1) | (last < span.stop))

    run = run_physics(model, initial, controls, finished, movements.perturbations)
    expected = expected_movements(robot, movements, step)
    episodes = judge_throws(run, task, thing, expected, paths)
    if not paths:
        return episodes
    clear = thing.is_clear(run.sensors[:, :, THING]) & (
        np.arange(controls.shape[1]) <= last[:, None]
    )
    played = tuple(
        Playback(model, _states(run, expected, row, int(at), step))
        for row, at in enumerate(np.where(clear.any(axis=1), clear.argmax(axis=1), -1))
    )
    return replace(episodes, playbacks=played)


def _states(
    run: SimulatedStates, movements: Movements, row: int, at: int, step_s: float
) -> FloatArray:
    """Return what is seen of a throw that is clear after step `at` (-1: never), shape (F, nq).

    The arm, which is simulated no longer than needed, goes on as it was told to.
    """
    import mujoco

    n = movements.positions.shape[2]
    states = run.qpos[row, : run.steps[row]]
    if at < 0 or not np.isfinite(states).all():
        return states[np.isfinite(states).all(axis=1)]
    states = states[: at + 1]
    position, velocity = states[-1, n : n + 3], run.qvel[row, at, n : n + 6]
    path = ballistic_flight(position, velocity[:3], step_s)
    rest = np.tile(states[-1], (max(len(path), movements.positions.shape[1] - at - 1), 1))
    asked = movements.positions[row, at + 1 :]
    rest[: len(asked), :n] = asked
    rest[len(asked) :, :n] = asked[-1] if len(asked) else states[-1, :n]
    if len(path):
        rest[: len(path), n : n + 3] = path
        rest[len(path) :, n : n + 3] = path[-1]
    turn = states[-1, n + 3 : n + 7].copy()
    for index in range(len(path)):
        mujoco.mju_quatIntegrate(turn, velocity[3:], step_s)
        rest[index, n + 3 : n + 7] = turn
    rest[len(path) :, n + 3 : n + 7] = turn
    return np.concatenate([states, rest])


def last_steps(task: ThrowConfig, movements: Movements) -> npt.NDArray[np.int64]:
    """Return the last step (B,) of each movement in which the thing may still leave."""
    longest = movements.durations + task.simulation.longest_wait_s
    return np.asarray(np.ceil(longest / task.simulation.time_step_s).astype(np.int64) - 1)


def judge_throws(
    run: SimulatedStates,
    task: ThrowConfig,
    thing: ThrownThing,
    movements: Movements,
    paths: bool = False,
) -> Episodes:
    """Find out what came of every throw, up to its last step, whatever simulated it.

    Parameters
    ----------
    run : SimulatedStates
        Joints of the arm, then the thing's position, quaternion wxyz; sensors as in
        `simulate_throw`.
    task, thing, movements, paths
        As in `simulate_throw`.
    """
    last = last_steps(task, movements)
    # Beyond what was simulated there is nothing to look at.
    batch, steps, n = len(run.steps), int(run.steps.max()), movements.positions.shape[2]
    rows = np.arange(batch)
    places = run.sensors[:, :steps, THING]
    clear = thing.is_clear(places) & (np.arange(steps) <= last[:, None])
    released = np.asarray(clear.any(axis=1))
    at = np.where(released, clear.argmax(axis=1), np.minimum(run.steps - 1, last))
    position, velocity = run.qpos[rows, at, n : n + 3], run.qvel[rows, at, n : n + 3]
    touchdown = ballistic_touchdown(position, velocity)
    tracking = tracking_errors(run.qpos[:, :, :n], movements, at)
    during = np.arange(steps) <= at[:, None]
    out = np.where(during, thing.way_out(places), 0.0).max(axis=1)
    speed = np.linalg.norm(velocity, axis=1)
    judged = [
        _failure(bool(released[row]), speed[row], tracking[row], out[row], task, thing.name)
        for row in rows
    ]
    thrown = (released & np.isfinite(tracking))[:, None]
    return Episodes(
        outcomes=np.where(thrown, touchdown, np.nan),
        end_poses=np.concatenate(
            [run.sensors[rows, at, TCP], run.sensors[rows, at, TCP_ROTATION]], axis=1
        ),
        tracking_errors=tracking,
        shortfalls=np.array([shortfall for _, shortfall in judged]),
        failures=tuple(failure for failure, _ in judged),
        object_paths=tuple(
            np.concatenate(
                [run.qpos[i, : at[i] + 1, n : n + 3], ballistic_flight(position[i], velocity[i])]
            )
            for i in rows
        )
        if paths
        else (),
        releases=np.where(thrown, np.concatenate([position, velocity], axis=1), np.nan),
    )


def _failure(
    released: bool, speed: float, tracking: float, out: float, task: ThrowConfig, thing: str
) -> tuple[str, float]:
    """Name what went wrong in one episode, and how wrong it went (0 to 1)."""
    failure = arm_failure(tracking, task.failure.greatest_tracking_error_rad)
    if failure:
        return failure, 1.0
    if not released:
        return f"{thing} not released", float(np.clip(1.0 - out, 0.0, 1.0))
    if speed < task.failure.least_release_speed_m_s:
        return f"{thing} dropped", 1.0 - speed / task.failure.least_release_speed_m_s
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


def ballistic_flight(
    position: FloatArray, velocity: FloatArray, step_s: float = _FLIGHT_STEP_S
) -> FloatArray:
    """Sample a free flight (F, 3) from a state (3,) to the floor, metres."""
    landed = ballistic_touchdown(position, velocity)
    if not np.isfinite(landed).all():
        return np.empty((0, 3))
    up = velocity[2]
    duration = (up + np.sqrt(up**2 + 2.0 * GRAVITY * position[2])) / GRAVITY
    time = np.append(np.arange(step_s, duration, step_s), duration)[:, None]
    path: FloatArray = position + velocity * time
    path[:, 2] -= 0.5 * GRAVITY * time[:, 0] ** 2
    path[-1] = landed
    return path
