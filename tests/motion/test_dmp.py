import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from besman.motion.dmp import dmp_basis, respond, roll_out
from besman.motion.dmp_fit import fit_weights, goal_response, rest_conditions, shape_directions
from besman.motion.forcing import ALPHA, BETA, LAST_PHASE, count_nodes, forcing_basis


def random_dmp(seed=0, n=3, n_weights=10, scale=300.0):
    random = np.random.default_rng(seed)
    start, goal = random.normal(size=(2, n))
    return scale * random.normal(size=(n, n_weights)), start, goal


def demonstration(n=3, seed=0):
    x = np.linspace(0, 1, 80)
    random = np.random.default_rng(seed)
    blend = (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None]
    wave = np.sin(np.pi * x)[:, None] ** 3 * np.sin(4 * x[:, None] * random.uniform(0.5, 1.5, n))
    return 0.8 * x, random.normal(size=n) + blend * random.normal(size=n) + 0.2 * wave


def test_rollout_solves_the_differential_equation():
    weights, start, goal = random_dmp()
    duration, n = 0.7, len(start)

    def derivative(x, state):
        y, dy = state[:n], state[n:]
        phase = np.exp(np.log(LAST_PHASE) * x)
        force = weights @ forcing_basis(x, weights.shape[1])
        pull = ALPHA * (BETA * (goal - y) - dy) - ALPHA * BETA * (goal - start) * phase
        return np.concatenate([dy, pull + force])

    time = np.linspace(0, duration, 137)
    state = np.concatenate([start, np.zeros(n)])
    solution = solve_ivp(derivative, (0, 1), state, t_eval=time / duration, rtol=1e-11, atol=1e-12)
    positions, velocities, accelerations = roll_out(weights, start, goal, duration, time)
    np.testing.assert_allclose(positions, solution.y[:n].T, atol=1e-9)
    np.testing.assert_allclose(velocities, solution.y[n:].T / duration, atol=1e-8)
    expected = [derivative(x, s)[n:] for x, s in zip(time / duration, solution.y.T, strict=True)]
    np.testing.assert_allclose(accelerations, np.array(expected) / duration**2, atol=2e-5)


def test_agrees_with_movement_primitives_as_its_step_shrinks():
    dmp = pytest.importorskip("movement_primitives.dmp")
    weights, start, goal = random_dmp(n=2)
    errors = []
    for step in (1e-3, 5e-4, 2.5e-4):
        other = dmp.DMP(2, 0.7, step, n_weights_per_dim=10, smooth_scaling=True)
        other.forcing_term.weights_[:] = weights
        other.configure(start_y=start, goal_y=goal)
        time, expected = other.open_loop(step_function="euler")
        errors.append(np.abs(roll_out(weights, start, goal, 0.7, time)[0] - expected).max())
    # Euler's error is of first order.
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.1)
    np.testing.assert_allclose(
        other.forcing_term(0.3)[:, 0], weights @ forcing_basis(0.3 / 0.7, 10), rtol=1e-12
    )


def test_derivatives_are_those_of_the_positions_between_nodes():
    weights, start, goal = random_dmp()
    time, step = np.linspace(0.011, 0.69, 211), 1e-5
    before, _, _ = roll_out(weights, start, goal, 0.7, time - step)
    at, velocities, accelerations = roll_out(weights, start, goal, 0.7, time)
    after, _, _ = roll_out(weights, start, goal, 0.7, time + step)
    np.testing.assert_allclose((after - before) / (2 * step), velocities, atol=1e-6)
    np.testing.assert_allclose((after - 2 * at + before) / step**2, accelerations, atol=2e-3)


@given(st.floats(-3, 3), st.floats(0.2, 5))
@settings(max_examples=25, deadline=None)
def test_movement_is_linear_and_scales_with_time(shift, duration):
    weights, start, goal = random_dmp()
    time = np.linspace(0, 1, 41)
    one = roll_out(weights, start, goal, 1.0, time)
    moved = roll_out(weights, start + shift, goal + shift, 1.0, time)
    np.testing.assert_allclose(moved[0], one[0] + shift, atol=1e-12)
    slow = roll_out(weights, start, goal, duration, duration * time)
    for order in range(3):
        np.testing.assert_allclose(slow[order] * duration**order, one[order], atol=1e-8)
    twice = roll_out(2 * weights, 2 * start, 2 * goal, 1.0, time)
    np.testing.assert_allclose(twice[0], 2 * one[0], atol=1e-11)


def test_batch_is_the_same_as_one_by_one_to_the_last_bit():
    dmps = [random_dmp(seed) for seed in range(5)]
    durations = np.linspace(0.4, 0.9, 5)
    time = np.arange(0, 1.0, 0.003)
    batch = roll_out(*(np.stack(part) for part in zip(*dmps, strict=True)), durations, time)
    for index, (dmp, duration) in enumerate(zip(dmps, durations, strict=True)):
        alone = roll_out(*(part[None] for part in dmp), np.array([duration]), time)
        one_for_all = roll_out(*dmp, duration, time)
        for got, expected, close in zip(batch, alone, one_for_all, strict=True):
            assert (got[index] == expected[0]).all()
            np.testing.assert_allclose(got[index], close, rtol=1e-8, atol=1e-8)


def test_stands_still_after_its_duration():
    time, positions = demonstration()
    weights = fit_weights(time, positions, 15)
    q, v, a = roll_out(weights, positions[0], positions[-1], 0.8, np.array([0.8, 0.81, 3.0]))
    np.testing.assert_allclose(q, np.tile(positions[-1], (3, 1)), atol=1e-9)
    assert (v[1:] == 0).all()
    assert (a[1:] == 0).all()


@pytest.mark.parametrize(("n_weights", "error"), [(10, 2e-2), (20, 5e-4), (30, 5e-5)])
def test_fit_imitates_and_rests_at_both_ends(n_weights, error):
    time, positions = demonstration()
    weights = fit_weights(time, positions, n_weights)
    got, velocities, accelerations = roll_out(weights, positions[0], positions[-1], time[-1], time)
    assert np.sqrt(np.mean((got - positions) ** 2)) < error
    np.testing.assert_allclose(got[-1], positions[-1], atol=1e-10)
    np.testing.assert_allclose(velocities[[0, -1]], 0, atol=1e-9)
    np.testing.assert_allclose(accelerations[[0, -1]], 0, atol=1e-6)


def test_fit_finds_the_weights_of_a_dmp_again():
    time, positions = demonstration()
    weights = fit_weights(time, positions, 8)
    again, _, _ = roll_out(weights, positions[0], positions[-1], 0.8, time)
    refitted = fit_weights(time, again, 8)
    np.testing.assert_allclose(
        roll_out(refitted, again[0], again[-1], 0.8, time)[0], again, atol=1e-7
    )


def test_fit_is_the_best_there_is():
    time, positions = demonstration(n=1)
    weights = fit_weights(time, positions, 8)

    def error(change):
        changed = roll_out(weights + change, positions[0], positions[-1], time[-1], time)[0]
        return np.sum((changed - positions) ** 2)

    for direction in shape_directions(8):
        assert error(0) <= error(1e-3 * direction)
        assert error(0) <= error(-1e-3 * direction)


@pytest.mark.parametrize("n_weights", [6, 20, 40])
def test_goal_response_and_shapes_keep_the_rest(n_weights):
    conditions = rest_conditions(n_weights)
    moved = conditions[:, 1] + conditions[:, 2:] @ goal_response(n_weights)
    np.testing.assert_allclose(moved, 0, atol=1e-9)
    shapes = shape_directions(n_weights)
    assert shapes.shape == (n_weights - 4, n_weights)
    np.testing.assert_allclose(conditions[:, 2:] @ shapes.T, 0, atol=1e-9)
    basis = dmp_basis(n_weights)
    moves = np.sqrt(np.mean((basis.position[:, 2:] @ shapes.T) ** 2, axis=0))
    bends = np.sqrt(np.mean((basis.acceleration[:, 2:] @ shapes.T) ** 2, axis=0))
    assert moves[0] == pytest.approx(1)
    assert (np.diff(moves) < 0).all()
    np.testing.assert_allclose(bends, bends[0], rtol=1e-6)


@pytest.mark.parametrize("n_weights", [101, 140, 230])
def test_local_responses_are_those_of_all_basis_functions(n_weights):
    parameters = np.random.default_rng(0).normal(size=(n_weights + 2, 3)) * 300
    basis = dmp_basis(n_weights)
    dense = basis.position, basis.velocity, basis.acceleration
    assert len(basis.position) == count_nodes(n_weights) >= 4 * n_weights
    for matrix, found in zip(dense, respond(parameters), strict=True):
        expected = matrix @ parameters
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_a_search_over_many_weights_is_one_over_few():
    """Goal and shapes move a movement alike, and keep its rest."""
    n_weights, x = 170, np.linspace(0, 1, 101)
    conditions = rest_conditions(n_weights)
    moved = conditions[:, 1] + conditions[:, 2:] @ goal_response(n_weights)
    np.testing.assert_allclose(moved, 0, atol=1e-9)
    zero = np.zeros(96)
    for number in (100, n_weights):
        shapes = shape_directions(number)
        assert shapes.shape == (96, number)
        np.testing.assert_allclose(rest_conditions(number)[:, 2:] @ shapes.T, 0, atol=1e-9)
        moves = roll_out(shapes, zero, zero, 1.0, x)[0]
        goes = roll_out(goal_response(number)[None], [0.0], [1.0], 1.0, x)[0]
        if number == 100:
            before = moves, goes
    np.testing.assert_allclose(moves, before[0], atol=1e-4)
    np.testing.assert_allclose(goes, before[1], atol=1e-6)


def test_many_turns_are_not_lost_to_rounding():
    """Late weights act through a small phase; 24 for a turn follow it to its end."""
    time = np.linspace(0, 9, 901)
    turns = 6 * 2 * np.pi * (10 * (time / 9) ** 3 - 15 * (time / 9) ** 4 + 6 * (time / 9) ** 5)
    positions = np.column_stack([np.cos(turns), np.sin(turns)])
    weights = fit_weights(time, positions, 144)
    got, _, _ = roll_out(weights, positions[0], positions[-1], 9.0, time)
    assert np.abs(got - positions).max() < 5e-4


def test_samples_are_interpolated_alike_in_blocks_and_at_once():
    weights, start, goal = random_dmp()
    time = np.linspace(0, 1, 3001)
    whole = roll_out(weights, start, goal, 1.0, time)
    for found, part in zip(whole, roll_out(weights, start, goal, 1.0, time[:700]), strict=True):
        np.testing.assert_array_equal(found[:700], part)
