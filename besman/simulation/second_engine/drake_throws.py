"""A stick in its tube and a ball in its scoop, in Drake."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from besman.geometry.frames import rotation_to_quaternion
from besman.robot.kinematics import forward_kinematics
from besman.robot.model import Robot
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.physics import SimulatedStates
from besman.simulation.second_engine.drake_run import run_drake
from besman.simulation.second_engine.drake_scene import ContactModel, DrakeScene
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.tasks.ball_throw.ball_throw import (
    BallThrowConfig,
    scoop_plates,
    thrown_ball,
)
from besman.simulation.tasks.stick_throw.stick_throw import (
    HALF_WALL_M,
    StickThrowConfig,
    holder_length,
    thrown_stick,
)
from besman.simulation.tasks.stick_throw.throw_and_flight import (
    THING,
    ThrowConfig,
    ThrownThing,
    judge_throws,
    last_steps,
)

FloatArray = npt.NDArray[np.float64]


def throw_stick(
    robot: Robot,
    task: StickThrowConfig,
    movements: Movements,
    contact: ContactModel = ContactModel(),
) -> Episodes:
    """Throw the stick out of a square tube, whose walls are flat and end in sharp edges.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : StickThrowConfig
    movements : Movements
        One movement, sampled at the task's time step.
    contact : ContactModel
    """
    scene = DrakeScene(robot, task.simulation.time_step_s, task.holder.friction, contact)
    add_tube(scene, scene.links[-1], robot.chain.tip, task, holder_length(robot, task))
    stick = scene.add_free_rod(
        "stick", task.stick.length_m, task.stick.radius_m, task.stick.mass_kg
    )
    scene.finish(last_link_is_apart=True)
    half = np.array([0.0, 0.0, task.stick.length_m / 2])
    return _throw(scene, task, stick, half, -half, thrown_stick(robot, task), movements)


def throw_ball(
    robot: Robot,
    task: BallThrowConfig,
    movements: Movements,
    contact: ContactModel = ContactModel(),
) -> Episodes:
    """Throw the ball out of the scoop; parameters as of `throw_stick`."""
    scene = DrakeScene(robot, task.simulation.time_step_s, task.scoop.friction, contact)
    for pose, half in scoop_plates(task):
        scene.add_box(scene.links[-1], robot.chain.tip @ pose, half)
    ball = scene.add_free_ball("ball", task.ball.radius_m, task.ball.mass_kg)
    scene.finish()
    middle = np.zeros(3)
    return _throw(scene, task, ball, middle, middle, thrown_ball(task), movements)


def add_tube(
    scene: DrakeScene, body: Any, pose: FloatArray, task: StickThrowConfig, length: float
) -> None:
    """Add a square tube with a back plate.

    Parameters
    ----------
    scene : DrakeScene
    body : RigidBody
        What carries it.
    pose : array, shape (4, 4)
        Of the middle of the back plate in the body's frame, metres; z to the opening.
    task : StickThrowConfig
    length : float
        From the back plate to the opening, metres.
    """
    inner = task.stick.radius_m + task.holder.clearance_m
    outer = inner + 2 * HALF_WALL_M
    plates = [([0.0, 0.0, -HALF_WALL_M], [outer, outer, HALF_WALL_M])]
    for axis, side in product((0, 1), (-1.0, 1.0)):
        place, half = [0.0, 0.0, length / 2], [outer, outer, length / 2]
        place[axis], half[axis] = side * (inner + HALF_WALL_M), HALF_WALL_M
        plates.append((place, half))
    for place, half in plates:
        plate = np.eye(4)
        plate[:3, 3] = place
        scene.add_box(body, pose @ plate, half)


def _throw(
    scene: DrakeScene,
    task: ThrowConfig,
    body: Any,
    ahead: FloatArray,
    tracked: FloatArray,
    thing: ThrownThing,
    movements: Movements,
) -> Episodes:
    """Throw a body that lies `ahead` of the tool centre point; its place `tracked` is judged."""
    robot = scene.robot
    last = last_steps(task, movements)
    step = task.simulation.time_step_s
    controls = servo_setpoints(robot, movements, step)

    def finished(run: SimulatedStates, span: slice) -> npt.NDArray[np.bool_]:
        clear = thing.is_clear(run.sensors[:, span, THING])
        return np.asarray(clear.any(axis=1) | (last < span.stop))

    start = movements.positions[0, 0]
    pose = forward_kinematics(robot.chain, start[None])[0]
    pose[:3, 3] += pose[:3, :3] @ ahead
    look = _look_at(scene, body, tracked)
    run = run_drake(scene, start, controls[0], finished, look, (body, pose))
    return judge_throws(run, task, thing, expected_movements(robot, movements, step))


def _look_at(
    scene: DrakeScene, body: Any, tracked: FloatArray
) -> Callable[[Any], tuple[FloatArray, FloatArray, FloatArray]]:
    """Return what gives qpos, qvel and sensors of a throw, as MuJoCo has them."""
    plant = scene.plant

    def look(context: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
        tool = scene.tcp.CalcPoseInWorld(context).GetAsMatrix4()
        pose = plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
        moving = plant.EvalBodySpatialVelocityInWorld(context, body)
        turn = pose[:3, :3]
        place = tool[:3, :3].T @ (pose[:3, 3] + turn @ tracked - tool[:3, 3])
        q, v = plant.GetPositions(context, scene.arm), plant.GetVelocities(context, scene.arm)
        return (
            np.concatenate([q, pose[:3, 3], rotation_to_quaternion(turn[None])[0]]),
            np.concatenate([v, moving.translational(), turn.T @ moving.rotational()]),
            np.concatenate([place, tool[:3, 3], rotation_to_quaternion(tool[None, :3, :3])[0]]),
        )

    return look
