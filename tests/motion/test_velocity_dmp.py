import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import BPoly

from besman.motion.forcing import ALPHA, BETA, LAST_PHASE, forcing_basis
from besman.motion.rest_at_ends import rest_at_both_ends
from besman.motion.velocity_dmp import fit_velocity_weights, roll_out_velocity, split_shape

NO_LEADS = np.zeros(2)


def random_dmp(seed=0, n=3, n_weights=10, scale=300.0):
    random = np.random.default_rng(seed)
    start, goal, start_velocity, goal_velocity = random.normal(size=(4, n))
    weights = scale * random.normal(size=(n, n_weights))
    return weights, start, goal, start_velocity, goal_velocity


def demonstration(n=3, seed=0):
    x = np.linspace(0, 1, 80)
    random = np.random.default_rng(seed)
    blend = (6 * x**5 - 15 * x**4 + 10 * x**3 + 0.4 * x)[:, None]
    wave = np.sin(np.pi * x)[:, None] ** 4 * np.sin(4 * x[:, None] * random.uniform(0.5, 1.5, n))
    way = random.normal(size=n)
    # Constant velocity, so no acceleration, at both ends.
    return 0.8 * x, random.normal(size=n) + blend * way + 0.2 * wave, 0.4 * way / 0.8


def test_rollout_solves_the_differential_equation():
    weights, start, goal, v0, v1 = random_dmp()
    duration, n = 0.7, 3
    goals = BPoly.from_derivatives([0, duration], [[start, v0, 0 * v0], [goal, v1, 0 * v1]])

    def derivative(t, state):
        y, dy = state[:n], state[n:]
        force = weights @ forcing_basis(t / duration, weights.shape[1])
        pull = ALPHA * (BETA * (goals(t) - y) + duration * (goals.derivative()(t) - dy))
        return np.concatenate([dy, (pull + force) / duration**2 + goals.derivative(2)(t)])

    time, state = np.linspace(0, duration, 137), np.concatenate([start, v0])
    solution = solve_ivp(derivative, (0, duration), state, t_eval=time, rtol=1e-11, atol=1e-12)
    q, v, a = roll_out_velocity(weights, start, goal, v0, v1, duration, NO_LEADS, time)
    np.testing.assert_allclose(q, solution.y[:n].T, atol=1e-9)
    np.testing.assert_allclose(v, solution.y[n:].T, atol=1e-8)
    expected = [derivative(t, s)[n:] for t, s in zip(time, solution.y.T, strict=True)]
    np.testing.assert_allclose(a, np.array(expected), atol=2e-5)
    assert LAST_PHASE == 0.01


def test_agrees_with_movement_primitives_as_its_step_shrinks():
    dmp = pytest.importorskip("movement_primitives.dmp")
    weights, start, goal, v0, v1 = random_dmp(n=2)
    errors = []
    for step in (1e-3, 5e-4, 2.5e-4):
        other = dmp.DMPWithFinalVelocity(2, 0.7, step, n_weights_per_dim=10, int_dt=step)
        other.forcing_term.weights_[:] = weights
        other.configure(start_y=start, goal_y=goal, start_yd=v0, goal_yd=v1)
        time, expected = other.open_loop()
        time, expected = time[time <= 0.7], expected[time <= 0.7]
        got = roll_out_velocity(weights, start, goal, v0, v1, 0.7, NO_LEADS, time)[0]
        errors.append(np.abs(got - expected).max())
    # Euler's error is of first order.
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.1)


LEADS = st.just(0.0) | st.floats(0.02, 0.3)


@given(st.integers(0, 1000), LEADS, LEADS)
@settings(max_examples=25, deadline=None)
def test_leads_are_those_of_the_demonstrations_and_nothing_jumps(seed, lead_in, lead_out):
    time, positions, velocity = demonstration(seed=seed)
    first, last = velocity * (lead_in > 0), velocity * (lead_out > 0)
    weights = fit_velocity_weights(time, positions, first, last, 20)
    leads, duration = np.array([lead_in, lead_out]), lead_in + 0.8 + lead_out
    ends = positions[0], positions[-1], first, last
    velocities = np.stack([first, last])
    with_leads = rest_at_both_ends(
        np.array([0, 0.8]), positions[[0, -1]], velocities, lead_in, lead_out
    )
    outside = (with_leads[0] <= lead_in) | (with_leads[0] >= lead_in + 0.8)
    got, v, a = roll_out_velocity(weights, *ends, duration, leads, with_leads[0])
    np.testing.assert_allclose(got[outside], with_leads[1][outside], atol=1e-8)
    np.testing.assert_allclose(v[[0, -1]], 0, atol=1e-6)
    np.testing.assert_allclose(a[[0, -1]], 0, atol=1e-5)
    fine = np.linspace(0, duration, 20001)
    q, v, a = roll_out_velocity(weights, *ends, duration, leads, fine)
    step = fine[1]
    np.testing.assert_allclose(np.diff(q, axis=0) / step, (v[1:] + v[:-1]) / 2, atol=1e-3)
    slopes = np.diff(v, axis=0) / step
    np.testing.assert_allclose(slopes, (a[1:] + a[:-1]) / 2, atol=2e-1)


def test_fit_has_the_demonstrated_velocities_and_imitates():
    time, positions, velocity = demonstration()
    weights = fit_velocity_weights(time, positions, velocity, velocity, 20)
    q, v, a = roll_out_velocity(
        weights, positions[0], positions[-1], velocity, velocity, 0.8, NO_LEADS, time
    )
    np.testing.assert_allclose(q[[0, -1]], positions[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(v[[0, -1]], np.stack([velocity, velocity]), atol=1e-8)
    np.testing.assert_allclose(a[[0, -1]], 0, atol=1e-6)
    assert np.sqrt(np.mean((q - positions) ** 2)) < 5e-4


def test_fit_finds_the_movement_again_and_goal_and_velocity_may_change():
    time, positions, velocity = demonstration()
    weights = fit_velocity_weights(time, positions, velocity, velocity, 12)
    parameters = weights, positions[0], positions[-1], velocity, velocity, 0.8, NO_LEADS, time
    again = roll_out_velocity(*parameters)[0]
    refitted = fit_velocity_weights(time, again, velocity, velocity, 12)
    got = roll_out_velocity(refitted, *parameters[1:])[0]
    np.testing.assert_allclose(got, again, atol=1e-7)
    goal, faster = positions[-1] + 0.3, 2 * velocity
    q, v, _ = roll_out_velocity(weights, positions[0], goal, velocity, faster, 0.5, NO_LEADS, [0.5])
    np.testing.assert_allclose(q[0], goal, atol=1e-9)
    np.testing.assert_allclose(v[0], faster, atol=1e-7)


def test_batch_is_the_same_as_one_by_one_to_the_last_bit():
    dmps = [random_dmp(seed) for seed in range(5)]
    durations, leads = np.linspace(0.4, 0.9, 5), np.random.default_rng(0).uniform(0, 0.1, (5, 2))
    time = np.arange(0, 1.0, 0.003)
    stacked = [np.stack(part) for part in zip(*dmps, strict=True)]
    batch = roll_out_velocity(*stacked, durations, leads, time)
    for index, dmp in enumerate(dmps):
        alone = roll_out_velocity(
            *(part[None] for part in dmp), durations[[index]], leads[[index]], time
        )
        one = roll_out_velocity(*dmp, durations[index], leads[index], time)
        for got, expected, close in zip(batch, alone, one, strict=True):
            assert (got[index] == expected[0]).all()
            np.testing.assert_allclose(got[index], close, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("n_weights", [10, 100, 101, 250])
def test_rest_and_shape_are_the_rollouts_without_weights_and_what_these_add(n_weights):
    weights, *ends = random_dmp(n_weights=n_weights)
    duration = 0.7
    rest, shape = split_shape(weights, *ends, duration)
    time = np.linspace(0.0, duration, len(rest))
    for expected, found in ((weights, rest + shape), (0.0 * weights, rest)):
        q, *_ = roll_out_velocity(expected, *ends, duration, NO_LEADS, time)
        np.testing.assert_allclose(found, q, rtol=0, atol=1e-9 * np.abs(q).max())
