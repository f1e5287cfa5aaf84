import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from besman.robot.dynamics import body_inertias
from besman.simulation.perturbation import (
    Perturbation,
    Spreads,
    draw_perturbation,
    follow_with_play,
    perturb_controls,
    perturb_model,
)
from besman.simulation.perturbed_trials import finer_task, quarter_step_shift, try_perturbed
from besman.simulation.tasks.kinds import load_task
from besman.simulation.tasks.stick_throw.stick_throw import stick_throw_model
from besman.simulation.trial import try_plans

TASK = load_task("stick_throw")
NONE = dict.fromkeys(Spreads.model_fields, 0.0)
ARRAYS = (
    "geom_friction",
    "body_mass",
    "body_inertia",
    "dof_frictionloss",
    "dof_damping",
    "actuator_gainprm",
    "actuator_biasprm",
    "geom_size",
    "body_pos",
    "geom_solref",
)


def no_perturbation(n):
    """The perturbation of an arm with n joints that changes nothing."""
    one, none = np.ones(n), np.zeros(n)
    return Perturbation(1.0, 1.0, one, one, none, none, none, none, none, none)


def draw(robot, seed=0, **spreads):
    return draw_perturbation(Spreads(**{**NONE, **spreads}), robot, (seed,))


def changed_arrays(robot, perturbation):
    model = stick_throw_model(robot, TASK)
    other = perturb_model(model, perturbation)
    return {
        name for name in ARRAYS if not np.array_equal(getattr(model, name), getattr(other, name))
    }


@pytest.mark.parametrize(
    ("spread", "arrays"),
    [
        ("friction_share", {"geom_friction"}),
        ("object_mass_share", {"body_mass", "body_inertia"}),
        ("link_mass_share", {"body_mass", "body_inertia"}),
        ("joint_friction_share", {"dof_frictionloss"}),
        ("joint_damping_share", {"dof_damping"}),
        ("servo_gain_share", {"actuator_gainprm", "actuator_biasprm"}),
        ("delay_s", set()),
        ("lag_s", set()),
        ("backlash_rad", set()),
        ("offset_rad", set()),
        ("noise_rad", set()),
    ],
)
def test_a_spread_changes_what_it_says_and_nothing_else(robot, spread, arrays):
    one = draw(robot, **{spread: 0.05})
    assert changed_arrays(robot, one) == arrays
    controls = np.cumsum(np.full((200, robot.n), 0.002), axis=0)
    same = np.array_equal(perturb_controls(controls, one, 0.001), controls)
    assert same == (spread not in ("delay_s", "lag_s", "backlash_rad", "offset_rad", "noise_rad"))


def test_spreads_know_every_field():
    # The test above has to be told of a new one.
    assert len(Spreads.model_fields) == 11


def test_masses_are_those_of_links_and_stick(robot):
    model = stick_throw_model(robot, TASK)
    stick = model.body("stick").id
    lighter = perturb_model(model, draw(robot, object_mass_share=0.3))
    assert lighter.body_mass[stick] != model.body_mass[stick]
    np.testing.assert_array_equal(
        np.delete(lighter.body_mass, stick), np.delete(model.body_mass, stick)
    )
    one = draw(robot, link_mass_share=0.3)
    links = [model.body(name).id for name in robot.joint_names]
    masses = perturb_model(model, one).body_mass
    np.testing.assert_allclose(masses[links], body_inertias(robot).masses * one.link_masses)
    assert masses[stick] == model.body_mass[stick]


def test_constants_follow_the_masses(robot):
    model = stick_throw_model(robot, TASK)
    other = perturb_model(model, draw(robot, link_mass_share=0.3))
    total = other.body_subtreemass[other.jnt_bodyid[0]]
    arm = model.body_rootid == model.body_rootid[model.jnt_bodyid[0]]
    assert total == pytest.approx(other.body_mass[arm].sum())
    assert total != pytest.approx(model.body_subtreemass[model.jnt_bodyid[0]])


def test_a_levers_own_friction_is_perturbed():
    spec = mujoco.MjSpec.from_string(
        "<mujoco><worldbody><body><joint name='arm'/><geom size='.1'/></body><body>"
        "<joint name='lever' frictionloss='8'/><geom size='.1'/></body></worldbody>"
        "<actuator><position joint='arm' kp='10' kv='1'/></actuator></mujoco>"
    )
    import dataclasses

    one = dataclasses.replace(no_perturbation(1), friction=1.5)
    other = perturb_model(spec.compile(), one)
    np.testing.assert_allclose(other.dof_frictionloss, [0, 12])


def test_delay_shifts_set_points_in_time(robot):
    time = 0.001 * np.arange(500)
    controls = np.tile(np.sin(8 * time)[:, None], (1, robot.n))
    one = draw(robot, delay_s=0.02)
    late = perturb_controls(controls, one, 0.001)
    for joint, delay in enumerate(one.delays):
        wanted = np.sin(8 * np.maximum(time - delay, 0))
        np.testing.assert_allclose(late[:, joint], wanted, atol=1e-5)
    assert (one.delays >= 0).all()
    assert (one.delays <= 0.02).all()


def test_lag_is_that_of_a_first_order_system(robot):
    time = 0.001 * np.arange(500)
    controls = np.tile(np.sin(8 * time)[:, None], (1, robot.n))
    one = draw(robot, lag_s=0.05)
    lagging = perturb_controls(controls, one, 0.001)
    for joint in (0, 3):
        lag = one.lags[joint]
        exact = solve_ivp(
            lambda t, y, lag=lag: (np.sin(8 * t) - y) / lag, (0, 0.5), [0], t_eval=time, rtol=1e-9
        )
        np.testing.assert_allclose(lagging[:, joint], exact.y[0], atol=5e-3)


@given(
    st.lists(st.floats(-1, 1), min_size=2, max_size=30),
    st.floats(0.01, 1),
)
def test_play_follows_within_its_width_and_only_when_driven(driving, width):
    driving = np.array(driving)
    driven = follow_with_play(driving, width)
    assert (np.abs(driven - driving) <= width / 2 + 1e-12).all()
    moved = np.diff(driven) != 0
    touching = np.isclose(np.abs(driven - driving)[1:], width / 2)
    assert (touching | ~moved).all()


def test_noise_is_of_its_seed_and_not_of_the_time_step(robot):
    one = draw(robot, noise_rad=0.001)
    coarse = perturb_controls(np.zeros((401, robot.n)), one, 0.002)
    fine = perturb_controls(np.zeros((801, robot.n)), one, 0.001)
    np.testing.assert_allclose(fine[::2], coarse, atol=1e-12)
    assert coarse.std() == pytest.approx(0.001 * np.sqrt(2 / 3), rel=0.2)
    assert (coarse[0] == 0).all()
    other = perturb_controls(np.zeros((401, robot.n)), draw(robot, seed=1, noise_rad=0.001), 0.002)
    assert (other[10:] != coarse[10:]).any(axis=1).all()


def test_other_spreads_leave_a_draw_as_it_is(robot):
    alone, both = draw(robot, delay_s=0.02), draw(robot, delay_s=0.02, link_mass_share=0.1)
    np.testing.assert_array_equal(alone.delays, both.delays)


def test_no_perturbation_is_the_model_itself(robot, make_plan):
    plan = make_plan()
    (trial,) = try_plans(robot, TASK, [plan])
    (same,) = try_perturbed(robot, TASK, plan, [no_perturbation(robot.n)])
    np.testing.assert_array_equal(same.outcome, trial.outcome)
    assert same.reward == trial.reward


def test_a_perturbed_throw_is_the_same_alone_and_lands_elsewhere(robot, make_plan):
    plan = make_plan()
    worlds = [draw_perturbation(Spreads(), robot, (k,)) for k in range(11)]
    trials = try_perturbed(robot, TASK, plan, worlds)
    (alone,) = try_perturbed(robot, TASK, plan, worlds[9:10])
    np.testing.assert_array_equal(alone.outcome, trials[9].outcome)
    outcomes = np.array([trial.outcome for trial in trials])
    assert 0.001 < outcomes.std(axis=0)[:2].max() < 0.3


def test_an_arm_that_is_late_has_not_failed_for_that(robot, make_plan):
    (trial,) = try_perturbed(robot, TASK, make_plan(), [draw(robot, lag_s=0.2)])
    assert trial.failure != "arm did not follow"


def test_a_finer_task_has_a_quarter_of_every_time():
    fine = finer_task(TASK).simulation
    assert fine.time_step_s == TASK.simulation.time_step_s / 4
    assert fine.contact_time_s == TASK.simulation.contact_time_s / 4
    assert finer_task(load_task("reach")).simulation.time_step_s == 0.0005


def test_shift_at_a_quarter_of_the_step_is_that_of_an_integrator_of_first_order(
    robot, make_plan, monkeypatch
):
    """A ballistic case: semi-implicit Euler lands v h / 2 short of where the parabola does."""

    def simulate(self, robot, plans, movements, paths):
        step, height, speed = self.simulation.time_step_s, 1.3, 2.0
        n = int(np.ceil(np.sqrt(2 * height / 9.81) / step)) + 10
        time = step * np.arange(n)
        fallen = height - 9.81 * step**2 * np.cumsum(np.arange(n))
        landed = speed * np.interp(0.0, -fallen, time)
        from besman.simulation.episodes import Episodes

        return Episodes(
            np.array([[landed, 0, 0]]), np.zeros((1, 7)), np.zeros(1), np.zeros(1), ("",)
        )

    monkeypatch.setattr(type(TASK), "simulate", simulate)
    step = TASK.simulation.time_step_s
    assert quarter_step_shift(robot, TASK, make_plan()) == pytest.approx(
        2.0 * (step / 2 - step / 8), rel=0.02
    )


def test_spreads_that_make_no_sense_are_refused():
    with pytest.raises(ValueError, match="friction_share\n  Input should be less than 1"):
        Spreads(friction_share=1.0)
    with pytest.raises(ValueError, match="delay_s\n  Input should be less than or equal to"):
        Spreads(delay_s=1.0)
