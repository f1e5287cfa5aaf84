"""How boxes fare that an arm carries: simulation and judgement."""

from __future__ import annotations

import mujoco
import numpy as np
import numpy.typing as npt

from besman.geometry.frames import quaternion_to_rotation
from besman.records import TaskPlan
from besman.records.task_trial import TaskTrial
from besman.robot.model import Robot
from besman.simulation.episodes import arm_failure, tracking_errors
from besman.simulation.physics import SimulatedStates, run_physics
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.tasks.grasp_box.gripper import FINGERS
from besman.simulation.tasks.rearrange.arm_way import ArmWay
from besman.simulation.tasks.rearrange.rearrange_scene import rearrange_model
from besman.simulation.tasks.rearrange.sections import RearrangeFields

FloatArray = npt.NDArray[np.float64]

# Columns of the sensors, see `rearrange_model`.
_FIRST_TOUCH = 7


def simulate_task(
    robot: Robot,
    task: RearrangeFields,
    way: ArmWay,
    before: FloatArray,
    after: FloatArray,
    between: FloatArray | None = None,
) -> tuple[mujoco.MjModel, SimulatedStates]:
    """Move arm and fingers; nothing else moves the boxes.

    Parameters
    ----------
    robot : Robot
    task : RearrangeFields
    way : ArmWay
    before, after : array, shape (O, 7)
        Where the boxes stand, and where the boards are on which they are put.
    between : array, shape (V, 7), optional
        Where boxes are put to be taken again.
    """
    model = rearrange_model(robot, task, before, after, between)
    moved = way.movements
    step = task.simulation.time_step_s
    arm = servo_setpoints(robot, moved, step)
    time = step * np.arange(arm.shape[1], dtype=np.float64)
    fingers = way.finger_controls(task.gripper, time)[None]
    controls = np.concatenate([arm, fingers], axis=2)
    initial = np.concatenate([moved.positions[0, 0], np.zeros(len(FINGERS)), before.ravel()])

    def finished(run: SimulatedStates, span: slice) -> npt.NDArray[np.bool_]:
        return np.array([False])

    return model, run_physics(model, initial[None], controls, finished)


def judge(
    run: SimulatedStates,
    task: RearrangeFields,
    plan: TaskPlan,
    way: ArmWay,
    wanted: FloatArray,
    robot: Robot,
) -> TaskTrial:
    """Find out what came of a task.

    Parameters
    ----------
    run : SimulatedStates
        Of one simulation.
    task : RearrangeFields
    plan : TaskPlan
    way : ArmWay
    wanted : array, shape (O, 7)
        Where the boxes were to be put.
    robot : Robot
    """
    assert way.movements.ends is not None
    expected = expected_movements(robot, way.movements, task.simulation.time_step_s)
    n = robot.n
    first = n + len(FINGERS)
    boxes = to_the_floor(run.qpos[0, :, first:].reshape(run.qpos.shape[1], -1, 7))
    outcomes = boxes[-1]
    angles = pose_angles(outcomes, wanted)
    misses = np.linalg.norm(outcomes[:, :3] - wanted[:, :3], axis=1)
    last = np.array([run.qpos.shape[1] - 1])
    tracking = float(tracking_errors(run.qpos[:, :, :n], expected, last)[0])
    failure = _failure(run, task, way, boxes, tracking, plan.objects)
    success = task.success
    stands = bool(
        np.all(misses <= success.success_radius_m)
        and np.all(angles <= np.radians(success.success_angle_deg))
    )
    return TaskTrial(
        name=plan.name,
        success=not failure and stands,
        failure=failure,
        objects=plan.objects,
        wanted=wanted,
        outcomes=outcomes,
        misses=misses,
        angles=angles,
        duration=float(way.movements.ends[0]),
    )


def to_the_floor(boxes: FloatArray) -> FloatArray:
    """Have boxes (T, O, 7) lie where they reach the floor: the scene has none, they fall on."""
    fallen = np.maximum.accumulate(boxes[:, :, 2] < 0.0, axis=0)
    if not fallen.any():
        return boxes
    rows = np.arange(len(boxes))[:, None]
    first = np.where(fallen.any(axis=0), fallen.argmax(axis=0), len(boxes))
    found: FloatArray = boxes[np.minimum(rows, first), np.arange(boxes.shape[1])]
    return found


def read_touches(
    run: SimulatedStates, n_boxes: int
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Return which finger touches which box, (T, O, 3), and which board is touched, (T, N)."""
    columns = run.sensors[0, :, _FIRST_TOUCH:] > 0
    fingers, boards = columns[:, : 3 * n_boxes], columns[:, 3 * n_boxes :]
    return fingers.reshape(len(columns), n_boxes, 3), boards


def pose_angles(outcomes: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return how far poses are turned, about the vertical or away from it: the greater of both."""
    turns = [
        quaternion_to_rotation(want).T @ quaternion_to_rotation(got)
        for want, got in zip(wanted[:, 3:], outcomes[:, 3:], strict=True)
    ]
    tilts = [np.arccos(np.clip(turn[2, 2], -1.0, 1.0)) for turn in turns]
    yaws = [abs(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])) for turn in turns]
    return np.maximum(tilts, yaws).reshape(-1)


def _failure(
    run: SimulatedStates,
    task: RearrangeFields,
    way: ArmWay,
    boxes: FloatArray,
    tracking: float,
    objects: tuple[str, ...],
) -> str:
    """Name the first thing that went wrong; "" if nothing did."""
    n_boxes = boxes.shape[1]
    touches, boards = read_touches(run, n_boxes)
    held = (touches[:, :, 0] | touches[:, :, 1]) & touches[:, :, 2]
    greatest = task.failure.greatest_tracking_error_rad
    if not np.isfinite(tracking):
        return arm_failure(tracking, greatest)
    if boards.any():
        return "collision with a board"
    failure = arm_failure(tracking, greatest)
    if failure:
        return failure
    step, wait = task.simulation.time_step_s, task.wait
    holding: int | None = None
    following = [int(at / step) for at in way.commands_s[1:]] + [len(held) - 1]
    for at, close, last in zip(way.commands_s, way.closes, following, strict=True):
        row = min(int((at + (wait.closing_s if close else 0.0)) / step), len(held) - 1)
        if close:
            if not held[row].any():
                return "box not gripped"
            holding = int(np.argmax(held[row]))
        elif holding is not None:
            if not held[row, holding]:
                return f"{objects[holding]} dropped"
            fall = boxes[row, holding, 2] - boxes[last, holding, 2]
            if boxes[last, holding, 2] < 0.0:
                return f"{objects[holding]} dropped: let go beside its board, it fell to the floor"
            if fall > task.failure.greatest_fall_m:
                return f"{objects[holding]} dropped: let go {1e3 * fall:.0f} mm above its board"
            holding = None
    return "" if holding is None else f"{objects[holding]} not let go"
