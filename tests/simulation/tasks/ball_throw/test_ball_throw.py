from dataclasses import replace

import mujoco
import numpy as np
import pytest

from besman.exceptions import RefinementError
from besman.robot.model import load_robot
from besman.robot.mujoco_model import servo_controls
from besman.simulation.episodes import Movements
from besman.simulation.scenes import lay_in_tool
from besman.simulation.tasks.ball_throw.ball_throw import ball_model
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.stick_throw.throw_and_flight import ballistic_touchdown
from besman.simulation.trial import move, try_plans
from besman.stages.refine.stage import CmaEsConfig

TASK = load_task("ball_throw")
ROBOT = load_robot("ur5", "scoop")


def changed(**sections):
    parts = {
        name: getattr(TASK, name).model_copy(update=values) for name, values in sections.items()
    }
    return TASK.model_copy(update=parts)


@pytest.fixture(scope="module")
def plans(scoop_throw):
    target = np.array([1.0, 0.1, 0.0])
    return [replace(scoop_throw, duration=each, target=target) for each in (0.7, 0.75, 0.8)]


def throw(plans, task=TASK, paths=False):
    return task.simulate(ROBOT, plans, move(plans, task), paths)


def test_ball_leaves_and_lands(plans):
    episodes = throw(plans, paths=True)
    assert set(episodes.failures) == {""}
    np.testing.assert_array_equal(episodes.outcomes[:, 2], 0)
    assert np.linalg.norm(episodes.outcomes[:, :2], axis=1).min() > 0.5
    for path, outcome in zip(episodes.object_paths, episodes.outcomes, strict=True):
        np.testing.assert_allclose(path[-1], outcome, atol=1e-9)
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 0.06


def test_free_flight_in_mujoco_is_the_parabola_and_keeps_its_energy():
    model = ball_model(ROBOT, TASK)
    data = mujoco.MjData(model)
    position, velocity = np.array([3.0, 0.3, 1.5]), np.array([2.0, -0.4, 1.2])
    data.qpos[: ROBOT.n] = ROBOT.home
    data.qpos[ROBOT.n : ROBOT.n + 3], data.qvel[ROBOT.n : ROBOT.n + 3] = position, velocity
    energies = []
    while data.qpos[ROBOT.n + 2] > 0:
        mujoco.mj_step(model, data)
        height, speed = data.qpos[ROBOT.n + 2], np.linalg.norm(data.qvel[ROBOT.n : ROBOT.n + 3])
        energies.append(9.81 * height + speed**2 / 2)
    landed = ballistic_touchdown(position, velocity)
    np.testing.assert_allclose(data.qpos[ROBOT.n : ROBOT.n + 2], landed[:2], atol=5e-3)
    np.testing.assert_allclose(energies, energies[0], rtol=3e-3)


def test_the_flight_is_ballistic_from_wherever_it_is_read_off(plans):
    early = throw(plans, changed(simulation={"clear_distance_m": 0.08})).outcomes
    late = throw(plans, changed(simulation={"clear_distance_m": 0.3})).outcomes
    np.testing.assert_allclose(early, late, atol=3e-3)


def test_landing_does_not_depend_on_the_time_step(plans):
    fine = changed(simulation={"time_step_s": 0.000375, "contact_time_s": 0.00075})
    shift = np.linalg.norm(throw(plans, fine).outcomes - throw(plans).outcomes, axis=1)
    assert np.median(shift) < 0.02


def test_the_ball_rests_on_the_plate_of_a_level_scoop(level_scoop):
    model = ball_model(ROBOT, TASK)
    data = mujoco.MjData(model)
    data.qpos[:] = lay_in_tool(model, level_scoop[None], 0.0)[0]
    data.ctrl[:] = servo_controls(ROBOT, level_scoop, 0 * level_scoop, 0 * level_scoop)
    for _ in range(300):
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.sensordata[:3], 0, atol=1e-3)
    assert len(data.contact) == 1


def test_a_wider_clearance_keeps_walls_away():
    # The walls are tangents of a ball that is larger by the clearance.
    for clearance in (0.0, 0.004):
        task = changed(scoop={"clearance_m": clearance})
        model = ball_model(ROBOT, task)
        data = mujoco.MjData(model)
        data.qpos[:] = lay_in_tool(model, ROBOT.home[None], 0.0)[0]
        mujoco.mj_kinematics(model, data)
        ball = next(i for i in range(model.ngeom) if model.geom_bodyid[i] == model.body("ball").id)
        walls = [i for i in range(model.ngeom) if model.geom_bodyid[i] == model.body("scoop").id]
        gaps = [mujoco.mj_geomDistance(model, data, ball, wall, 1.0, None) for wall in walls]
        np.testing.assert_allclose(sorted(gaps), [0.0] + 8 * [clearance], atol=1e-6)


def test_failures_are_outcomes(plans):
    (slow,) = try_plans(ROBOT, TASK, [replace(plans[0], duration=4.0)])
    assert slow.failure == "ball not released"
    assert slow.reward <= -5
    (dropped,) = try_plans(ROBOT, changed(failure={"least_release_speed_m_s": 50.0}), plans[:1])
    assert dropped.failure == "ball dropped"
    (weak,) = try_plans(ROBOT, TASK, [replace(plans[0], duration=0.05)])
    assert weak.failure == "arm did not follow"


def test_a_scene_that_explodes_is_one_failed_episode(plans):
    movements = move(plans[:2], TASK)
    wild = movements.positions.copy()
    wild[0, 100:] = np.nan
    broken = Movements(wild, movements.velocities, movements.accelerations, movements.durations)
    episodes = TASK.simulate(ROBOT, plans[:2], broken, False)
    assert episodes.failures == ("unstable simulation", "")
    np.testing.assert_array_equal(episodes.outcomes[1], throw(plans[1:2]).outcomes[0])


def test_the_target_is_the_tasks_or_the_demonstrations(plans):
    placed = TASK.place(plans[0], ROBOT)
    np.testing.assert_array_equal(placed.target, [2, 0, 0])
    own = TASK.model_copy(update={"target_m": None})
    np.testing.assert_array_equal(own.place(plans[0], ROBOT).target, plans[0].target)
    with pytest.raises(
        RefinementError, match=r"ball_throw needs a target on the floor \(target_m of"
    ):
        CmaEsConfig(episodes=1).run((replace(plans[0], target=np.full(3, np.nan)),), ROBOT, own)


def test_a_target_out_of_reach_is_a_search_without_success(plans):
    far = TASK.model_copy(update={"target_m": (60.0, 0.0)})
    (motion,) = CmaEsConfig(episodes=8).run(tuple(plans[:1]), ROBOT, far)
    assert not motion.success
    assert len(motion.returns) == 8
    assert motion.failure or motion.miss_before > 50
    assert not motion.miss < 50


@pytest.mark.parametrize("name", ["ur10", "iiwa7", "compi"])
def test_every_thrower_carries_the_scoop(name):
    robot = load_robot(name, "scoop")
    still = np.tile(robot.home, (1, 301, 1))
    movements = Movements(still, 0 * still, 0 * still, np.zeros(1))
    assert ball_model(robot, TASK).nq == robot.n + 7
    episodes = TASK.simulate(robot, [], movements, False)
    assert episodes.tracking_errors[0] < 1e-3
