"""What has a closed form comes out of Drake as on paper, and as it comes out of MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio
import pytest

from besman.robot.model import load_robot
from besman.robot.parts import GRAVITY
from besman.simulation.scenes import set_contact_options
from besman.simulation.second_engine.drake_lever import add_lever
from besman.simulation.second_engine.drake_scene import DrakeScene, as_transform, load_drake
from besman.simulation.second_engine.drake_throws import add_tube
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.pull_lever.hinge import Hinge
from besman.simulation.tasks.pull_lever.lever_scene import lever_model
from besman.simulation.tasks.stick_throw import stick_throw
from besman.simulation.tasks.stick_throw.throw_and_flight import ballistic_touchdown

pytest.importorskip("pydrake", reason="the extra verify is not installed")
SpatialVelocity = pytest.importorskip("pydrake.multibody.math").SpatialVelocity

STEP_S = 0.001
# Away from the arm.
ASIDE = np.array([3.0, 0.0, 2.0])
# Of the stick's 45 cm the middle stays inside while it slides.
TUBE_M = 0.3


@pytest.fixture(scope="module")
def robot():
    return load_robot("ur5", "stick_holder")


@pytest.fixture(scope="module")
def task():
    return load_task("stick_throw")


def start(scene, body=None, place=None, velocity=(0.0, 0.0, 0.0), turn=None):
    """Start a simulation with a body at a place, moving; return the simulator and the context."""
    drake = load_drake()
    scene.finish()
    simulator = drake.analysis.Simulator(scene.diagram)
    context = scene.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    home = np.concatenate([scene.robot.home, np.zeros(scene.robot.n)])
    scene.plant.SetPositions(context, scene.arm, scene.robot.home)
    scene.plant.get_desired_state_input_port(scene.arm).FixValue(context, home)
    for brake in scene.brakes:
        scene.plant.get_desired_state_input_port(brake).FixValue(context, np.zeros(2))
    if body is not None:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.eye(3) if turn is None else turn, place
        scene.plant.SetFloatingBaseBodyPoseInWorldFrame(context, body, as_transform(pose))
        moving = SpatialVelocity(np.zeros(3), np.array(velocity))
        scene.plant.SetFreeBodySpatialVelocity(context=context, body=body, V_JpJc=moving)
    simulator.Initialize()
    return simulator, context


def test_the_arm_has_the_inertia_of_pinocchio(robot):
    scene = DrakeScene(robot, STEP_S, 0.0)
    _, context = start(scene)
    for seed in range(3):
        q = np.random.default_rng(seed).uniform(-2, 2, robot.n)
        scene.plant.SetPositions(context, scene.arm, q)
        upper = np.triu(pinocchio.crba(robot.model, robot.model.createData(), q))
        matrix = upper + np.triu(upper, 1).T
        np.testing.assert_allclose(scene.plant.CalcMassMatrix(context), matrix, atol=1e-9)
        gravity = pinocchio.computeGeneralizedGravity(robot.model, robot.model.createData(), q)
        found = scene.plant.CalcGravityGeneralizedForces(context)
        np.testing.assert_allclose(-found, gravity, atol=1e-9)


def test_a_free_flight_is_a_parabola(robot, task):
    scene = DrakeScene(robot, STEP_S, 0.0)
    rod = scene.add_free_rod("rod", 0.45, 0.006, 0.06)
    velocity = np.array([2.0, -0.5, 1.5])
    simulator, context = start(scene, rod, ASIDE, velocity)
    flight_s = 0.8
    simulator.AdvanceTo(flight_s)
    expected = ASIDE + velocity * flight_s - [0, 0, 0.5 * GRAVITY * flight_s**2]
    place = scene.plant.EvalBodyPoseInWorld(context, rod).translation()
    # Semi-implicit Euler is 0.5 g dt t below.
    np.testing.assert_allclose(place, expected, atol=0.5 * GRAVITY * STEP_S * flight_s)
    moving = scene.plant.EvalBodySpatialVelocityInWorld(context, rod).translational()
    landed = ballistic_touchdown(ASIDE, velocity)
    np.testing.assert_allclose(ballistic_touchdown(place, moving), landed, atol=0.002)


def tilted(degrees):
    """A tube's pose whose opening is lower than its back plate."""
    angle = np.radians(90 + degrees)
    pose = np.eye(4)
    pose[:3, :3] = [
        [np.cos(angle), 0, np.sin(angle)],
        [0, 1, 0],
        [-np.sin(angle), 0, np.cos(angle)],
    ]
    pose[:3, 3] = ASIDE
    return pose


def slide_in_drake(robot, task, pose, until_s):
    """Let a rod lie in a tube; return how far along it came."""
    scene = DrakeScene(robot, STEP_S, task.holder.friction)
    add_tube(scene, scene.plant.world_body(), pose, task, TUBE_M)
    rod = scene.add_free_rod("rod", task.stick.length_m, task.stick.radius_m, task.stick.mass_kg)
    first = pose[:3, 3] + task.stick.length_m / 2 * pose[:3, 2]
    simulator, context = start(scene, rod, first, turn=pose[:3, :3])
    simulator.AdvanceTo(until_s)
    place = scene.plant.EvalBodyPoseInWorld(context, rod).translation()
    return float((place - first) @ pose[:3, 2])


def slide_in_mujoco(task, pose, until_s):
    """The same in MuJoCo, with the parts of the task's own scene."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = STEP_S, [0.0, 0.0, -GRAVITY]
    set_contact_options(spec)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(pose[:3, :3]).ravel())
    tube = spec.worldbody.add_body(name="tube", pos=pose[:3, 3], quat=quaternion)
    stick_throw._add_holder(tube, task, TUBE_M)
    first = pose[:3, 3] + task.stick.length_m / 2 * pose[:3, 2]
    rod = spec.worldbody.add_body(name="stick", pos=first, quat=quaternion)
    rod.add_freejoint()
    stick_throw._add_stick(rod, task)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(round(until_s / STEP_S)):
        mujoco.mj_step(model, data)
    return float((data.qpos[:3] - first) @ pose[:3, 2])


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_a_rod_slides_in_a_tube_as_on_a_slope(robot, task, friction):
    holder = task.holder.model_copy(update={"friction": friction})
    task = task.model_copy(update={"holder": holder})
    pose, until_s = tilted(30), 0.16
    way = 0.5 * GRAVITY * (np.sin(np.pi / 6) - friction * np.cos(np.pi / 6)) * until_s**2
    found = [slide_in_drake(robot, task, pose, until_s), slide_in_mujoco(task, pose, until_s)]
    # It falls through the clearance of 2 mm first.
    np.testing.assert_allclose(found, way, atol=0.0005 + 0.02 * friction)


def test_what_strikes_loses_no_more_along_the_wall_than_friction_takes(robot):
    """The lagged model of friction takes eight times the speed that it loses across, at 0.05."""
    scene = DrakeScene(robot, STEP_S, 0.05)
    wall = np.eye(4)
    wall[:3, 3] = ASIDE - [0.003 + 0.006 + 0.0005, 0, 0]
    scene.add_box(scene.plant.world_body(), wall, [0.003, 0.1, 1.0])
    rod = scene.add_free_rod("rod", 0.45, 0.006, 0.06)
    velocity = np.array([-0.25, 0.0, 2.4])
    simulator, context = start(scene, rod, ASIDE, velocity)
    simulator.AdvanceTo(0.01)
    moving = scene.plant.EvalBodySpatialVelocityInWorld(context, rod).translational()
    across = moving[0] - velocity[0]
    along = velocity[2] - GRAVITY * 0.01 - moving[2]
    assert across > 0.24
    assert along / across == pytest.approx(0.05, rel=0.05)


def lever(friction_nm, damping_nms=0.0):
    task = load_task("pull_lever")
    changed = {"friction_nm": friction_nm, "damping_nms": damping_nms, "stop_deg": 170.0}
    return task.model_copy(update={"lever": task.lever.model_copy(update=changed)})


# A lever that points ahead and falls.
HINGE = Hinge(ASIDE, np.column_stack([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]))


def fall_in_drake(robot, task, until_s):
    """Let a lever fall; return its angle and speed."""
    scene = DrakeScene(robot, STEP_S, 0.0)
    _, joint = add_lever(scene, task, HINGE)
    simulator, context = start(scene)
    simulator.AdvanceTo(until_s)
    return joint.get_angle(context), joint.get_angular_rate(context)


def fall_in_mujoco(task, until_s):
    """The same in MuJoCo."""
    robot = load_robot("ur10", "hook")
    model = lever_model(robot, task, HINGE.key)
    data = mujoco.MjData(model)
    data.qpos[: robot.n] = robot.home
    data.ctrl[:] = robot.home
    for _ in range(round(until_s / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return data.qpos[-1], data.qvel[-1]


def speed_on_paper(task, angle):
    """Speed of a bar that fell so far: energy is kept but for what friction takes."""
    conf = task.lever
    rod, radius = conf.length_m, conf.handle_radius_m
    # A cylinder and two half balls at its ends, all of one density.
    share = rod / (rod + 4 * radius / 3)
    bar, ball = conf.mass_kg * share, conf.mass_kg * (1 - share)
    about = bar * (rod**2 / 12 + radius**2 / 4)
    about += ball * (0.4 * radius**2 + rod**2 / 4 + 3 * rod * radius / 8)
    inertia = about + conf.mass_kg * rod**2 / 4
    energy = conf.mass_kg * GRAVITY * rod / 2 * np.sin(angle) - conf.friction_nm * angle
    return np.sqrt(2 * energy / inertia)


@pytest.mark.parametrize("friction_nm", [0.0, 0.5])
def test_a_lever_falls_as_a_pendulum(robot, friction_nm):
    task = lever(friction_nm)
    first, second = fall_in_drake(robot, task, 0.2), fall_in_mujoco(task, 0.2)
    for angle, speed in (first, second):
        assert angle > 0.5
        assert speed == pytest.approx(speed_on_paper(task, angle), rel=0.02)
    np.testing.assert_allclose(first, second, rtol=0.02)


def test_dry_friction_holds_a_lever(robot):
    angle, _ = fall_in_drake(robot, lever(8.0), 0.5)
    assert abs(angle) < 1e-3
