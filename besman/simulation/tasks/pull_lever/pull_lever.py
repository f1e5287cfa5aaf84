"""A hinged lever with friction is pulled by a hook on the arm's tool.

The lever stands where the demonstration pulled one: its handle begins where the demonstrated
movement begins, and its hinge is where the handle's arc also passes through the movement's end.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import numpy.typing as npt

from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.episodes import (
    Episodes,
    Movements,
    Playback,
    arm_failure,
    lag_shortfall,
    tracking_errors,
)
from besman.simulation.physics import SimulatedStates, run_physics
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.task import PlacedBy
from besman.simulation.tasks.pull_lever.hinge import Hinge, find_hinge
from besman.simulation.tasks.pull_lever.sections import (
    PullLeverFields,
)

if TYPE_CHECKING:
    import mujoco

FloatArray = npt.NDArray[np.float64]

# Columns of a sensor, see `besman.simulation.tasks.pull_lever.lever_scene.lever_model`.
_HANDLE = slice(7, 10)


class PullLeverConfig(PullLeverFields):
    """A lever is pulled beyond an angle; see `PullLeverFields` for its sections."""

    needs: ClassVar[str] = "demonstrated start and end pose"
    placed_by: ClassVar[tuple[PlacedBy, ...]] = ("start_pose", "goal_pose")
    worst: ClassVar[dict[str, float]] = {"slip_m": 1.0}

    @property
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement, seconds."""
        return self.simulation.settling_s

    def wanted(self, plan: AnyPlan) -> FloatArray:
        """Return the handle's place after the pull, shape (3,), which both poses make."""
        return plan.target

    def place(self, plan: AnyPlan, robot: Robot) -> AnyPlan:
        """Return the plan with the handle's place after the pull as its target."""
        if not np.isfinite([plan.start_pose, plan.goal_pose]).all():
            return replace(plan, target=np.full(3, np.nan))
        angle = np.radians(self.lever.pull_deg)
        return replace(plan, target=self.hinge(plan).handle(angle, self.lever.length_m))

    def scene(self, plan: AnyPlan, robot: Robot) -> Hashable:
        """Return where the lever's hinge is."""
        return self.hinge(plan).key

    def miss(self, plan: AnyPlan, outcome: FloatArray) -> float:
        """Return the arc that the handle's way is short, metres."""
        short = np.radians(self.lever.pull_deg) - self.hinge(plan).angle(outcome)
        return float(self.lever.length_m * np.maximum(short, 0.0))

    def residual(self, plan: AnyPlan, episodes: Episodes, index: int) -> FloatArray:
        """Return the arc that the handle's way is short, shape (1,), in radii of success."""
        return np.array([self.miss(plan, episodes.outcomes[index]) / self.success_radius_m])

    def hinge(self, plan: AnyPlan) -> Hinge:
        """Find the hinge that belongs to a demonstration."""
        return find_hinge(
            plan.start_pose, plan.goal_pose, self.lever.length_m, self.lever.offset_m, plan.name
        )

    def simulate(
        self, robot: Robot, plans: Sequence[AnyPlan], movements: Movements, paths: bool
    ) -> Episodes:
        """Pull; the paths are those of the handle."""
        from besman.simulation.tasks.pull_lever.lever_scene import lever_model

        model = lever_model(robot, self, self.hinge(plans[0]).key)
        return simulate_pulling(robot, self, model, movements, paths)


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
        See `besman.simulation.tasks.pull_lever.lever_scene.lever_model`.
    movements : Movements
        Sampled at the task's time step, for at least `settling_s` after they end.
    paths : bool
        Whether to give the handle's path and the playbacks.

    Returns
    -------
    Episodes
        Outcomes are the handle's places at the end.
    """
    step = task.simulation.time_step_s
    controls = servo_setpoints(robot, movements, step)
    initial = np.pad(movements.positions[:, 0], ((0, 0), (0, 1)))
    last = last_pull_steps(task, movements)

    def finished(_: SimulatedStates, span: slice) -> npt.NDArray[np.bool_]:
        return np.asarray(last < span.stop)

    run = run_physics(model, initial, controls, finished, movements.perturbations)
    episodes = judge_pulls(run, task, expected_movements(robot, movements, step), paths)
    if not paths:
        return episodes
    played = (Playback(model, run.qpos[i, : at + 1]) for i, at in enumerate(last))
    return replace(episodes, playbacks=tuple(played))


def last_pull_steps(task: PullLeverConfig, movements: Movements) -> npt.NDArray[np.int64]:
    """Return the step (B,) of each movement at which the lever is looked at."""
    ends = movements.durations + task.simulation.settling_s
    return np.asarray(np.ceil(ends / task.simulation.time_step_s).astype(np.int64) - 1)


def judge_pulls(
    run: SimulatedStates, task: PullLeverConfig, movements: Movements, paths: bool = False
) -> Episodes:
    """Find out what came of every pull, whatever simulated it.

    Parameters
    ----------
    run : SimulatedStates
        Joints of the arm, then the lever's; sensors as in
        `besman.simulation.tasks.pull_lever.lever_scene.lever_model`.
    task, movements, paths
        As in `simulate_pulling`.
    """
    last = last_pull_steps(task, movements)
    rows = np.arange(len(last))
    tracking = tracking_errors(run.qpos[:, :, :-1], movements, last)
    poses, handle = run.sensors[rows, last, :7], run.sensors[rows, last, _HANDLE]
    slips = np.linalg.norm(handle - poses[:, :3], axis=1)
    share = run.qpos[rows, last, -1] / np.radians(task.lever.pull_deg)
    judged = [_failure(tracking[i], slips[i], share[i], task) for i in rows]
    return Episodes(
        outcomes=np.where(np.isfinite(tracking)[:, None], handle, np.nan),
        end_poses=poses,
        tracking_errors=tracking,
        shortfalls=np.array([shortfall for _, shortfall in judged]),
        failures=tuple(failure for failure, _ in judged),
        object_paths=tuple(run.sensors[i, : last[i] + 1, _HANDLE] for i in rows) if paths else (),
        measures={"slip_m": slips},
    )


def _failure(
    tracking: float, slip: float, share: float, task: PullLeverConfig
) -> tuple[str, float]:
    """Name what went wrong in one episode, and how wrong it went (0 to 1)."""
    greatest = task.failure.greatest_tracking_error_rad
    if failure := arm_failure(tracking, greatest):
        return failure, lag_shortfall(tracking, greatest)
    hook = task.hook
    room = task.lever.handle_radius_m + hook.clearance_m + hook.rod_radius_m + hook.tip_m
    if share >= 1.0 or slip <= room:
        return "", 0.0
    return "hook slipped off the lever", float(np.clip(1.0 - share, 0.0, 1.0))
