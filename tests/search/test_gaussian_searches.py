import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime
from scipy.special import softmax

from besman.exceptions import RefinementError
from besman.search.cem import Cem
from besman.search.cma_es import CmaEs
from besman.search.gaussian import weighted_covariance
from besman.search.pi2 import Pi2, Pi2Cma, path_weights
from besman.search.reps import Reps, reps_dual, reps_weights

N = 20
SEARCHES = {
    "cma_es": lambda start, sigma, seed, bounds=None: CmaEs(start, sigma, None, seed, bounds),
    "reps": lambda start, sigma, seed, bounds=None: Reps(start, sigma, 25, seed, bounds),
    "pi2": lambda start, sigma, seed, bounds=None: Pi2(start, sigma, 20, seed, bounds),
    "pi2_cma": lambda start, sigma, seed, bounds=None: Pi2Cma(start, sigma, 20, seed, bounds),
    "cem": lambda start, sigma, seed, bounds=None: Cem(start, sigma, 50, seed, bounds, 0.2),
}


def sphere(x):
    return -np.sum(np.square(x), axis=-1)


def rosenbrock(x):
    ahead, here = x[..., 1:], x[..., :-1]
    return -np.sum(100 * (ahead - here**2) ** 2 + (1 - here) ** 2, axis=-1)


def maximise(function, search, episodes):
    best, tried = -np.inf, 0
    while tried < episodes and not search.exhausted:
        points = search.ask()
        returns = function(points)
        search.tell(points, returns)
        best, tried = max(best, np.nanmax(returns)), tried + len(points)
    return best


@pytest.mark.parametrize(
    ("name", "on_sphere", "on_rosenbrock"),
    [
        ("cma_es", -1e-10, -14),
        ("reps", -1e-6, -18),
        ("pi2", -1e-2, -17),
        ("pi2_cma", -1e-2, -21),
        ("cem", -0.1, -21),
    ],
)
def test_sphere_and_rosenbrock_in_twenty_dimensions(name, on_sphere, on_rosenbrock):
    make = SEARCHES[name]
    assert maximise(sphere, make(np.ones(N), 1.0, (0,)), 10_000) > on_sphere
    assert maximise(rosenbrock, make(np.zeros(N), 0.5, (0,)), 10_000) > on_rosenbrock


@pytest.mark.parametrize("name", SEARCHES)
def test_the_seed_decides_and_searches_side_by_side_do_not_disturb_each_other(name):
    alone, first, second = (SEARCHES[name](np.ones(5), 0.5, seed) for seed in [(1,), (1,), (2,)])
    maximise(sphere, alone, 200)
    for _ in range(200):
        maximise(sphere, second, 1)
    maximise(sphere, first, 200)
    points = first.ask()
    np.testing.assert_array_equal(points, alone.ask())
    assert not np.array_equal(points, second.ask()[: len(points)])


@pytest.mark.parametrize("name", SEARCHES)
def test_points_stay_within_bounds_and_find_an_optimum_on_them(name):
    low, high = np.full(4, -1.0), np.array([2.0, 2.0, 0.5, 2.0])
    search = SEARCHES[name](np.zeros(4), 0.5, (0,), (low, high))
    best = -np.inf
    for _ in range(150):
        points = search.ask()
        assert (points >= low - 1e-12).all()
        assert (points <= high + 1e-12).all()
        returns = -np.sum((points - 1.0) ** 2, axis=1)
        search.tell(points, returns)
        best = max(best, returns.max())
    assert best == pytest.approx(-0.25, abs=0.1)


@pytest.mark.parametrize("name", SEARCHES)
def test_a_start_outside_the_bounds_is_refused(name):
    with pytest.raises(
        RefinementError, match=r"coordinate 1 starts at 3, expected within .* -1 to"
    ):
        SEARCHES[name](np.array([0.0, 3.0]), 0.5, (0,), (-1.0, 2.0))


@pytest.mark.parametrize("name", SEARCHES)
def test_returns_that_are_no_numbers_pull_nowhere(name):
    search = SEARCHES[name](np.zeros(3), 0.5, (0,))
    for _ in range(120):
        points = search.ask()
        returns = sphere(points + 1.0)
        returns[points[:, 0] > 0.2] = np.nan
        returns[points[:, 1] > 0.3] = -np.inf
        search.tell(points, returns)
    np.testing.assert_allclose(search.ask().mean(axis=0), -1, atol=0.1)


@pytest.mark.parametrize("name", SEARCHES)
def test_a_generation_in_which_all_fail_is_survived(name):
    search = SEARCHES[name](np.ones(3), 0.5, (0,))
    for _ in range(3):
        points = search.ask()
        search.tell(points, np.full(len(points), np.nan))
    assert np.isfinite(search.ask()).all()
    assert not search.exhausted
    assert maximise(sphere, search, 3000) > -1e-3


@pytest.mark.parametrize("name", SEARCHES)
def test_exhausted_when_all_points_are_the_same(name):
    search = SEARCHES[name](np.ones(2), 0.5, (0,))
    assert not search.exhausted
    if name == "pi2":
        search._decay = 0.9
    maximise(sphere, search, 100_000)
    assert search.exhausted


def test_cem_fits_a_gaussian_to_the_elite():
    search = Cem(np.zeros(3), 1.0, 40, (0,), elite_share=0.25, covariance_rate=1.0)
    points = search.ask()
    returns = sphere(points - [1, 2, 3])
    search.tell(points, returns)
    elite = points[np.argsort(returns)[-10:]]
    np.testing.assert_allclose(search.mean, elite.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(search.covariance, np.cov(elite.T, bias=True), atol=1e-12)


def test_what_is_drawn_has_the_gaussians_moments():
    search = Cem(np.array([1.0, -2.0]), [0.5, 3.0], 200_000, (0,))
    search.covariance = np.array([[1.0, 0.6], [0.6, 0.5]])
    points = search.ask()
    np.testing.assert_allclose(points.mean(axis=0), search.mean, atol=0.02)
    np.testing.assert_allclose(np.cov(points.T), search.covariance, atol=0.02)


@given(st.integers(0, 10_000), st.floats(0.05, 20), st.floats(0.1, 4))
@settings(max_examples=40, deadline=None)
def test_gradient_of_the_dual_of_reps(seed, temperature, epsilon):
    returns = np.random.default_rng(seed).normal(size=30)
    value, slope = reps_dual(temperature, returns, epsilon)
    brute = temperature * epsilon + temperature * np.log(np.mean(np.exp(returns / temperature)))
    assert value == pytest.approx(brute, rel=1e-9)
    numeric = approx_fprime([temperature], lambda x: reps_dual(x[0], returns, epsilon)[0], 1e-7)
    assert slope == pytest.approx(numeric[0], abs=1e-4 * max(1, abs(numeric[0])))


@given(st.integers(0, 10_000), st.floats(0.2, 2.5))
@settings(max_examples=40, deadline=None)
def test_weights_of_reps_are_as_far_from_equal_as_epsilon_says(seed, epsilon):
    returns = 7 + 1000 * np.random.default_rng(seed).normal(size=60)
    weights = reps_weights(returns, epsilon)
    assert weights.sum() == pytest.approx(1)
    assert np.sum(weights * np.log(np.maximum(60 * weights, 1e-300))) == pytest.approx(
        epsilon, abs=0.02
    )
    np.testing.assert_allclose(reps_weights(3 * returns - 5, epsilon), weights, atol=1e-6)


def test_equal_returns_weigh_the_same():
    np.testing.assert_allclose(reps_weights(np.full(5, 3.0), 1.0), 0.2)
    np.testing.assert_allclose(path_weights(np.full(5, 3.0), 10.0), 0.2)


def test_pi2_moves_by_the_softmax_of_what_is_still_to_come():
    n_moments, n = 4, 3
    random = np.random.default_rng(0)
    active = random.uniform(size=(n_moments, n))
    search = Pi2(np.ones(n), 0.5, 6, (0,), activations=active, sharpness=10.0, decay=0.9)
    points, rewards = search.ask(), random.normal(size=(6, n_moments))
    search.tell(points, rewards)
    expected = np.ones(n)
    for column in range(n):
        change = 0.0
        for moment in range(n_moments):
            to_go = rewards[:, moment:].sum(axis=1)
            share = softmax(10 * (to_go - to_go.min()) / np.ptp(to_go))
            change += active[moment, column] * share @ (points[:, column] - 1.0)
        expected[column] += change / active[:, column].sum()
    np.testing.assert_allclose(search.mean, expected, atol=1e-12)
    np.testing.assert_allclose(search.covariance, 0.81 * 0.25 * np.eye(n), atol=1e-12)


def test_rewards_at_the_end_alone_are_one_return():
    both = [Pi2Cma(np.ones(3), 0.5, 6, (0,)) for _ in range(2)]
    points = both[0].ask()
    both[1].ask()
    rewards = np.zeros((6, 5))
    rewards[:, -1] = sphere(points)
    both[0].tell(points, rewards)
    both[1].tell(points, sphere(points))
    np.testing.assert_allclose(both[0].mean, both[1].mean, atol=1e-12)
    np.testing.assert_allclose(both[0].covariance, both[1].covariance, atol=1e-12)


def test_pi2_cma_fits_what_led_there():
    search = Pi2Cma(np.ones(3), 0.5, 6, (0,), covariance_rate=1.0)
    points = search.ask()
    search.tell(points, sphere(points))
    weights = path_weights(sphere(points), 10.0)
    expected = weighted_covariance(points, np.ones(3), weights)
    np.testing.assert_allclose(search.covariance, expected, atol=1e-14)
    np.testing.assert_allclose(search.mean, weights @ points, atol=1e-14)


def test_activations_of_another_shape_are_refused():
    search = Pi2(np.ones(3), 0.5, 6, (0,), activations=np.ones((4, 2)))
    with pytest.raises(RefinementError, match=r"activations have shape \(4, 2\), expected .*5, 3"):
        search.tell(search.ask(), np.random.default_rng(0).normal(size=(6, 5)))
