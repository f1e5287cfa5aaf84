"""A box on a shelf is approached, gripped by three fingers, and lifted.

The motion plan is the approach. What follows is the task's own: the fingers close, the arm lifts
the box straight up and holds it.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import Annotated, Any, ClassVar, Literal

import mujoco
import numpy as np
import numpy.typing as npt
from pydantic import Field

from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.robot.mujoco_model import ARM_BIT, arm_spec, servo_controls
from besman.simulation.episodes import Episodes, Movements, Playback, arm_failure, tracking_errors
from besman.simulation.gripper import FINGERS, GripperConfig, add_gripper, finger_controls
from besman.simulation.lift import move_along, plan_lift
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
    TimeStep,
    Triple,
)
from besman.stage import Config

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_BOX_BIT = 4 * ARM_BIT
_FOOT_M = 0.004
# The feet stand on the board although the box is put so far to the front.
_STRAY_M = 0.03
# Where else on the shelf the box is tried, in shares of `spread_m`: ahead, to the left.
_SPREAD = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
# Columns of the sensors, see `grasp_model`.
_TOUCHES, _COLLISION = slice(7, 10), 10


class BoxConfig(Config):
    """The box and where it stands.

    Attributes
    ----------
    size_m : triple of float
        Depth (ahead), width, height.
    mass_kg : float
        Spread evenly.
    place_m : triple of float or None
        Its middle in the robot's world, metres; null: where the demonstrated approach ends.
    shift_m : pair of float
        Where it is put on the shelf off that place: ahead and to the left, metres.
    turn_deg : float
        How far it is turned there about the vertical, to the left.
    spread_m : float
        Every motion plan is tried with the box there and this far ahead, behind, to the left and to
        the right of it, and must succeed everywhere; 0: there alone.
    """

    size_m: tuple[Positive, Positive, Positive] = (0.08, 0.10, 0.18)
    mass_kg: Positive = 0.4
    place_m: Triple | None = None
    shift_m: tuple[float, float] = (0.0, 0.0)
    turn_deg: Annotated[float, Field(ge=-90, le=90)] = 0.0
    spread_m: Annotated[float, Field(ge=0, le=0.1)] = 0.025


class ShelfConfig(Config):
    """The board that the box stands on.

    Attributes
    ----------
    depth_m, width_m, thickness_m : float
        Of the board.
    overhang_m : float
        How far a box at its place reaches out over the board's front edge.
    friction : float
        Coefficient of sliding friction between box and board.
    """

    depth_m: Positive = 0.3
    width_m: Positive = 0.5
    thickness_m: Positive = 0.02
    overhang_m: NotNegative = 0.0
    friction: NotNegative = 0.4


class GraspSimulationConfig(ContactSimulationConfig):
    """How grasping is computed; a quarter of the step moves the lifted box by a millimetre."""

    time_step_s: TimeStep = 0.004
    contact_time_s: Positive = 0.008


class LiftConfig(Config):
    """What comes after the approach.

    Attributes
    ----------
    pause_s : float
        Between the end of the approach and the closing of the fingers.
    closing_s : float
        Between the start of the closing and the lift.
    height_m : float
        How high the box is lifted.
    lift_s : float
        Duration of the lift; longer if the arm's limits require it.
    hold_s : float
        How long it must be held then.
    """

    pause_s: NotNegative = 0.1
    closing_s: Positive = 0.7
    height_m: Positive = 0.12
    lift_s: Positive = 0.8
    hold_s: NotNegative = 0.3


class GraspRewardConfig(RewardConfig):
    """Reward of grasping: minus the sum of these terms and those of `RewardConfig`.

    Attributes
    ----------
    miss_per_m : float
        Times how much lower than wanted the box is held.
    distance_per_m : float
        Times the distance between the fingers' middle and the box's when the approach ends.
    tilt_per_rad : float
        Times the angle by which the box is tilted at the end.
    contact_per_finger : float
        Times the fingers that do not touch the box when the lift begins.
    """

    miss_per_m: NotNegative = 5.0
    distance_per_m: NotNegative = 2.0
    tilt_per_rad: NotNegative = 0.5
    contact_per_finger: NotNegative = 0.3


class GraspSuccessConfig(SuccessConfig):
    """Grasping succeeds if the box is held this close below its height, tilted at most so far."""

    success_radius_m: Positive = 0.03
    success_tilt_deg: Positive = 20.0


class GraspBoxConfig(Task):
    """A box is taken from a shelf.

    Attributes
    ----------
    kind : "grasp_box"
    tool : str
        Tool of the robot that is the gripper: its TCP is the middle between the fingers, TCP z
        points ahead, and they close along TCP x.
    box, shelf, gripper, lift, simulation, reward, failure, success
        See the classes.
    """

    kind: Literal["grasp_box"]
    tool: str = "gripper3"
    box: BoxConfig = BoxConfig()
    shelf: ShelfConfig = ShelfConfig()
    gripper: GripperConfig = GripperConfig()
    lift: LiftConfig = LiftConfig()
    simulation: GraspSimulationConfig = GraspSimulationConfig()
    reward: GraspRewardConfig = GraspRewardConfig()
    success: GraspSuccessConfig = GraspSuccessConfig()

    needs: ClassVar[str] = "demonstrated end pose"
    worst: ClassVar[dict[str, float]] = {
        "distance_m": 1.0,
        "tilt_rad": np.pi,
        "contact_finger": 3.0,
    }

    @property
    def rest_s(self) -> float:
        """How long the simulation goes on after the movement at least, seconds."""
        lift = self.lift
        return lift.pause_s + lift.closing_s + lift.lift_s + lift.hold_s

    def wanted(self, plan: AnyPlan) -> FloatArray:
        """Return the demonstrated end pose, shape (7,)."""
        return plan.goal_pose

    def place(self, plan: AnyPlan, robot: Robot) -> AnyPlan:
        """Return the plan with the place of the lifted box as its target."""
        target = self._box_poses(plan)[0, :3] + np.array([0.0, 0.0, self.lift.height_m])
        return replace(plan, target=target)

    def scene(self, plan: AnyPlan, robot: Robot) -> Hashable:
        """Return where the shelf stands."""
        return self._shelf_place(plan)

    def _shelf_place(self, plan: AnyPlan) -> tuple[float, float, float, float]:
        """Return the middle of a box at its place (m) and which way is ahead there (rad)."""
        w, x, y, z = plan.goal_pose[3:]
        ahead = np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x)])
        place = plan.goal_pose[:3] if self.box.place_m is None else self.box.place_m
        return (float(place[0]), float(place[1]), float(place[2]), float(np.arctan2(*ahead[::-1])))

    def _box_poses(self, plan: AnyPlan) -> FloatArray:
        """Return where the box is tried: positions (m) and quaternions wxyz, shape (K, 7)."""
        x, y, z, ahead = self._shelf_place(plan)
        cos, sin = np.cos(ahead), np.sin(ahead)
        shifts = self.box.shift_m + self.box.spread_m * _SPREAD
        if self.box.spread_m == 0:
            shifts = shifts[:1]
        turned = (ahead + np.radians(self.box.turn_deg)) / 2
        poses = np.zeros((len(shifts), 7))
        poses[:, :2] = [x, y] + shifts @ [[cos, sin], [-sin, cos]]
        poses[:, 2:] = [z, np.cos(turned), 0.0, 0.0, np.sin(turned)]
        return poses

    def miss(self, plan: AnyPlan, outcome: FloatArray) -> float:
        """Return how much lower than wanted the box is, metres."""
        return float(np.maximum(self.target(plan)[2] - outcome[2], 0.0))

    def succeeds(self, miss: float, measures: dict[str, float], share: float = 1.0) -> bool:
        """Tell whether height and tilt of the box are within a share of what is permitted."""
        tilt = share * np.radians(self.success.success_tilt_deg)
        return super().succeeds(miss, measures, share) and bool(measures["tilt_rad"] <= tilt)

    def move(self, plans: Sequence[AnyPlan], robot: Robot | None) -> Movements:
        """Roll out the approaches, and lift after each."""
        assert robot is not None
        approach = super().move(plans, robot)
        return add_lifts(robot, self, approach)

    def simulate(
        self, robot: Robot, plans: Sequence[AnyPlan], movements: Movements, paths: bool
    ) -> Episodes:
        """Approach, close, lift; the paths are those of the box at its place."""
        model = grasp_model(robot, self, self._shelf_place(plans[0]))
        boxes = self._box_poses(plans[0])
        episodes = simulate_grasps(robot, self, model, boxes, movements, paths)
        return summarize_poses(episodes, len(boxes))


def add_lifts(robot: Robot, task: GraspBoxConfig, approach: Movements) -> Movements:
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


@lru_cache(maxsize=64)
def grasp_model(
    robot: Robot, task: GraspBoxConfig, place: tuple[float, float, float, float]
) -> mujoco.MjModel:
    """Build the scene: arm, gripper, shelf, box.

    Joints: the arm's, three fingers, the box's free joint. Sensors: position (3) and orientation
    (4, wxyz) of the tool centre point in the world, contacts of each finger with the box (3),
    contacts of arm and gripper with the shelf (1).

    Parameters
    ----------
    robot : Robot
    task : GraspBoxConfig
    place : tuple of 4 float
        Middle of a box at its place, metres in the robot's world, and which way is ahead, rad.
    """
    spec, last = arm_spec(robot, task.simulation.time_step_s)
    set_contact_options(spec)
    time_s = task.simulation.contact_time_s
    touch = contact(time_s, task.gripper.friction)
    add_tool_capsule(last, robot, **touch)
    add_gripper(spec, add_tool_body(last, robot, "gripper"), task.gripper, touch)
    on_board = contact(time_s, task.shelf.friction)
    _add_shelf(spec, task, place, on_board)
    _add_box(spec, task, touch, on_board)
    add_tool_sensors(spec)
    for finger in FINGERS:
        _add_touch(spec, finger, mujoco.mjtObj.mjOBJ_GEOM, finger, "box")
    _add_touch(spec, "collision", mujoco.mjtObj.mjOBJ_XBODY, robot.joint_names[0], "shelf")
    return spec.compile()


def _add_shelf(
    spec: mujoco.MjSpec,
    task: GraspBoxConfig,
    place: tuple[float, float, float, float],
    on_board: dict[str, list[float]],
) -> None:
    """Add a board below the box."""
    shelf, (depth, _, height) = task.shelf, task.box.size_m
    x, y, z, ahead = place
    out = shelf.depth_m / 2 - depth / 2 + shelf.overhang_m
    spec.worldbody.add_geom(
        name="shelf",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[
            x + out * np.cos(ahead),
            y + out * np.sin(ahead),
            z - height / 2 - shelf.thickness_m / 2,
        ],
        quat=[np.cos(ahead / 2), 0.0, 0.0, np.sin(ahead / 2)],
        size=[shelf.depth_m / 2, shelf.width_m / 2, shelf.thickness_m / 2],
        contype=0,
        conaffinity=ARM_BIT | _BOX_BIT,
        **on_board,
    )


def _add_box(
    spec: mujoco.MjSpec,
    task: GraspBoxConfig,
    touch: dict[str, list[float]],
    on_board: dict[str, list[float]],
) -> None:
    """Add the box; it stands on small feet, which have one contact each."""
    box = spec.worldbody.add_body(name="box")
    box.add_freejoint()
    half = np.array(task.box.size_m) / 2
    box.add_geom(
        name="box",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=half,
        mass=task.box.mass_kg,
        contype=0,
        conaffinity=ARM_BIT,
        **touch,
    )
    # Those below stand on the board, some although the box reaches out over it; those above are for
    # when it falls.
    end = half[0] - _FOOT_M
    inner = max(end - task.shelf.overhang_m - _STRAY_M, 0.0)
    for x, y, z in product((-end, -inner, end), (-1.0, 1.0), (-1.0, 1.0)):
        if z > 0 and x == -inner:
            continue
        box.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            pos=[x, y * (half[1] - _FOOT_M), z * (half[2] - _FOOT_M)],
            size=[_FOOT_M, 0.0, 0.0],
            mass=0.0,
            contype=_BOX_BIT,
            conaffinity=0,
            **on_board,
        )


def _add_touch(
    spec: mujoco.MjSpec, name: str, kind: mujoco.mjtObj, first: str, second: str
) -> None:
    """Add a sensor that counts contacts between a geom or a subtree and a geom."""
    found = 1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND)
    sensor = spec.add_sensor(
        name=f"{name}_touch",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=kind,
        objname=first,
        reftype=mujoco.mjtObj.mjOBJ_GEOM,
        refname=second,
    )
    sensor.intprm[:3] = [found, 0, 1]


def simulate_grasps(
    robot: Robot,
    task: GraspBoxConfig,
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
    task : GraspBoxConfig
        Criteria.
    model : mujoco.MjModel
        See `grasp_model`.
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
    arm = servo_controls(robot, movements.positions, movements.velocities, movements.accelerations)
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

    def finished(run: Run, span: slice) -> npt.NDArray[np.bool_]:
        at = np.minimum(gripped, span.stop - 1)
        touching = run.sensors[np.arange(batch), at, _TOUCHES] > 0
        lost = (gripped < span.stop) & ~_is_held(touching)
        return np.asarray((last < span.stop) | lost)

    run = run_physics(model, initial, controls, finished, movements.perturbations)
    ended = np.minimum(last, run.steps - 1)
    episodes = _judge(run, task, movements, (before, gripped, ended), n, paths)
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
    shortfall is the mean, in which every failure counts half at least.
    """
    if times == 1:
        return episodes
    failed = np.array([bool(failure) for failure in episodes.failures]).reshape(-1, times)
    shortfalls = episodes.shortfalls.reshape(-1, times)
    low = -np.nan_to_num(episodes.outcomes[:, 2], nan=-np.inf).reshape(-1, times)
    order = np.lexsort((low, shortfalls, failed), axis=1)[:, -1]
    rows = np.arange(len(failed)) * times + order
    graded = np.where(failed, 0.5 * (1.0 + shortfalls), 0.0)
    return Episodes(
        outcomes=episodes.outcomes[rows],
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
    run: Run,
    task: GraspBoxConfig,
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
    task: GraspBoxConfig,
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
