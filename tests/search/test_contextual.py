import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime

from besman.exceptions import RefinementError
from besman.search.contextual_cma_es import (
    ContextualCmaEs,
    advantages,
    rank_weights,
    usual_population,
)
from besman.search.contextual_reps import ContextualReps, contextual_dual, contextual_weights
from besman.search.reps import Reps, reps_weights
from besman.search.upper_level import context_features, first_policy

REGION = (np.ones(2), np.full(2, 2.0))
N = 20
SEARCHES = {
    "c_reps": lambda start, seed, **more: ContextualReps(start, 1.0, REGION, (seed,), **more),
    "c_cma_es": lambda start, seed, **more: ContextualCmaEs(start, 1.0, REGION, (seed,), **more),
}


def shifted(function, seed, n_contexts):
    """Return the public contextual functions: f(x + G s), start and contexts by a seed."""
    random = np.random.default_rng(seed)
    matrix = random.standard_normal((N, n_contexts))
    return lambda points, contexts: function(points + contexts @ matrix.T), random


def sphere(x):
    return -np.sum(x**2, axis=-1)


def rosenbrock(x):
    ahead, here = x[..., 1:], x[..., :-1]
    return -np.sum(100 * (ahead - here**2) ** 2 + (1 - here) ** 2, axis=-1)


def learn(search, function, random, generations, n_contexts=2, population=50):
    for _ in range(generations):
        contexts = random.uniform(1, 2, (population, n_contexts))
        points = search.ask(contexts)
        returns = function(points, contexts)
        search.tell(contexts, points, returns)
    return returns.mean()


@pytest.mark.parametrize(("name", "public"), [("c_reps", -45), ("c_cma_es", -2e-5)])
def test_contextual_sphere_against_the_public_figures(name, public):
    function, random = shifted(sphere, 0, 2)
    more = {"epsilon": 1.0} if name == "c_reps" else {}
    search = SEARCHES[name](random.standard_normal(N), 0, **more)
    assert learn(search, function, random, 200) > public


@pytest.mark.slow
@pytest.mark.parametrize(("make", "public"), [(ContextualReps, -1.2e4), (ContextualCmaEs, -2e-3)])
def test_contextual_rosenbrock_against_the_public_figures(make, public):
    function, random = shifted(rosenbrock, 0, 1)
    search = make(random.standard_normal(N), 1.0, (np.ones(1), np.full(1, 2.0)), (0,))
    assert learn(search, function, random, 850, n_contexts=1) > public


@pytest.mark.parametrize("name", SEARCHES)
def test_knowing_the_context_beats_not_knowing_it(name):
    function, random = shifted(sphere, 1, 2)
    start = random.standard_normal(N)
    contextual = SEARCHES[name](start, 0)
    informed = learn(contextual, function, random, 100)
    plain = Reps(start, 1.0, 50, (0,))
    for _ in range(100):
        contexts = random.uniform(1, 2, (50, 2))
        points = plain.ask()
        returns = function(points, contexts)
        plain.tell(points, returns)
    assert informed > returns.mean() / 2
    tests = random.uniform(1, 2, (200, 2))
    ours, theirs = contextual.policy.means(tests), np.tile(plain.mean, (200, 1))
    assert function(ours, tests).mean() > function(theirs, tests).mean() / 2


@pytest.mark.parametrize("name", SEARCHES)
def test_quadratic_features_follow_what_is_quadratic(name):
    random = np.random.default_rng(0)

    def function(points, contexts):
        wanted = np.column_stack([contexts[:, 0] ** 2, contexts.prod(axis=1)])
        return -np.sum((points - wanted) ** 2, axis=1) + 30 * contexts[:, 0]

    search = SEARCHES[name](np.zeros(2), 0, features="quadratic")
    learn(search, function, random, 100, population=40)
    tests = random.uniform(1, 2, (50, 2))
    assert (function(search.policy.means(tests), tests) - 30 * tests[:, 0]).min() > -0.01


@pytest.mark.parametrize("name", SEARCHES)
def test_same_seed_same_policy_and_no_number_pulls_it(name):
    function, _ = shifted(sphere, 0, 2)

    def broken(points, contexts):
        returns = function(points, contexts)
        returns[::7] = np.nan
        returns[3] = -np.inf
        return returns

    one, two = SEARCHES[name](np.zeros(N), 5), SEARCHES[name](np.zeros(N), 5)
    for search in (one, two):
        learn(search, broken, np.random.default_rng(0), 20)
    np.testing.assert_array_equal(one.policy.gain, two.policy.gain)
    assert np.isfinite(one.policy.gain).all()
    before = one.policy.gain
    contexts = np.full((10, 2), 1.5)
    two.tell(contexts, two.ask(contexts), np.full(10, np.nan))
    assert np.isfinite(two.ask(contexts)).all()
    assert before is one.policy.gain


@pytest.mark.parametrize("name", SEARCHES)
def test_bounds(name):
    search = SEARCHES[name](np.zeros(3), 0, bounds=(-0.5, 0.5))
    contexts = np.full((200, 2), 1.5)
    points = search.ask(contexts)
    assert np.abs(points).max() == 0.5
    with pytest.raises(RefinementError, match="coordinate 0 starts at 0, expected within"):
        SEARCHES[name](np.zeros(3), 0, bounds=(0.5, 1.0))


@pytest.mark.parametrize("name", SEARCHES)
def test_exhausted_when_a_context_always_has_the_same_point(name):
    search = SEARCHES[name](np.zeros(2), 0)
    assert not search.exhausted
    random = np.random.default_rng(0)
    for _ in range(3000):
        learn(search, lambda points, contexts: sphere(points), random, 1, population=20)
        if search.exhausted:
            break
    assert search.exhausted


@given(st.integers(0, 10_000), st.floats(0.1, 10), st.floats(0.1, 3))
@settings(max_examples=30, deadline=None)
def test_gradient_of_the_contextual_dual(seed, temperature, epsilon):
    random = np.random.default_rng(seed)
    returns, features = random.normal(size=40), random.normal(size=(40, 3))
    parameters = np.concatenate([[temperature], random.normal(size=3)])
    value, gradient = contextual_dual(parameters, returns, features, epsilon)
    eta, nu = parameters[0], parameters[1:]
    brute = eta * epsilon + nu @ features.mean(axis=0)
    brute += eta * np.log(np.mean(np.exp((returns - features @ nu) / eta)))
    assert value == pytest.approx(brute, rel=1e-8, abs=1e-8)
    numeric = approx_fprime(
        parameters, lambda x: contextual_dual(x, returns, features, epsilon)[0], 1e-7
    )
    np.testing.assert_allclose(gradient, numeric, atol=2e-4 * max(1, np.abs(numeric).max()))


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_weights_keep_the_mean_features_and_the_entropy(seed):
    random = np.random.default_rng(seed)
    contexts = random.uniform(-1, 1, (80, 2))
    features = context_features(contexts, "quadratic")
    returns = 100 * contexts[:, 0] + random.normal(size=80)
    weights = contextual_weights(returns, features, 1.0)
    assert weights.sum() == pytest.approx(1)
    # The contexts were not chosen by the policy: it cannot prefer easy ones.
    np.testing.assert_allclose(weights @ features, features.mean(axis=0), atol=0.02)
    entropy = np.sum(weights * np.log(np.maximum(80 * weights, 1e-300)))
    assert entropy == pytest.approx(1.0, abs=0.05)


def test_without_differences_between_contexts_it_is_reps():
    returns = np.random.default_rng(0).normal(size=50)
    features = np.ones((50, 1))
    expected = reps_weights(returns, 1.0)
    np.testing.assert_allclose(contextual_weights(returns, features, 1.0), expected, atol=1e-5)


def test_advantages_are_what_regression_leaves():
    random = np.random.default_rng(0)
    features = context_features(random.uniform(-1, 1, (30, 2)), "quadratic")
    returns = features @ np.arange(6.0)
    np.testing.assert_allclose(advantages(returns, features), 0, atol=1e-5)


def test_rank_weights_are_those_of_cma():
    import cma

    strategy = cma.CMAEvolutionStrategy(np.zeros(5), 1, {"popsize": 10, "verbose": -9})
    values = np.random.default_rng(0).normal(size=10)
    weights = rank_weights(values)[np.argsort(-values)]
    np.testing.assert_allclose(weights[:5], strategy.sp.weights.positive_weights, atol=1e-12)
    np.testing.assert_allclose(weights[5:], 0)


def test_population_grows_with_the_contexts():
    assert usual_population(20, 2) == (4 + 9) * 5


def test_a_policy_fits_points_by_least_squares_and_keeps_what_they_leave_open():
    random = np.random.default_rng(0)
    policy = first_policy(np.ones(3), 0.5, REGION, "affine")
    np.testing.assert_array_equal(policy.means([[1.0, 2.0]]), [[1, 1, 1]])
    contexts, points = random.uniform(1, 2, (40, 2)), random.normal(size=(40, 3))
    weights = random.dirichlet(np.ones(40))
    features = policy.features_of(contexts)
    fitted = policy.fitted(features, points, weights, 0.0)
    root = np.sqrt(weights)[:, None]
    expected = np.linalg.lstsq(features * root, points * root, rcond=None)[0]
    np.testing.assert_allclose(fitted.gain.T, expected, atol=1e-9)
    # One context says nothing about the others' differences.
    one = np.tile([[1.5, 1.5]], (40, 1))
    same = policy.fitted(policy.features_of(one), points, weights, 1e-6)
    np.testing.assert_allclose(same.gain[:, 1:], 0, atol=1e-9)
    np.testing.assert_allclose(same.means(one)[0], weights @ points, atol=1e-4)


def test_drawn_points_have_the_policys_moments():
    policy = first_policy(np.array([1.0, 2.0]), [0.1, 3.0], REGION, "quadratic")
    points = policy.draw(np.full((100_000, 2), 1.2), np.random.default_rng(0))
    np.testing.assert_allclose(points.mean(axis=0), [1, 2], atol=0.05)
    np.testing.assert_allclose(points.std(axis=0), [0.1, 3], rtol=0.02)


def test_what_is_no_context_is_refused():
    policy = first_policy(np.ones(3), 0.5, REGION, "affine")
    with pytest.raises(RefinementError, match=r"contexts must have shape \(P, 2\), got \(4, 3\)"):
        policy.means(np.ones((4, 3)))
    with pytest.raises(RefinementError, match="contexts must be finite, got NaN or infinity"):
        policy.means([[1.0, np.nan]])
    with pytest.raises(RefinementError, match=r"context region: got .* expected least below"):
        first_policy(np.ones(3), 0.5, ([1.0], [1.0]), "affine")
