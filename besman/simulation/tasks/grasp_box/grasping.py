"""How grasps of `grasp_box` go: the arm's movement after the approach, simulation, judgement."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from besman.robot.model import Robot
from besman.simulation.episodes import Episodes, Movements, Playback, arm_failure, tracking_errors
from besman.simulation.physics import SimulatedStates, run_physics
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.tasks.grasp_box.gripper import FINGERS, finger_controls
from besman.simulation.tasks.grasp_box.lift import move_along, plan_lift
from besman.simulation.tasks.grasp_box.sections import GraspBoxFields

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

# Columns of the sensors, see `besman.simulation.tasks.grasp_box.grasp_scene.grasp_model`.
_TOUCHES, _COLLISION = slice(7, 10), 10


def add_lifts(robot: Robot, task: GraspBoxFields, approach: Movements) -> Movements:
    """Let every arm rest while the fingers close, lift, and rest again.

    Returns
    -------
    Movements
        Whose `ends` are NaN where the arm cannot lift.
    """
    lift, step = task.lift, task.simulation.time_step_s
    lifts = [
        plan_lift(robot, positions[-1], lift.height_m, lift.lift_s)
        for positions in approach.positions
    ]
    starts = approach.durations + lift.pause_s + lift.closing_s
    ends = np.array(
        [
            start + each[1] + lift.hold_s if each is not None else np.nan
            for start, each in zip(starts, lifts, strict=True)
        ]
    )
    n_steps = approach.positions.shape[1]
    if np.isfinite(ends).any():
        n_steps = max(n_steps, int(np.ceil(np.nanmax(ends) / step)) + 1)
    rest = n_steps - approach.positions.shape[1]
    arrays = [
        np.pad(approach.positions, ((0, 0), (0, rest), (0, 0)), mode="edge"),
        np.pad(approach.velocities, ((0, 0), (0, rest), (0, 0))),
        np.pad(approach.accelerations, ((0, 0), (0, rest), (0, 0))),
    ]
    for index, each in enumerate(lifts):
        if each is not None:
            first = int(np.ceil(starts[index] / step))
            time = step * np.arange(first, n_steps) - starts[index]
            for array, part in zip(arrays, move_along(*each, time), strict=True):
                array[index, first:] = part
    positions, velocities, accelerations = arrays
    return Movements(positions, velocities, accelerations, approach.durations, ends)


def simulate_grasps(
    robot: Robot,
    task: GraspBoxFields,
    model: mujoco.MjModel,
    boxes: FloatArray,
    movements: Movements,
    paths: bool = False,
) -> Episodes:
    """Approach, close, lift, hold; every movement with every box, which vary fastest.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : GraspBoxFields
        Criteria.
    model : mujoco.MjModel
        See `besman.simulation.tasks.grasp_box.grasp_scene.grasp_model`.
    boxes : array, shape (K, 7)
        Poses of the box at the start: position (m) and quaternion wxyz.
    movements : Movements
        What `add_lifts` gave.
    paths : bool
        Whether to give the box's path and the playbacks.

    Returns
    -------
    Episodes
        B times K; outcomes are the box's places at the end.
    """
    step, lift = task.simulation.time_step_s, task.lift
    arm = servo_setpoints(robot, movements, step)
    time = step * np.arange(arm.shape[1])
    closing = movements.durations + lift.pause_s
    fingers = finger_controls(task.gripper, time - closing[:, None])
    controls = np.concatenate([arm, fingers], axis=2).repeat(len(boxes), axis=0)
    n_movements, n = len(arm), robot.n
    movements = repeat_movements(movements, len(boxes))
    assert movements.ends is not None
    closing = movements.durations + lift.pause_s
    batch = len(closing)
    initial = np.concatenate(
        [
            movements.positions[:, 0],
            np.zeros((batch, len(FINGERS))),
            np.tile(boxes, (n_movements, 1)),
        ],
        axis=1,
    )
    before = np.ceil(movements.durations / step).astype(np.int64) - 1
    gripped = np.ceil((closing + lift.closing_s) / step).astype(np.int64) - 1
    ends = np.where(np.isfinite(movements.ends), movements.ends, closing + lift.closing_s)
    last = np.maximum(np.ceil(ends / step).astype(np.int64) - 1, gripped)

    def finished(run: SimulatedStates, span: slice) -> npt.NDArray[np.bool_]:
        at = np.minimum(gripped, span.stop - 1)
        touching = run.sensors[np.arange(batch), at, _TOUCHES] > 0
        lost = (gripped < span.stop) & ~_is_held(touching)
        return np.asarray((last < span.stop) | lost)

    run = run_physics(model, initial, controls, finished, movements.perturbations)
    ended = np.minimum(last, run.steps - 1)
    expected = expected_movements(robot, movements, step)
    episodes = _judge(run, task, expected, (before, gripped, ended), n, paths)
    if not paths:
        return episodes
    played = tuple(Playback(model, run.qpos[i, : ended[i] + 1]) for i in range(batch))
    return replace(episodes, playbacks=played)


def repeat_movements(movements: Movements, times: int) -> Movements:
    """Repeat every movement of a batch so many times, one after the other."""
    arrays = ("positions", "velocities", "accelerations", "durations", "ends")
    repeated: dict[str, Any] = {
        name: np.repeat(getattr(movements, name), times, axis=0) for name in arrays
    }
    worlds = tuple(one for one in movements.perturbations for _ in range(times))
    return replace(movements, **repeated, perturbations=worlds)


def summarize_poses(episodes: Episodes, times: int) -> Episodes:
    """Make one episode of those of one movement with the box in several places.

    The outcome is the worst, as is each measure; it has failed if one of them has, and its
    shortfall is the mean, in which every failure counts half at least. If none has, it is that of
    the first place, as low as the lowest: which is the lowest by a hair says nothing of where.
    """
    if times == 1:
        return episodes
    failed = np.array([bool(failure) for failure in episodes.failures]).reshape(-1, times)
    shortfalls = episodes.shortfalls.reshape(-1, times)
    low = -np.nan_to_num(episodes.outcomes[:, 2], nan=-np.inf).reshape(-1, times)
    order = np.lexsort((low, shortfalls, failed), axis=1)[:, -1]
    rows = np.arange(len(failed)) * times + order
    outcomes = episodes.outcomes[rows]
    held = ~failed.any(axis=1)
    outcomes[held, :2] = episodes.outcomes[::times][held, :2]
    graded = np.where(failed, 0.5 * (1.0 + shortfalls), 0.0)
    return Episodes(
        outcomes=outcomes,
        end_poses=episodes.end_poses[rows],
        tracking_errors=episodes.tracking_errors[rows],
        shortfalls=graded.mean(axis=1),
        failures=tuple(episodes.failures[row] for row in rows),
        object_paths=episodes.object_paths[::times],
        playbacks=episodes.playbacks[::times],
        measures={
            name: values.reshape(-1, times).max(axis=1)
            for name, values in episodes.measures.items()
        },
    )


def _is_held(touching: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Tell whether the thumb and a finger touch; shape (..., 3) to (...)."""
    return np.asarray((touching[..., 0] | touching[..., 1]) & touching[..., 2])


def _judge(
    run: SimulatedStates,
    task: GraspBoxFields,
    movements: Movements,
    moments: tuple[IntArray, IntArray, IntArray],
    n: int,
    paths: bool,
) -> Episodes:
    """Find out what came of every grasp.

    The moments (B,) are the last steps of the approach, of the closing, and of all.
    """
    before, gripped, last = moments
    rows = np.arange(len(last))
    first = n + len(FINGERS)
    box = run.qpos[:, :, first : first + 7]
    tracking = tracking_errors(run.qpos[:, :, :n], movements, last)
    touching = run.sensors[:, :, _TOUCHES] > 0
    steps = np.arange(box.shape[1])
    hit = ((run.sensors[:, :, _COLLISION] > 0) & (steps <= last[:, None])).sum(axis=1) / (last + 1)
    at = np.minimum(before, last)
    distance = np.linalg.norm(box[rows, at, :3] - run.sensors[rows, at, :3], axis=1)
    level = 1.0 - 2.0 * (box[rows, last, 4:6] ** 2).sum(axis=1)
    tilt = np.arccos(np.clip(level, -1.0, 1.0))
    fingers = touching[rows, np.minimum(gripped, last)]
    height = box[rows, last, 2] - box[rows, 0, 2]
    held = _is_held(fingers), _is_held(touching[rows, last]), height / task.lift.height_m
    judged = [
        _failure(
            tracking[i],
            float(hit[i]),
            bool(np.isfinite(movements.ends[i])) if movements.ends is not None else True,
            (bool(held[0][i]), bool(held[1][i]), float(held[2][i])),
            float(distance[i]),
            task,
        )
        for i in rows
    ]
    return Episodes(
        outcomes=np.where(np.isfinite(tracking)[:, None], box[rows, last, :3], np.nan),
        end_poses=run.sensors[rows, last, :7],
        tracking_errors=tracking,
        shortfalls=np.array([shortfall for _, shortfall in judged]),
        failures=tuple(failure for failure, _ in judged),
        object_paths=tuple(box[i, : last[i] + 1, :3] for i in rows) if paths else (),
        measures={
            "distance_m": distance,
            "tilt_rad": tilt,
            "contact_finger": (len(FINGERS) - fingers.sum(axis=1)).astype(np.float64),
        },
    )


def _failure(
    tracking: float,
    hit: float,
    can_lift: bool,
    held: tuple[bool, bool, float],
    distance: float,
    task: GraspBoxFields,
) -> tuple[str, float]:
    """Name what went wrong in one episode, and how wrong it went (0 to 1).

    `held` says whether the box was gripped, is held at the end, and which share of the height it
    is lifted.
    """
    failure = arm_failure(tracking, task.failure.greatest_tracking_error_rad)
    if failure and (hit == 0 or not np.isfinite(tracking)):
        return failure, 1.0
    if failure:
        return "collision with the shelf", float(np.clip(0.5 + hit, 0.0, 1.0))
    if not can_lift:
        return "lift out of reach", 1.0
    gripped, still, share = held
    if not gripped:
        return "box not gripped", float(np.clip(0.5 + distance, 0.0, 1.0))
    if not still:
        return "box dropped", float(np.clip(0.5 * (1.0 - share), 0.0, 1.0))
    return ("collision with the shelf", float(np.clip(hit, 0.0, 1.0))) if hit > 0 else ("", 0.0)
