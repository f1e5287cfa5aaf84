import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from besman.simulation.episodes import Movements
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.stick_throw.stick_throw import simulate_stick_throws, stick_throw_model
from besman.simulation.tasks.stick_throw.throw_and_flight import (
    ballistic_flight,
    ballistic_touchdown,
)
from besman.simulation.trial import move

TASK = load_task("stick_throw")


def changed(**sections):
    parts = {
        name: getattr(TASK, name).model_copy(update=values) for name, values in sections.items()
    }
    return TASK.model_copy(update=parts)


def throw(robot, plans, task=TASK, paths=False):
    return simulate_stick_throws(robot, task, move(plans, task), paths)


def test_stick_leaves_and_lands_in_front(robot, make_plan):
    episodes = throw(robot, [make_plan()], paths=True)
    assert episodes.failures == ("",)
    x, y, z = episodes.outcomes[0]
    assert 0.8 < x < 2.5
    assert -1.2 < y < 0.0
    assert z == 0.0
    assert episodes.tracking_errors[0] < 2e-3
    path = episodes.object_paths[0]
    np.testing.assert_allclose(path[-1], episodes.outcomes[0], atol=1e-9)
    # No teleport: from step to step the stick moves at most as fast as it can fall and fly.
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 0.06


def test_energy_of_the_flight_is_what_the_arm_gave(robot, make_plan):
    path = throw(robot, [make_plan()], paths=True).object_paths[0]
    held = path[: np.argmax(path[:, 2]) // 2]
    speed = np.linalg.norm(np.diff(held, axis=0), axis=1) / TASK.simulation.time_step_s
    assert speed[0] < 0.1
    assert speed.max() < 4.5


def test_the_stick_starts_at_rest_on_the_back_plate(robot, make_plan):
    model = stick_throw_model(robot, TASK)
    data = mujoco.MjData(model)
    plan = make_plan()
    movements = move([plan], TASK)
    from besman.simulation.scenes import lay_in_tool

    data.qpos[:] = lay_in_tool(model, movements.positions[:, 0], TASK.stick.length_m / 2)[0]
    mujoco.mj_forward(model, data)
    tail = data.sensordata[:3]
    np.testing.assert_allclose(tail, 0, atol=1e-9)
    assert all(contact.dist > -1e-9 for contact in data.contact)


def test_faster_throws_fly_farther(robot, make_plan):
    plans = [make_plan(duration) for duration in (0.75, 0.65, 0.55)]
    x = throw(robot, plans).outcomes[:, 0]
    assert (np.diff(x) > 0.05).all()


def test_landing_does_not_depend_on_the_time_step(robot, make_plan):
    plans = [make_plan(duration) for duration in (0.53, 0.58, 0.63)]
    coarse = throw(robot, plans).outcomes
    fine_task = changed(simulation={"time_step_s": 0.00025, "contact_time_s": 0.0005})
    fine = throw(robot, plans, fine_task).outcomes
    assert np.median(np.linalg.norm(fine - coarse, axis=1)) < 0.03


def test_the_flight_is_ballistic_from_wherever_it_is_read_off(robot, make_plan):
    plans = [make_plan(0.53), make_plan(0.6)]
    early = throw(robot, plans, changed(simulation={"clear_distance_m": 0.05})).outcomes
    late = throw(robot, plans, changed(simulation={"clear_distance_m": 0.3})).outcomes
    np.testing.assert_allclose(early, late, atol=2e-3)


def test_a_batch_is_the_same_as_one_by_one_to_the_last_bit(robot, make_plan):
    plans = [make_plan(duration) for duration in (0.53, 0.7, 1.5)]
    together = throw(robot, plans)
    for index, plan in enumerate(plans):
        alone = throw(robot, [plan])
        np.testing.assert_array_equal(together.outcomes[index], alone.outcomes[0])
        assert together.failures[index] == alone.failures[0]
        assert together.shortfalls[index] == alone.shortfalls[0]


def test_a_slow_movement_keeps_the_stick(robot, make_plan):
    episodes = throw(robot, [make_plan(4.0)])
    assert episodes.failures == ("stick not released",)
    assert np.isnan(episodes.outcomes).all()
    assert 0 < episodes.shortfalls[0] <= 1


def test_a_holder_that_points_down_drops_the_stick(robot, make_plan):
    from besman.robot.kinematics import forward_kinematics

    plan = make_plan()
    candidates = np.random.default_rng(0).uniform(-2, 2, (500, 6))
    poses = forward_kinematics(robot.chain, candidates)
    down = candidates[np.argmin(poses[:, 2, 2] - (poses[:, 2, 3] > 1.0))]
    still = Movements(
        positions=np.tile(down, (1, 600, 1)),
        velocities=np.zeros((1, 600, 6)),
        accelerations=np.zeros((1, 600, 6)),
        durations=np.array([plan.duration]),
    )
    task = changed(failure={"least_release_speed_m_s": 3.0})
    assert simulate_stick_throws(robot, task, still).failures == ("stick dropped",)


def test_an_arm_without_the_strength_does_not_follow(robot, make_plan):
    episodes = throw(robot, [make_plan(0.1)])
    assert episodes.failures == ("arm did not follow",)


def test_a_movement_that_explodes_is_a_failed_episode_beside_a_good_one(robot, make_plan):
    movements = move([make_plan(), make_plan()], TASK)
    wild = movements.positions.copy()
    wild[0, 100:] = np.nan
    broken = Movements(wild, movements.velocities, movements.accelerations, movements.durations)
    episodes = simulate_stick_throws(robot, TASK, broken)
    assert episodes.failures[0] == "unstable simulation"
    assert np.isnan(episodes.outcomes[0]).all()
    assert episodes.failures[1] == ""


def test_ballistics_agree_with_an_integrator():
    position, velocity = np.array([0.1, 0.2, 1.3]), np.array([2.0, -0.5, 1.5])

    def floor(_, state):
        return state[2]

    floor.terminal, floor.direction = True, -1
    solution = solve_ivp(
        lambda _, s: [*s[3:], 0, 0, -9.81],
        (0, 5),
        [*position, *velocity],
        events=floor,
        rtol=1e-10,
        atol=1e-12,
    )
    landed = ballistic_touchdown(position, velocity)
    np.testing.assert_allclose(landed, solution.y_events[0][0][:3], atol=1e-9)
    path = ballistic_flight(position, velocity)
    np.testing.assert_allclose(path[-1], landed)
    assert path[:, 2].max() == pytest.approx(1.3 + 1.5**2 / (2 * 9.81), abs=1e-3)


def test_nothing_lands_from_below_the_floor():
    assert np.isnan(ballistic_touchdown([0, 0, -0.1], [1, 0, 1])).all()
    assert ballistic_flight(np.array([0, 0, -0.1]), np.ones(3)).shape == (0, 3)
