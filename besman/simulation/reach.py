"""The arm tracks a movement; where its tool ends is what counts."""

from __future__ import annotations

from functools import lru_cache

import mujoco
import numpy as np
import numpy.typing as npt

from besman.robot.model import Robot
from besman.robot.mujoco_model import arm_spec, servo_controls
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.physics import Run, run_physics
from besman.simulation.tasks import ReachConfig


@lru_cache(maxsize=8)
def reach_model(robot: Robot, task: ReachConfig) -> mujoco.MjModel:
    """Build the scene: the arm alone.

    Sensors: position (3) and orientation (4, wxyz) of the tool centre point in the world.
    """
    spec, _ = arm_spec(robot, task.simulation.time_step_s)
    site, kinds = mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtSensor
    spec.add_sensor(name="tcp", type=kinds.mjSENS_FRAMEPOS, objtype=site, objname="tcp")
    spec.add_sensor(name="turn", type=kinds.mjSENS_FRAMEQUAT, objtype=site, objname="tcp")
    return spec.compile()


def simulate_reaching(robot: Robot, task: ReachConfig, movements: Movements) -> Episodes:
    """Reach.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : ReachConfig
        Scene and criteria.
    movements : Movements
        Sampled at the task's time step, for at least `settling_s` after they end.

    Returns
    -------
    Episodes
        Outcomes are the end positions of the tool centre point.
    """
    controls = servo_controls(
        robot, movements.positions, movements.velocities, movements.accelerations
    )
    ends = movements.durations + task.simulation.settling_s
    last = np.ceil(ends / task.simulation.time_step_s).astype(np.int64) - 1

    def finished(_: Run, span: slice) -> npt.NDArray[np.bool_]:
        return np.asarray(last < span.stop)

    run = run_physics(reach_model(robot, task), movements.positions[:, 0], controls, finished)
    rows = np.arange(len(last))
    wanted = np.concatenate([movements.positions[:, 1:], movements.positions[:, -1:]], axis=1)
    deviation = np.nan_to_num(np.abs(run.qpos - wanted).max(axis=2), nan=np.inf)
    during = np.arange(deviation.shape[1]) <= last[:, None]
    tracking = np.where(during, deviation, 0.0).max(axis=1)
    poses = run.sensors[rows, last]
    failures = tuple(_failure(error, task) for error in tracking)
    return Episodes(
        outcomes=np.where(np.isfinite(tracking)[:, None], poses[:, :3], np.nan),
        end_poses=poses,
        tracking_errors=tracking,
        shortfalls=np.array([float(failure != "") for failure in failures]),
        failures=failures,
    )


def _failure(tracking: float, task: ReachConfig) -> str:
    """Name what went wrong in one episode."""
    if not np.isfinite(tracking):
        return "unstable simulation"
    if tracking > task.failure.greatest_tracking_error_rad:
        return "arm did not follow"
    return ""
