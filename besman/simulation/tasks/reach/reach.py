"""The arm tracks a movement; where its tool ends is what counts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from besman.config.stage import NotNegative, Positive
from besman.geometry.quaternions import conjugate, multiply, rotation_vector
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.robot.mujoco_model import arm_spec
from besman.simulation.episodes import Episodes, Movements, Playback, arm_failure, tracking_errors
from besman.simulation.physics import SimulatedStates, run_physics
from besman.simulation.scenes import add_tool_sensors
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.task import PlacedBy, RewardConfig, SimulationConfig, SuccessConfig, Task

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]


class ReachSimulationConfig(SimulationConfig):
    """How the reaching movement is computed.

    Attributes
    ----------
    time_step_s : float
        Step of the simulation.
    settling_s : float
        The end pose is taken this long after the end of the movement.
    """

    settling_s: NotNegative = 0.1


class ReachRewardConfig(RewardConfig):
    """Reward of reaching: minus the sum of these terms and those of `RewardConfig`.

    Attributes
    ----------
    misorientation_per_rad : float
        Times the angle between reached and demonstrated end pose.
    """

    misorientation_per_rad: NotNegative = 0.1


class ReachSuccessConfig(SuccessConfig):
    """Reaching succeeds if the end pose is within both of these of the demonstrated one."""

    success_radius_m: Positive = 0.01
    success_angle_deg: Positive = 5.0


class ReachConfig(Task):
    """The tool is brought to the demonstrated end pose.

    Attributes
    ----------
    kind : "reach"
    tool : str
        Tool of the robot.
    simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["reach"]
    tool: str = "gripper"
    simulation: ReachSimulationConfig = ReachSimulationConfig()
    reward: ReachRewardConfig = ReachRewardConfig()
    success: ReachSuccessConfig = ReachSuccessConfig()

    needs: ClassVar[str] = "demonstrated end pose"
    placed_by: ClassVar[tuple[PlacedBy, ...]] = ("goal_pose",)
    worst: ClassVar[dict[str, float]] = {"misorientation_rad": np.pi}

    @property
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement, seconds."""
        return self.simulation.settling_s

    def target(self, plan: AnyPlan) -> FloatArray:
        """Return the demonstrated end position, shape (3,), metres."""
        return plan.goal_pose[:3]

    def simulate(
        self, robot: Robot, plans: Sequence[AnyPlan], movements: Movements, paths: bool
    ) -> Episodes:
        """Reach; nothing has a path of its own."""
        return simulate_reaching(robot, self, movements, paths)

    def residual(self, plan: AnyPlan, episodes: Episodes, index: int) -> FloatArray:
        """Return the way and the turn from demonstrated to reached end pose, shape (6,).

        Each in what may be off; the larger of the two counts, so its norm is 1 at least where the
        task has just succeeded.
        """
        way = (episodes.outcomes[index] - self.target(plan)) / self.success_radius_m
        turn = rotation_vector(
            multiply(episodes.end_poses[index, 3:], conjugate(plan.goal_pose[3:]))
        )
        return np.concatenate([way, turn / np.radians(self.success.success_angle_deg)])

    def measure(self, plan: AnyPlan, episodes: Episodes, index: int) -> dict[str, float]:
        """Return the angle between reached and demonstrated end orientation."""
        angle = rotation_between(episodes.end_poses[index, 3:], plan.goal_pose[3:])
        return {"misorientation_rad": angle}

    def succeeds(self, miss: float, measures: dict[str, float], share: float = 1.0) -> bool:
        """Tell whether position and orientation are within a share of what is permitted."""
        angle = share * np.radians(self.success.success_angle_deg)
        near = super().succeeds(miss, measures, share)
        return near and bool(measures["misorientation_rad"] <= angle)


@lru_cache(maxsize=8)
def reach_model(robot: Robot, task: ReachConfig) -> mujoco.MjModel:
    """Build the scene: the arm alone.

    Sensors: position (3) and orientation (4, wxyz) of the tool centre point in the world.
    """
    spec, _ = arm_spec(robot, task.simulation.time_step_s)
    add_tool_sensors(spec)
    return spec.compile()


def simulate_reaching(
    robot: Robot, task: ReachConfig, movements: Movements, paths: bool = False
) -> Episodes:
    """Reach.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : ReachConfig
        Scene and criteria.
    movements : Movements
        Sampled at the task's time step, for at least `settling_s` after they end.
    paths : bool
        Whether to give the playbacks.

    Returns
    -------
    Episodes
        Outcomes are the end positions of the tool centre point.
    """
    step = task.simulation.time_step_s
    controls = servo_setpoints(robot, movements, step)
    ends = movements.durations + task.simulation.settling_s
    last = np.ceil(ends / task.simulation.time_step_s).astype(np.int64) - 1

    def finished(_: SimulatedStates, span: slice) -> npt.NDArray[np.bool_]:
        return np.asarray(last < span.stop)

    starts, worlds = movements.positions[:, 0], movements.perturbations
    model = reach_model(robot, task)
    run = run_physics(model, starts, controls, finished, worlds)
    tracking = tracking_errors(run.qpos, expected_movements(robot, movements, step), last)
    poses = run.sensors[np.arange(len(last)), last]
    greatest = task.failure.greatest_tracking_error_rad
    failures = tuple(arm_failure(error, greatest) for error in tracking)
    return Episodes(
        outcomes=np.where(np.isfinite(tracking)[:, None], poses[:, :3], np.nan),
        end_poses=poses,
        tracking_errors=tracking,
        shortfalls=np.array([float(failure != "") for failure in failures]),
        failures=failures,
        playbacks=tuple(
            Playback(model, states[: end + 1]) for states, end in zip(run.qpos, last, strict=True)
        )
        if paths
        else (),
    )


def rotation_between(first: FloatArray, second: FloatArray) -> float:
    """Return the angle between two orientations given as unit quaternions (4,), rad."""
    first, second = np.asarray(first), np.asarray(second)
    # By the chord rather than the cosine, which is blind to small angles.
    chord = min(float(np.linalg.norm(first - second)), float(np.linalg.norm(first + second)))
    return float(4.0 * np.arcsin(min(chord / 2.0, 1.0))) if np.isfinite(chord) else float("nan")
