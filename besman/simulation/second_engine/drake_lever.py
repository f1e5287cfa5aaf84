"""A lever that a hook pulls, in Drake."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from besman.geometry.frames import rotation_to_quaternion
from besman.records import AnyPlan
from besman.robot.model import Robot
from besman.simulation.episodes import Episodes, Movements
from besman.simulation.physics import SimulatedStates
from besman.simulation.second_engine.drake_run import run_drake
from besman.simulation.second_engine.drake_scene import (
    ContactModel,
    DrakeScene,
    as_transform,
    load_drake,
)
from besman.simulation.setpoints import expected_movements, servo_setpoints
from besman.simulation.tasks.pull_lever.hinge import Hinge
from besman.simulation.tasks.pull_lever.lever_scene import hook_rods, lever_rods
from besman.simulation.tasks.pull_lever.pull_lever import (
    PullLeverConfig,
    judge_pulls,
    last_pull_steps,
)

FloatArray = npt.NDArray[np.float64]


def pull_lever(
    robot: Robot,
    task: PullLeverConfig,
    plan: AnyPlan,
    movements: Movements,
    contact: ContactModel = ContactModel(),
) -> Episodes:
    """Pull the lever that stands where a plan's demonstration pulled one.

    Parameters
    ----------
    robot : Robot
        With the task's tool.
    task : PullLeverConfig
    plan : MotionPlan or CartesianPlan
    movements : Movements
        One movement, sampled at the task's time step.
    contact : ContactModel
    """
    scene = DrakeScene(robot, task.simulation.time_step_s, task.hook.friction, contact)
    _add_hook(scene, task)
    lever, joint = add_lever(scene, task, task.hinge(plan))
    scene.finish()
    last = last_pull_steps(task, movements)
    step = task.simulation.time_step_s
    controls = servo_setpoints(robot, movements, step)
    plant, handle = scene.plant, np.array([task.lever.length_m, 0.0, 0.0])

    def finished(_: SimulatedStates, span: slice) -> npt.NDArray[np.bool_]:
        return np.asarray(last < span.stop)

    def look(context: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
        tool = scene.tcp.CalcPoseInWorld(context).GetAsMatrix4()
        pose = plant.EvalBodyPoseInWorld(context, lever).GetAsMatrix4()
        turn = rotation_to_quaternion(tool[None, :3, :3])[0]
        arm = plant.GetPositions(context, scene.arm), plant.GetVelocities(context, scene.arm)
        return (
            np.append(arm[0], joint.get_angle(context)),
            np.append(arm[1], joint.get_angular_rate(context)),
            np.concatenate([tool[:3, 3], turn, pose[:3, 3] + pose[:3, :3] @ handle]),
        )

    run = run_drake(scene, movements.positions[0, 0], controls[0], finished, look)
    return judge_pulls(run, task, expected_movements(robot, movements, step))


def _add_hook(scene: DrakeScene, task: PullLeverConfig) -> None:
    """Add the hook's rods, and the shaft that its tool says."""
    robot, last = scene.robot, scene.links[-1]
    tip, tool = robot.chain.tip, robot.tool
    rods = [
        (*(tip[:3, :3] @ np.array(end) + tip[:3, 3] for end in rod), task.hook.rod_radius_m)
        for rod in hook_rods(task)
    ]
    if tool.capsule_radius > 0:
        flange = tip @ np.linalg.inv(tool.tcp2flange)
        ends = tool.capsule_ends @ flange[:3, :3].T + flange[:3, 3]
        rods.append((ends[0], ends[1], tool.capsule_radius))
    for first, second, radius in rods:
        scene.add_rod(last, first, second, radius, False)


def add_lever(scene: DrakeScene, task: PullLeverConfig, hinge: Hinge) -> tuple[Any, Any]:
    """Add the bar with its handle on a hinge of the world; return the body and its joint."""
    tree, plant, conf = load_drake().tree, scene.plant, task.lever
    (near, far), handle = (
        tuple(np.array(end) for end in rod) for rod in lever_rods(task, hinge.axes)
    )
    about_centre = tree.SpatialInertia.SolidCapsuleWithMass(
        conf.mass_kg, conf.handle_radius_m, conf.length_m, (far - near) / conf.length_m
    )
    inertia = about_centre.Shift(-(near + far) / 2)
    instance = plant.AddModelInstance("lever")
    lever = plant.AddRigidBody("lever", instance, inertia)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = hinge.axes, hinge.centre
    base = plant.AddFrame(tree.FixedOffsetFrame("hinge", plant.world_frame(), as_transform(pose)))
    stop = np.radians(conf.stop_deg)
    joint = plant.AddJoint(
        tree.RevoluteJoint(
            "lever", base, lever.body_frame(), [0.0, 0.0, 1.0], 0.0, stop, conf.damping_nms
        )
    )
    if conf.friction_nm > 0:
        scene.add_brake(joint, conf.friction_nm)
    for first, second in ((near, far), handle):
        scene.add_rod(lever, first, second, conf.handle_radius_m, True)
    return lever, joint
