"""What an arm did of one demonstration: mapped, imitated, on the way, refined."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from besman.exceptions import BesmanError
from besman.pictures.scene_geoms import farthest_path, scene_geoms
from besman.records import AnyPlan, FloatArray, JointTrajectory, RefinedMotion
from besman.robot.model import Robot
from besman.simulation.episodes import Playback
from besman.simulation.task import Task
from besman.simulation.trial import move, score_episodes
from besman.view.packing import Packer
from besman.view.shapes import scene_shapes, tool_shapes


@dataclass(frozen=True)
class DemonstrationInPlan:
    """Where in a motion plan the demonstration is.

    Attributes
    ----------
    before_s, after_s : float
        Seconds before and after it, in which the imitation speeds up and slows down.
    movement_s : float
        Duration of the mapped demonstration between them.
    """

    before_s: float
    after_s: float
    movement_s: float

    def span(self, plan: AnyPlan) -> list[float]:
        """Return when the demonstration begins and ends in a plan, seconds.

        A refined plan is the imitation made faster or slower as a whole; only leads that a plan
        has itself stay as long as they are.
        """
        if plan.kind == "joint_dmp_velocity":
            return [plan.lead_in_s, plan.duration - plan.lead_out_s]
        whole = self.before_s + self.movement_s + self.after_s
        share = plan.duration / whole
        return [self.before_s * share, (self.before_s + self.movement_s) * share]


@dataclass(eq=False)
class Performance:
    """One performance.

    Attributes
    ----------
    title : str
        mapped, imitated, on the way, refined or best found.
    span : list of two float
        When the demonstration begins and ends in it, seconds.
    start_s, interval_s : float
        Time of the first frame, and between frames, seconds.
    joints : array, shape (F, n)
        Joint angles, rad.
    generation, episode : int
        Of the search; -1 where there is none.
    miss_m : float
        Distance to the target, metres; NaN if there is none.
    success : bool or None
        None where the task was not tried.
    failure : str
        What ended it before its end, "" if nothing did.
    bodies : array, shape (F, B, 7)
        Poses of what moves beside the arm, in the world: metres, quaternion wxyz.
    shapes : list of dict
        Of the scene; see `besman.view.shapes.scene_shapes`.
    object_path : array, shape (F, 3)
        Centre of mass of what is thrown, carried or pulled, metres; F = 0 if nothing is.
    blocks : list of dict
        Of a whole task: label, start and end (s) of each of its blocks; else none.
    clock : list of two lists
        Moments of the take and of the person that belong together, seconds; none: by `span`.
    """

    title: str
    span: list[float]
    start_s: float
    interval_s: float
    joints: FloatArray
    generation: int = -1
    episode: int = -1
    miss_m: float = float("nan")
    success: bool | None = None
    failure: str = ""
    bodies: FloatArray = field(default_factory=lambda: np.empty((0, 0, 7)))
    shapes: list[dict[str, Any]] = field(default_factory=list)
    object_path: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    blocks: list[dict[str, Any]] = field(default_factory=list)
    clock: list[list[float]] = field(default_factory=list)

    def content(self, packer: Packer) -> dict[str, Any]:
        """Return the take as a page is given it."""
        return {
            "title": self.title,
            "span": self.span,
            "start": self.start_s,
            "interval": self.interval_s,
            "generation": self.generation,
            "episode": self.episode,
            "miss": self.miss_m if np.isfinite(self.miss_m) else None,
            "success": self.success,
            "failure": self.failure,
            "shapes": self.shapes,
            "blocks": self.blocks,
            "clock": self.clock,
            "joints": packer.add(self.joints),
            "bodies": packer.add(self.bodies[..., :3]),
            "turns": packer.add(self.bodies[..., 3:]),
            "object": packer.add(self.object_path),
        }


def mapped_take(trajectory: JointTrajectory, robot: Robot, rate_hz: float) -> Performance:
    """Show the mapped demonstration itself, without a simulation."""
    n = max(round(trajectory.time[-1] * rate_hz), 1) + 1
    time = np.linspace(0.0, trajectory.time[-1], n)
    joints = np.stack(
        [np.interp(time, trajectory.time, column) for column in trajectory.positions.T], axis=1
    )
    return Performance(
        title="mapped",
        span=[0.0, float(time[-1])],
        start_s=0.0,
        interval_s=float(time[1]),
        joints=joints,
        shapes=tool_shapes(robot),
    )


def simulated_takes(
    motion: RefinedMotion, within: DemonstrationInPlan, robot: Robot, task: Task, rate_hz: float
) -> list[Performance]:
    """Perform the milestones of a search again.

    Parameters
    ----------
    motion : RefinedMotion
    within : DemonstrationInPlan
        Of the motion's imitation.
    robot : Robot
    task : Task
    rate_hz : float
        Frames per second, at most.

    Returns
    -------
    list of Performance
        The imitation first, the best last; of an older record without milestones the best alone.
    """
    shown = motion.milestones or ((len(motion.returns) - 1, motion.plan),)
    takes = []
    for index, (episode, plan) in enumerate(shown):
        take = _perform(plan, robot, task, rate_hz)
        last = index == len(shown) - 1
        best = "refined" if motion.success else "best found"
        take.title = "imitated" if not episode else best if last else "on the way"
        take.span = within.span(plan)
        take.episode = episode
        take.generation = int(motion.generations[episode])
        take.miss_m = float(motion.miss if last else motion.misses[episode])
        # What the search checked beyond the simulation are the limits at 1 kHz.
        limited = last and not motion.success and take.success
        if limited or not (take.failure or np.isfinite(motion.misses[episode])):
            take.success, take.failure = False, take.failure or "limit exceeded"
        takes.append(take)
    return takes


def _perform(plan: AnyPlan, robot: Robot, task: Task, rate_hz: float) -> Performance:
    """Simulate a plan and keep some of its states."""
    movements = move([plan], task, robot)
    episodes = task.simulate(robot, [plan], movements, paths=True)
    trial = score_episodes(robot, task, [plan], movements, episodes)[0]
    playback, step = episodes.playbacks[0], task.simulation.time_step_s
    if not len(playback.states):
        raise BesmanError(f"{plan.name}: the simulation diverged at its start")
    take = played_take(playback, step, robot, rate_hz)
    take.success, take.failure = trial.success, trial.failure
    return take


def played_take(playback: Playback, step: float, robot: Robot, rate_hz: float) -> Performance:
    """Keep some states of a simulation.

    Parameters
    ----------
    playback : Playback
    step : float
        Seconds between its states.
    robot : Robot
    rate_hz : float
        Frames per second, at most.

    Returns
    -------
    Performance
        Without title, span and outcome.
    """
    model = playback.model
    stride = max(round(1.0 / (rate_hz * step)), 1)
    n = len(playback.states)
    # The last state is where something landed.
    rows = np.arange((n - 1) % stride, n, stride)
    states = playback.states[rows]
    shapes, bodies = scene_shapes(robot, model)
    return Performance(
        title="",
        span=[],
        start_s=float((rows[0] + 1) * step),
        interval_s=float(stride * step),
        joints=states[:, : robot.n],
        bodies=_body_poses(model, states, bodies),
        shapes=shapes,
        object_path=farthest_path(model, states, scene_geoms(robot, model)),
    )


def _body_poses(model: mujoco.MjModel, states: FloatArray, bodies: list[int]) -> FloatArray:
    """Return the poses of bodies in the world, shape (F, B, 7)."""
    data = mujoco.MjData(model)
    poses = np.empty((len(states), len(bodies), 7))
    for row, state in enumerate(states):
        data.qpos[:] = state
        mujoco.mj_kinematics(model, data)
        poses[row, :, :3], poses[row, :, 3:] = data.xpos[bodies], data.xquat[bodies]
    # A quaternion and its negative are the same turn; between frames there must be no jump.
    signs = np.sign(np.einsum("fbi,fbi->fb", poses[1:, :, 3:], poses[:-1, :, 3:]))
    poses[1:, :, 3:] *= np.cumprod(np.where(signs < 0, -1.0, 1.0), axis=0)[..., None]
    return poses
