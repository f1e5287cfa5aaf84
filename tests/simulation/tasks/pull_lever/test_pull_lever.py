from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from besman.exceptions import RefinementError
from besman.robot.model import load_robot
from besman.simulation.episodes import Movements
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.pull_lever.hinge import find_hinge
from besman.simulation.tasks.pull_lever.lever_scene import lever_model
from besman.simulation.trial import try_plans
from besman.stages.refine.stage import CmaEsConfig

TASK = load_task("pull_lever")


def changed(**sections):
    parts = {
        name: getattr(TASK, name).model_copy(update=values) for name, values in sections.items()
    }
    return TASK.model_copy(update=parts)


def try_pull(robot, plan, task):
    (trial,) = try_plans(robot, task, [task.place(plan, robot)], paths=True)
    return trial


def test_the_lever_is_pulled(puller, pull):
    trial = try_pull(puller, pull, TASK)
    assert trial.failure == ""
    assert trial.success
    assert trial.miss == 0
    np.testing.assert_allclose(trial.object_path[-1], trial.outcome)
    # The handle stays on its arc.
    placed = TASK.place(pull, puller)
    hinge = TASK.hinge(placed)
    radii = np.linalg.norm(trial.object_path - hinge.centre, axis=1)
    np.testing.assert_allclose(radii, TASK.lever.length_m, atol=1e-9)
    angles = [hinge.angle(place) for place in trial.object_path]
    assert np.degrees(angles[-1]) > TASK.lever.pull_deg


def test_a_pull_that_ends_too_early_misses_by_the_arc(puller, pull):
    trial = try_pull(puller, pull, changed(lever={"pull_deg": 90.0}))
    hinge = TASK.hinge(pull)
    expected = 0.28 * (np.pi / 2 - hinge.angle(trial.outcome))
    assert trial.miss == pytest.approx(expected)
    assert trial.miss > 0.1
    assert not trial.success
    assert trial.failure == ""


@given(st.floats(0.02, 0.5), st.floats(-1.2, 1.2), st.floats(-np.pi, np.pi), st.floats(0.26, 0.6))
@settings(max_examples=60, deadline=None)
def test_the_handles_arc_goes_through_start_and_end(chord, steep, heading, length):
    start = np.array([0.5, 0.1, 1.2, 1.0, 0, 0, 0])
    end = start.copy()
    ahead = np.array([np.cos(heading), np.sin(heading), 0])
    end[:3] += chord * (-np.cos(steep) * ahead - [0, 0, np.sin(steep)])
    hinge = find_hinge(start, end, length, (0.0, 0.0, 0.0))
    np.testing.assert_allclose(hinge.handle(0.0, length), start[:3], atol=1e-9)
    angle = hinge.angle(end[:3])
    assert 0 < angle < np.pi
    np.testing.assert_allclose(hinge.handle(angle, length), end[:3], atol=1e-9)
    np.testing.assert_allclose(hinge.axes.T @ hinge.axes, np.eye(3), atol=1e-12)
    # It bulges ahead, or up where the pull is level.
    middle = hinge.handle(angle / 2, length) - (start[:3] + end[:3]) / 2
    if chord * np.cos(steep) > 0.02 and abs(steep) > 0.01:
        assert middle @ ahead > 0
    elif chord * np.cos(steep) > 0.02 and abs(steep) < 1e-4:
        assert middle[2] > 0


def free_lever(puller, **lever):
    """A lever far from the arm, horizontal at first."""
    task = changed(lever={"stop_deg": 170.0, **lever})
    start, end = np.zeros(7), np.zeros(7)
    start[:4], end[:4] = [5.28, 0, 2, 1], [5.0, 0, 1.72, 1]
    hinge = find_hinge(start, end, 0.28, (0, 0, 0))
    np.testing.assert_allclose(hinge.centre, [5, 0, 2], atol=1e-9)
    model = lever_model(puller, task, hinge.key)
    data = mujoco.MjData(model)
    data.qpos[: puller.n] = data.ctrl[: puller.n] = puller.home
    return model, data


def test_a_lever_without_friction_is_a_pendulum(puller):
    model, data = free_lever(puller, friction_nm=0.0, damping_nms=0.0, mass_kg=1.0)
    mujoco.mj_forward(model, data)
    dof = puller.n
    inertia = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    assert inertia[dof, dof] == pytest.approx(0.28**2 / 3, rel=0.05)
    weight = data.qfrc_bias[dof]
    assert abs(weight) == pytest.approx(9.81 * 0.14, rel=1e-6)
    steps, angles = 150, []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        angles.append(data.qpos[dof])
    time = model.opt.timestep * np.arange(1, steps + 1)
    gain = abs(weight) / inertia[dof, dof]
    solution = solve_ivp(
        lambda _, s: [s[1], gain * np.cos(s[0])], (0, time[-1]), [0, 0], t_eval=time, rtol=1e-9
    )
    np.testing.assert_allclose(angles, solution.y[0], atol=0.02)
    kinetic = inertia[dof, dof] * data.qvel[dof] ** 2 / 2
    assert kinetic == pytest.approx(9.81 * 0.14 * np.sin(angles[-1]), rel=0.02)


@pytest.mark.parametrize(("share", "falls"), [(0.8, True), (1.2, False)])
def test_friction_holds_the_lever_if_and_only_if_it_is_stronger_than_gravity(puller, share, falls):
    friction = share * 9.81 * 0.14
    model, data = free_lever(puller, friction_nm=friction, mass_kg=1.0)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert (data.qpos[puller.n] > 0.1) == falls


def test_failures_are_outcomes(puller, pull):
    beside = try_pull(puller, pull, changed(lever={"offset_m": (0.0, 0.4, 0.0)}))
    assert beside.failure == "hook slipped off the lever"
    assert 9 < beside.costs["failure"] <= 10
    stuck = try_pull(puller, pull, changed(lever={"stop_deg": 2.0}))
    assert stuck.failure == "arm did not follow"
    assert not beside.success
    assert not stuck.success


def test_a_movement_that_is_no_number_is_one_failed_episode(puller, pull):
    plan = TASK.place(pull, puller)
    movements = TASK.move([plan, plan], puller)
    wild = movements.positions.copy()
    wild[0, 100:] = np.nan
    broken = Movements(wild, movements.velocities, movements.accelerations, movements.durations)
    episodes = TASK.simulate(puller, [plan, plan], broken, False)
    assert episodes.failures == ("unstable simulation", "")
    assert np.isnan(episodes.outcomes[0]).all()


def test_demonstrations_that_no_lever_fits_are_errors(puller, pull):
    far = replace(pull, goal_pose=pull.goal_pose + np.array([1.0, 0, 0, 0, 0, 0, 0]))
    with pytest.raises(
        RefinementError,
        match=r"a: task pull_lever: the demonstrated movement ends .* expected 1 cm",
    ):
        CmaEsConfig(episodes=1).run((far,), puller, TASK)
    none = replace(pull, start_pose=np.full(7, np.nan))
    with pytest.raises(RefinementError, match="pull_lever needs a demonstrated start and end pose"):
        CmaEsConfig(episodes=1).run((none,), puller, TASK)


@pytest.mark.slow
def test_a_longer_pull_than_was_shown_is_learnt(puller, pull):
    task = changed(lever={"pull_deg": 70.0})
    before = try_pull(puller, pull, task)
    assert not before.success
    config = CmaEsConfig(episodes=150, units={"goal_rad": 0.05, "shape_rad": 0.05})
    (motion,) = config.run((pull,), puller, task)
    assert motion.success
    assert motion.miss_before > task.success_radius_m


@pytest.mark.parametrize("name", ["ur5", "iiwa7", "compi"])
def test_other_arms_carry_the_hook(name):
    robot = load_robot(name, "hook")
    hinge = find_hinge(
        np.array([0.8, 0, 1, 1, 0, 0, 0]), np.array([0.7, 0, 0.8, 1, 0, 0, 0]), 0.28, 0
    )
    assert lever_model(robot, TASK, hinge.key).nq == robot.n + 1
